"""Where the robot is in the map, as the console shows and sets it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.estimate import LocalisationState
from web.interface.wire import WholePolyline, served


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceOut:
    """How well the robot knows where it is."""

    state: LocalisationState = LocalisationState.DEAD_RECKONING
    """How the robot knows its pose."""
    text: str = ""
    """The same as a sentence, with what to do."""
    major_m: float = 0.0
    """Larger half axis of the ellipse of two standard deviations of the position, metres."""
    minor_m: float = 0.0
    """Smaller half axis of that ellipse, metres."""
    axis_rad: float = 0.0
    """Direction of the larger half axis in radians of the map frame."""
    yaw_sigma_rad: float = 0.0
    """Standard deviation of the heading in radians."""
    match_share: float | None = None
    """Share of the newest scan that fits the map, 0 to 1; null without enough points."""
    since_m: float = 0.0
    """Distance driven since the last scan that fitted the map, metres."""
    candidates: tuple[Pose2, ...] = ()
    """Places that fit while none is believed, best first."""
    on_trial: bool = False
    """Whether the place is believed and the first metres have not confirmed it yet: until then the
    map is not written, and what is seen is taken back if the place turns out to be wrong."""
    searching: bool = False
    """Whether the robot looks for its place in the whole map."""
    T_map_odom: Pose2 = IDENTITY
    """Pose of odometry's frame in the map."""


@served
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceCheck:
    """How well the newest scan fits the map at a proposed pose."""

    pose: Pose2
    """The proposed pose, T_map_base, after the scan was matched there."""
    match_share: float | None
    """Share of the scan's points that fit the map there, 0 to 1; null where nothing is known."""
    fits: bool
    """Whether the share suffices to accept the pose."""
    text: str
    """The same as a sentence."""
    scan: WholePolyline = field(default_factory=lambda: np.empty((0, 2)))
    """Points of the scan in metres of the map frame, at the matched pose."""


class PlaceEdits(Protocol):
    """Where the robot is, and how an operator says so."""

    def status(self) -> PlaceOut:
        """Return how well the robot knows where it is."""

    def check(self, pose: Pose2) -> PlaceCheck:
        """Match the newest scan near a pose; nothing is applied. `Refused` before the first
        frame."""

    def place(self, pose: Pose2, *, force: bool) -> PlaceCheck:
        """Set the robot's pose to where the newest scan fits best near a pose. `Refused` while the
        robot drives, and where the scan contradicts the map unless `force`."""

    def search(self) -> None:
        """Look for the robot's place in the whole map; `Refused` while a mission drives."""
