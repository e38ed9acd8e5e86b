"""A saved map while the place in it is on trial: what the robot has seen from a place that turns
out to be wrong is taken back.

A robot that is switched on believes a place before it is sure of it, because it has to drive to
tell. Until then walls that it sees stand wherever it takes itself to be, and what the map holds
there is cleared.
"""

from __future__ import annotations

from navcore.config.localisation.localisation import StartConfig
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.localisation import Localisation
from navcore.localisation.new_way import NewWay
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage.map_state import MapState


class MapTrial:
    """Holds a copy of the saved map until the place in it is believed for good, for at most some
    metres."""

    def __init__(
        self, point_map: PointMap, localisation: Localisation, config: StartConfig
    ) -> None:
        self._map, self._localisation, self._config = point_map, localisation, config
        self._saved: MapState | None = None
        self._is_clean, self._edits = True, 0
        self._is_corrected, self._proof = False, NewWay(config.trial_m)

    @property
    def is_open(self) -> bool:
        """Whether what is seen now may be taken back."""
        return self._saved is not None

    def begin(self) -> None:
        """Hold the map that was loaded, if the place in it is on trial."""
        is_open = self._localisation.is_on_trial
        self._saved = self._map.state() if is_open else None
        self._is_clean, self._edits = True, self._map.edits.count
        self._is_corrected, self._proof = False, NewWay(self._config.trial_m)

    def follow(self, place: LocalisationEstimate) -> bool:
        """Note the estimate of one more frame, before it enters the map: end the trial, or take
        back what was seen from a place that is given up or corrected; returns whether the map has
        changed.

        An edit by hand ends the trial, too: the operator has looked at the map and found it right.
        """
        if not place.is_known:
            self._proof = NewWay(self._config.trial_m)
            return self.take_back()
        # The pose follows a correction from the next frame on, or when the robot stands.
        is_applied = self._is_corrected and not self._localisation.waits_for_standstill
        is_changed = is_applied and self.take_back()
        self._is_corrected = place.place_correction is not None or (
            self._is_corrected and not is_applied
        )
        if place.place_correction is not None and place.place_correction.source is None:
            # By scans: the place that they have found has to prove itself.
            self._proof = NewWay(self._config.trial_m)
        if not self._localisation.is_in_new:
            self._proof.follow(place.T_driven_base)
        if self._is_edited or not self._localisation.is_on_trial or self._proof.is_enough:
            self._saved = None
        self._is_clean = False
        return is_changed

    @property
    def _is_edited(self) -> bool:
        """Whether the operator has edited the map by hand since it was loaded."""
        return self._map.edits.count != self._edits

    def take_back(self) -> bool:
        """Restore the saved map while the trial is open; returns whether it has changed."""
        if self._is_edited:
            self._saved = None
        if self._saved is None or self._is_clean:
            return False
        scans = self._map.scans
        self._map.restore(self._saved)
        self._map.scans = scans
        self._localisation.forget_session()
        self._is_clean, self._is_corrected = True, False
        return True
