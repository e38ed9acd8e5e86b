"""The map while the place in it is on trial: what the robot has seen from a place that turns out to
be wrong is taken back.

A robot believes a place before it is sure of it, because it has to drive to tell: where it is
switched on, where a search has found it, where an operator has put it against what it sees. Until
then walls that it sees stand wherever it takes itself to be, and what the map holds there is
cleared.
"""

from __future__ import annotations

from navcore.config.localisation.localisation import StartConfig
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.localisation import Localisation
from navcore.localisation.new_way import NewWay
from navcore.localisation.scans.scan import Keyframe
from navcore.mapping.point_map import Checkpoint, PointMap
from navcore.mapping.storage.map_state import MapState


class MapTrial:
    """Holds a copy of the map until the place in it is believed for good, for at most some
    metres."""

    def __init__(
        self, point_map: PointMap, localisation: Localisation, config: StartConfig
    ) -> None:
        self._map, self._localisation, self._config = point_map, localisation, config
        self._held: Checkpoint | None = None
        self._keyframes: tuple[Keyframe, ...] = ()
        """Those of the map that is held."""
        self._is_clean, self._edits = True, 0
        self._is_corrected, self._proof = False, NewWay(config.trial_m)
        self._is_vouched = self._was_lost = False

    @property
    def is_open(self) -> bool:
        """Whether what is seen now may be taken back."""
        return self._held is not None

    @property
    def held(self) -> MapState | None:
        """The saved map without what may be taken back; None where nothing may."""
        if self._held is None or self._is_edited or not self._localisation.has_saved_map:
            return None
        return self._held.state

    def end(self) -> None:
        """Take the place for right."""
        self._held = None

    def begin(self) -> None:
        """Hold the map that was loaded, if the place in it is on trial."""
        self._held = None
        self._was_lost = False
        if self._localisation.is_on_trial:
            self.hold()

    def hold(self, *, is_vouched: bool = False) -> None:
        """Hold the map as it is now, with what this session has seen, before the robot goes on from
        a place that may be wrong; a map that is held already is held on.

        `is_vouched`: an operator says that it is right, so that metres count as well where the map
        shows little of what is seen. In a new map, which proves nothing, any metre counts.
        """
        self._is_vouched, self._proof = is_vouched, NewWay(self._config.trial_m)
        if self._held is not None and not self._is_edited:
            return
        self._held, self._keyframes = self._map.checkpoint(), self._localisation.keyframes
        self._is_clean, self._edits = True, self._map.edits.by_operator
        self._is_corrected = False

    def follow(self, place: LocalisationEstimate) -> bool:
        """Note the estimate of one more frame, before it enters the map: end the trial, or take
        back what was seen from a place that is given up or corrected; returns whether the map has
        changed.

        An edit by hand ends the trial, too: the operator has looked at the map and found it right.
        """
        was_lost, self._was_lost = self._was_lost, not place.is_known
        if not place.is_known:
            self._proof, self._is_vouched = NewWay(self._config.trial_m), False
            return self.take_back()
        if was_lost and self._localisation.is_on_trial and self._localisation.has_saved_map:
            self.hold(is_vouched=self._is_vouched)
        # The pose follows a correction from the next frame on, or when the robot stands: until then
        # the map shows what is seen where it lies beside the robot, by which rules are kept.
        waits = self._localisation.waits_for_standstill
        is_applied = self._is_corrected and not waits
        is_changed = is_applied and self.take_back()
        self._is_corrected = (
            waits or place.place_correction is not None or (self._is_corrected and not is_applied)
        )
        if place.place_correction is not None and place.place_correction.source is None:
            # By scans: the place that they have found has to prove itself.
            self._proof = NewWay(self._config.trial_m)
        if self._is_vouched or not self._localisation.is_in_new:
            self._proof.follow(place.T_driven_base)
        is_over = not self._is_proving or self._proof.is_enough
        if self._is_edited or (is_over and not waits):
            self._held = None
        self._is_clean = False
        return is_changed

    @property
    def _is_proving(self) -> bool:
        """Whether the way from here on still has to tell whether the place is right."""
        if self._localisation.has_saved_map:
            return self._localisation.is_on_trial
        return self._is_vouched and self._proof.driven_m < self._config.trial_m

    @property
    def _is_edited(self) -> bool:
        """Whether the operator has edited the map by hand since it is held."""
        return self._map.edits.by_operator != self._edits

    def take_back(self) -> bool:
        """Return to the map that is held, if the trial is open; returns whether it has changed."""
        if self._is_edited:
            self._held = None
        if self._held is None or self._is_clean:
            return False
        self._map.return_to(self._held)
        self._localisation.return_to(self._keyframes)
        self._is_clean, self._is_corrected = True, False
        return True
