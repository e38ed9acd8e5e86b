"""Margins of zones that follow the robot's uncertainty relative to each zone.

A zone belongs to the place beside which it was drawn. What counts is how uncertain the robot's
position has become since it was there, not how uncertain it is in the map: a zone drawn beside the
robot is exact however far it has come by dead reckoning.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from navcore.config.zone_margins import ZoneMarginConfig
from navcore.geometry.transform import Matrix
from navcore.localisation.estimate import LocalisationEstimate
from navcore.mission.zone import Zone
from navcore.mission.zone_growth import grow, largest_axis_m, spread_of

_ZERO = np.zeros((2, 2))
_DEFAULT = ZoneMarginConfig()


@dataclass(slots=True, eq=False)
class _Margin:
    """What is known of one version of a zone."""

    anchor: Matrix
    """(2, 2) covariance of the robot's position when it was beside the zone."""
    grown: Zone
    """The grown zone."""
    covariance: Matrix = field(default_factory=lambda: _ZERO)
    """(2, 2) covariance by which the zone is grown at present."""


class ZoneMargins:
    """Grows the zones of an operator as the robot's uncertainty grows, in steps: every change costs
    a new costmap."""

    def __init__(self, config: ZoneMarginConfig = _DEFAULT, *, frozen: bool = False) -> None:
        """With `frozen` the map was loaded: its zones belong to its own frame."""
        self._config, self._frozen = config, frozen
        self._margins: dict[tuple[str, int], _Margin] = {}
        self._trail: list[tuple[float, float]] = []
        self._covariances: list[Matrix] = []

    def follow(self, zones: tuple[Zone, ...], place: LocalisationEstimate) -> tuple[Zone, ...]:
        """Return the zones, grown by the present uncertainty; the same objects as long as their
        growth has not changed."""
        self._note(place)
        keys = {(zone.id, zone.version) for zone in zones}
        self._margins = {key: one for key, one in self._margins.items() if key in keys}
        return tuple(self._grown(zone, place) for zone in zones)

    def covariance(self, zone: Zone, place: LocalisationEstimate) -> Matrix:
        """Return the (2, 2) covariance of the robot's position relative to a zone, square
        metres."""
        margin = self._margins.get((zone.id, zone.version))
        anchor = _ZERO if margin is None else margin.anchor
        variances, axes = np.linalg.eigh(place.covariance[:2, :2] - anchor)
        return np.asarray((axes * np.maximum(variances, 0.0)) @ axes.T)

    def covariances(
        self, zones: tuple[Zone, ...], place: LocalisationEstimate
    ) -> dict[str, Matrix]:
        """Return the covariance relative to each zone by its id."""
        return {zone.id: self.covariance(zone, place) for zone in zones}

    def _grown(self, zone: Zone, place: LocalisationEstimate) -> Zone:
        margin = self._margins.get((zone.id, zone.version))
        if margin is None:
            margin = _Margin(anchor=self._anchor(zone), grown=zone)
            self._margins[zone.id, zone.version] = margin
        needed, config = self.covariance(zone, place), self._config
        growth_m = largest_axis_m(spread_of(needed, config.sigmas))
        if growth_m <= config.negligible_m:
            margin.covariance, margin.grown = _ZERO, zone
            return zone
        kept_m = largest_axis_m(spread_of(margin.covariance, config.sigmas))
        # An ellipse contains another one if the difference of the covariances has no negative
        # eigenvalue.
        suffices = np.linalg.eigvalsh(margin.covariance - needed)[0] >= 0
        if not suffices or kept_m > 2 * (growth_m + config.step_m):
            slack = (1 + config.slack) * needed + config.step_m**2 * np.eye(2)
            margin.covariance = slack
            margin.grown = grow(zone, spread_of(slack, config.sigmas))
        return margin.grown

    def _anchor(self, zone: Zone) -> Matrix:
        """Return the covariance that the robot had where it came nearest to a new zone."""
        if self._frozen or not self._trail:
            return _ZERO
        middle = np.mean(np.asarray(zone.polygon), axis=0)
        nearest = int(np.argmin(np.hypot(*(np.asarray(self._trail) - middle).T)))
        return self._covariances[nearest]

    def _note(self, place: LocalisationEstimate) -> None:
        here = place.T_map_base
        if self._trail and here.distance_to(*self._trail[-1]) < self._config.trail_spacing_m:
            self._covariances[-1] = place.covariance[:2, :2]
            return
        self._trail.append((here.x_m, here.y_m))
        self._covariances.append(place.covariance[:2, :2])
