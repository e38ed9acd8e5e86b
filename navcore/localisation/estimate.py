"""The localisation estimate: where odometry's frame lies in the map (REP 105), and how sure that
is."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from navcore.geometry.arrays import Floats
from navcore.geometry.transform import IDENTITY, Matrix, Pose2
from navcore.robot.fix import FixSource


class LocalisationState(StrEnum):
    """How the robot knows its pose."""

    LOCATED = "located"
    """Newest scans fit the map at the estimated pose."""
    DEAD_RECKONING = "dead reckoning"
    """By odometry alone since the last scan that fitted; the covariance grows."""
    CHECKING = "checking"
    """The place at which the robot was switched on in a saved map is compared with the first
    scans; not believed yet."""
    AMBIGUOUS = "ambiguous"
    """Several places fit; none is believed."""
    LOST = "lost"
    """The pose is unknown: the scans contradict the map."""

    @property
    def is_known(self) -> bool:
        """Whether the pose may be driven by."""
        return self in (LocalisationState.LOCATED, LocalisationState.DEAD_RECKONING)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceCorrection:
    """A correction of the pose by what contradicted it for a while: the robot was moved by other
    means than its wheels, or the saved map is bent there."""

    source: FixSource | None
    """What measured the position fixes; None for scans, which fit the saved map beside."""
    shift_m: float
    """Distance in metres from where the robot was believed to be."""


def _certain() -> Matrix:
    return np.zeros((3, 3))


def _undriven() -> Floats:
    return np.zeros(3)


def _unmoved() -> Matrix:
    return np.zeros((2, 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalisationEstimate:
    """Result of one frame of localisation."""

    T_map_odom: Pose2 = IDENTITY
    """Pose of odometry's frame in the map."""
    T_map_base: Pose2 = IDENTITY
    """Pose of the robot in the map at the frame's stamp."""
    T_driven_base: Pose2 = IDENTITY
    """Pose by odometry without its turns at standstill (`DrivenOdometry`)."""
    travel: Floats = field(default_factory=_undriven)
    """(3,) distance in metres, turns in radians and time in seconds that were driven so far."""
    covariance: Matrix = field(default_factory=_certain)
    """(3, 3) covariance of `T_map_base` relative to the map: x and y in metres along the map's
    axes, yaw in radians."""
    covariance_by_motion: Matrix | None = None
    """(3, 3) covariance without what the robot's own new map tells; None where it is the same."""
    offset: Matrix = field(default_factory=_unmoved)
    """(2, 2) covariance that has to be added to that of the position for its growth to bound how
    uncertain the robot has become relative to where it was: it shrinks by absolute positions, which
    move the estimate away from what is on the map."""
    moved: Matrix = field(default_factory=_unmoved)
    """(2, 2) covariance of what the position was moved by so far, otherwise than odometry has told:
    absolute positions, and pushes."""
    state: LocalisationState = LocalisationState.DEAD_RECKONING
    """How the robot knows its pose."""
    match_share: float | None = None
    """Share of the scan's points that fit the map, 0 to 1; None without enough points."""
    since_ns: int = 0
    """Stamp of the frame at which this state began, nanoseconds."""
    since_m: float = 0.0
    """Distance driven since the last frame that fitted the map, metres."""
    candidates: tuple[Pose2, ...] = ()
    """Places that are possible while none is believed (`CHECKING`, `AMBIGUOUS`), T_map_base, best
    first."""
    is_searched: bool = False
    """Whether the robot is lost, and its place is looked for in the whole map."""
    reason: str = ""
    """What the search for the place of a lost robot lacks, for the operator; empty before it has
    told."""
    place_correction: PlaceCorrection | None = None
    """Correction at this frame, None without one; if it is large, it waits until the robot
    stands."""
    pushed_m: float = 0.0
    """Distance in metres by which the robot was moved without its wheels before this frame, as
    scans of a new map tell; 0 for not at all."""

    @property
    def is_known(self) -> bool:
        """Whether the pose may be driven by."""
        return self.state.is_known

    @property
    def is_lost(self) -> bool:
        """Whether the pose has nothing to do with where the robot is."""
        return self.state is LocalisationState.LOST or self.is_searched

    @property
    def positions(self) -> Matrix:
        """(2, 2, 2) covariances of the position, in the map and by motion."""
        by_motion = self.covariance_by_motion
        both = (self.covariance, self.covariance if by_motion is None else by_motion)
        return np.array([covariance[:2, :2] for covariance in both])

    @property
    def relative(self) -> Matrix:
        """(2, 2) covariance by motion whose growth since an earlier estimate bounds that of the
        position relative to where it was then."""
        return np.asarray(self.positions[1] + self.offset)

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the position along its least certain direction, metres."""
        return math.sqrt(max(float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]), 0.0))
