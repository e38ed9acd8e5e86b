"""Events of localisation, in words: where the robot lost or found its place, and corrections of the
map."""

from __future__ import annotations

import math

from navcore.localisation.estimate import LocalisationState
from navcore.navigator import TickResult
from navcore.robot.fix import FixSource

SETTLED_NS = 2_000_000_000
"""Time for which a state must hold before it is told, nanoseconds: scans fit now and then where
little is in view."""
_TEXTS = {
    LocalisationState.LOCATED: "The robot knows its place: what the camera sees fits the map.",
    LocalisationState.DEAD_RECKONING: "The robot goes by its wheels alone: nothing in view fits "
    "the map.",
    LocalisationState.CHECKING: "The robot compares what it sees with the map.",
    LocalisationState.AMBIGUOUS: "The robot is unsure of its place.",
    LocalisationState.LOST: "The robot has lost its place: what the camera sees contradicts the "
    "map.",
}
_CORRECTIONS = {
    None: "What the camera sees fits the map beside the robot's place: it is corrected by "
    "{shift_m:.2f} m.",
    FixSource.GNSS: "Satellite positions have contradicted the robot's place for seconds: it is "
    "corrected to them by {shift_m:.2f} m.",
    FixSource.TAG: "A tag has contradicted the robot's place for seconds: it is corrected to the "
    "tag by {shift_m:.2f} m.",
    FixSource.DOCK: "The dock has contradicted the robot's place for seconds: it is corrected to "
    "the dock by {shift_m:.2f} m.",
}


class PlaceEvents:
    """Says what has changed since the last tick."""

    def __init__(self) -> None:
        self._told: LocalisationState | None = None

    def after(self, decision: TickResult) -> list[str]:
        """Return sentences for one more tick."""
        told, place = [], decision.place
        correction = decision.correction
        if correction is not None and not correction.loops:
            told.append("Another program has corrected poses of the map.")
        elif correction is not None:
            here = correction.motion.inverse() @ place.T_map_base
            shift_m = here.distance_to(place.T_map_base.x_m, place.T_map_base.y_m)
            loops = "place was" if correction.loops == 1 else "places were"
            turn_deg = abs(math.degrees(correction.motion.yaw_rad))
            told.append(
                f"{correction.loops} {loops} recognised: the map and the robot's place on it are "
                f"corrected by {shift_m:.2f} m, {turn_deg:.1f}°."
            )
        if (shifted := place.place_correction) is not None:
            told.append(_CORRECTIONS[shifted.source].format(shift_m=shifted.shift_m))
        if place.pushed_m > 0.0:
            told.append(
                f"The robot was pushed, or its wheels have slipped: its place is corrected by "
                f"{place.pushed_m:.2f} m."
            )
        if decision.taken_back:
            told.append("What was seen from a wrong place is taken back from the map.")
        urgent = not place.is_known
        settled = decision.frame.stamp_ns - place.since_ns >= SETTLED_NS
        if place.state is not self._told and (urgent or settled):
            if self._told is not None or urgent:
                told.append(_TEXTS[place.state])
            self._told = place.state
        return told
