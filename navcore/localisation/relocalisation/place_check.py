"""Check of a place that the operator gives: refined, then accepted or refused by how it fits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from navcore.config.localisation.relocalisation import DEFAULT_RELOCALISATION, RelocalisationConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.relocalisation.place_fit import PlaceFit, doubt_of, evaluate_place
from navcore.localisation.relocalisation.place_map import PlaceMap
from navcore.localisation.relocalisation.place_search import SearchWindow, search_places
from navcore.localisation.relocalisation.submap import Submap


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceCheck:
    """What the scans say about a place that the operator gave."""

    is_accepted: bool
    """Whether the robot may be placed there."""
    reason: str
    """Why not, for the operator; empty if it is accepted."""
    fit: PlaceFit
    """The refined pose with its covariance and the share of points that fit; without any that
    fits, the given pose."""


def check_place(
    submap: Submap,
    given: Pose2,
    place_map: PlaceMap,
    config: RelocalisationConfig = DEFAULT_RELOCALISATION,
) -> PlaceCheck:
    """Return where near a given T_map_base the robot is, by what it has seen in the last metres.

    Takes some ten milliseconds; for a thread beside the tick.
    """
    window = SearchWindow(
        T_map_base=given, reach_m=config.click_m, reach_rad=math.radians(config.click_deg)
    )
    places = search_places(submap, place_map, config, window)
    if not places:
        fit = evaluate_place(submap, given, place_map, config.fit)
        reason = (
            "too little is seen to check the place; drive on or turn round"
            if len(submap) < config.search.least_points
            else _share_of(fit)
        )
        return PlaceCheck(is_accepted=False, reason=reason, fit=fit)
    reason = doubt_of(places, config) or _uncertainty_of(places[0], config)
    if places[0].fit_share < config.click_fit_share:
        reason = _share_of(places[0])
    return PlaceCheck(is_accepted=not reason, reason=reason, fit=places[0])


def _share_of(fit: PlaceFit) -> str:
    return f"only {fit.fit_share:.0%} of what is seen fits there"


def _uncertainty_of(fit: PlaceFit, config: RelocalisationConfig) -> str:
    if fit.sigma_m <= config.click_sigma_m:
        return ""
    return (
        f"the place is uncertain by {fit.sigma_m:.2f} m along one direction; drive on or turn round"
    )
