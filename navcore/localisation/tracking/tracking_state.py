"""The state of tracking: located, on dead reckoning or lost, and the doubt that leads there."""

from __future__ import annotations

from navcore.config.localisation.localisation import TrackingConfig
from navcore.localisation.estimate import LocalisationState
from navcore.localisation.tracking.odometry_model import OdometryStep


class TrackingState:
    """Whether the robot is tracked; frames that contradict the map for too long say that it is
    not."""

    def __init__(self, rules: TrackingConfig) -> None:
        self._rules = rules
        self.state = LocalisationState.DEAD_RECKONING
        """The state."""
        self.since_ns = 0
        """Stamp in nanoseconds of the frame at which it began."""
        self.since_m = 0.0
        """Distance in metres that was driven since the robot was located or placed."""
        self.doubt_s = 0.0
        """Time in seconds of contradicting frames, less twice that of fitting ones; no frame tells
        of a gap before it."""
        self._doubt_m = 0.0

    @property
    def is_lost(self) -> bool:
        """Whether the robot is lost until it is placed."""
        return self.state is LocalisationState.LOST

    def locate(self, stamp_ns: int) -> None:
        """Note that a map tells the place."""
        self.since_m = 0.0
        self._enter(LocalisationState.LOCATED, stamp_ns)

    def place(self, stamp_ns: int) -> None:
        """Note that the robot was set to a place: the only way on from `LOST`."""
        self.since_m = 0.0
        self.reckon(stamp_ns)

    def reckon(self, stamp_ns: int) -> None:
        """Note that odometry alone tells the place."""
        self._enter(LocalisationState.DEAD_RECKONING, stamp_ns)

    def lose(self, stamp_ns: int) -> None:
        """Note that nothing tells the place."""
        self._enter(LocalisationState.LOST, stamp_ns)

    def trust(self, step: OdometryStep) -> None:
        """Take back doubt: a frame fits."""
        self.doubt_s = max(self.doubt_s - 2 * step.seen_s, 0.0)
        self._doubt_m = max(self._doubt_m - 2 * step.seen_m, 0.0)

    def doubt(self, step: OdometryStep, stamp_ns: int) -> None:
        """Count frames that contradict the map; after too many the robot is lost."""
        self.doubt_s += step.seen_s
        self._doubt_m += step.seen_m
        if self.doubt_s >= self._rules.lost_s or self._doubt_m >= self._rules.lost_m:
            self.lose(stamp_ns)
        else:
            self.reckon(stamp_ns)

    def forget_doubt(self) -> None:
        """Take back all doubt: the robot is tracked from another pose."""
        self.doubt_s = self._doubt_m = 0.0

    def _enter(self, state: LocalisationState, stamp_ns: int) -> None:
        if state is not self.state:
            self.state, self.since_ns = state, stamp_ns
