"""Configuration of the safety gate and of the monitors that it judges by.

It is no part of `NavigatorConfig`: the gate depends on no setting of what it supervises.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from navcore.toml_config import ranged


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)


@dataclass(frozen=True, slots=True, kw_only=True)
class GateConfig:
    """When commands and frames expire, and when the wheels count as blocked."""

    command_life_s: float = ranged(0.01, 10.0, default=0.25)
    """Largest age in seconds of a command that is passed on."""
    frame_life_s: float = ranged(0.01, 10.0, default=0.5)
    """Largest age in seconds of the newest camera image while the robot moves."""
    blocked_s: float = ranged(0.1, 60.0, default=2.0)
    """Time in seconds after which commanded wheels that do not turn count as blocked."""
    commanded_mps: float = ranged(0.0, 1.0, default=0.05)
    """Speed in metres per second of the fastest point of the body from which a command must turn
    the wheels."""
    turning_share: float = ranged(0.0, 1.0, default=0.1)
    """Share of the commanded speed below which the wheels count as standing."""
    max_period_s: float = ranged(0.01, 1.0, default=0.1)
    """Longest period in seconds over which acceleration is allowed; a gate that was not called for
    longer allows no more than over this."""

    @property
    def command_life_ns(self) -> int:
        """Largest age in nanoseconds of a command that is passed on."""
        return _ns(self.command_life_s)

    @property
    def frame_life_ns(self) -> int:
        """Largest age in nanoseconds of the newest camera image while the robot moves."""
        return _ns(self.frame_life_s)

    @property
    def blocked_ns(self) -> int:
        """Time in nanoseconds after which commanded wheels that do not turn count as blocked."""
        return _ns(self.blocked_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionMonitorConfig:
    """What counts as an obstacle to the gate, and from when on contact is imminent.

    Heights and slope equal the defaults of `ObservationConfig`, but are independent of it. What is
    above the robot is told by its profile.
    """

    obstacle_height_m: float = ranged(0.02, 1.0, default=0.10)
    """Height above the ground in metres from which a measurement is an obstacle."""
    drop_m: float = ranged(0.05, 2.0, default=0.15)
    """Depth below the ground in metres from which the floor counts as a drop."""
    max_slope: float = ranged(0.0, 0.5, default=0.2)
    """Rise or fall per metre up to which a surface counts as ground."""
    range_m: float = ranged(0.5, 10.0, default=2.5)
    """Distance from the middle of the robot in metres beyond which no contact is imminent."""
    max_depth_m: float = ranged(0.5, 20.0, default=6.0)
    """Depth in metres beyond which a measurement is too coarse."""
    padding_ahead_m: float = ranged(0.0, 0.5, default=0.03)
    """Clearance in metres kept before and behind the footprint."""
    padding_aside_m: float = ranged(0.0, 0.5, default=0.01)
    """Clearance in metres kept beside the footprint; with more, narrow doors would be closed."""
    stride_px: int = ranged(1, 16, default=2)
    """Step in pixels between the rows and columns that are evaluated; of a D455 at 424 × 240, the
    same angle in finer images."""
    min_points: int = ranged(1, 100, default=4)
    """Number of points that the footprint must meet before they count as an obstacle and not as
    noise."""
    horizon_s: float = ranged(0.1, 10.0, default=1.0)
    """Time to contact in seconds from which contact is not imminent: at full speed the robot stops
    within 0.5 s, seen late within 0.9 s."""
    step_m: float = ranged(0.001, 0.2, default=0.02)
    """Largest distance in metres that a point of the body moves between two collision checks."""
    reaction_s: float = ranged(0.0, 2.0, default=0.25)
    """Time in seconds from the appearance of an obstacle to the braking of the wheels: next image,
    next command and the link."""
    reaction_after_frame_s: float = ranged(0.0, 2.0, default=0.15)
    """Part of the reaction time in seconds that follows the capture of an image that is late."""
    memory_s: float = ranged(0.0, 60.0, default=5.0)
    """Time in seconds for which an obstacle that went out of sight is taken to be where it was."""
    memory_cell_m: float = ranged(0.002, 0.05, default=0.01)
    """Side in metres of the cells of the floor of which no more points out of sight are remembered
    than `min_points`: a robot that turns beside a wall keeps its shape, not each of its pixels."""
    creep_mps: float = ranged(0.0, 0.5, default=0.03)
    """Allowed speed in metres per second below which the robot stops."""

    @property
    def memory_ns(self) -> int:
        """Time in nanoseconds for which an obstacle that went out of sight is remembered."""
        return _ns(self.memory_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepOutMonitorConfig:
    """How the motion of the robot is predicted against zones and beware cells."""

    reaction_s: float = ranged(0.0, 2.0, default=0.25)
    """Time in seconds from the newest pose to the braking of the wheels."""
    reaction_after_frame_s: float = ranged(0.0, 2.0, default=0.15)
    """Part of the reaction time in seconds that follows the capture of an image that is late."""
    stop_margin_m: float = ranged(0.0, 1.0, default=0.05)
    """Distance in metres that wheels which skid may add to the braking distance."""
    standing_mps: float = ranged(0.001, 0.1, default=0.005)
    """Speed in metres per second of the fastest point of the body below which the robot stands."""
    spacing_m: float = ranged(0.005, 0.2, default=0.03)
    """Spacing in metres of the points by which the covered part of an area is compared."""
    step_m: float = ranged(0.005, 0.2, default=0.05)
    """Largest distance in metres that a point of the body moves between two checks."""
    shares: tuple[float, ...] = ranged(0.0, 1.0, default=(1.0, 0.75, 0.5, 0.3, 0.15))
    """Shares of the commanded velocity that are tried, the largest first."""
    sigmas: float = ranged(0.0, 6.0, default=2.0)
    """Standard deviations of the robot's position relative to a zone by which the zone grows."""
    cells_within_m: float = ranged(0.5, 20.0, default=2.5)
    """Distance in metres from the middle of the robot within which the gate knows beware cells; at
    full speed it stops within 0.5 m."""
    seen_within_m: float = ranged(0.5, 20.0, default=4.0)
    """Distance in metres within which a beware cell in view of the camera counts as seen; farther
    away depth is coarse."""
    hidden_m: float = ranged(0.0, 2.0, default=0.3)
    """Distance in metres before a cell at which the camera must measure something for the cell to
    be hidden; less is the front of what stands on it."""
    neighbour_m: float = ranged(0.0, 1.0, default=0.25)
    """Distance in metres within which a beware cell that comes up without having been in view, as
    after a correction of the map, counts as seen when its nearest neighbour was."""
    largest_growth_m: float = ranged(0.0, 2.0, default=0.30)
    """Growth in metres beyond which the position is too uncertain to drive fast near the zone; the
    planner keeps a clearance then."""
    uncertain_clearance_m: float = ranged(0.0, 5.0, default=0.5)
    """Distance in metres from the grown zone within which the side of the robot is near."""
    uncertain_mps: float = ranged(0.05, 2.0, default=0.3)
    """Speed in metres per second of the fastest point of the body that is permitted there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorMonitorConfig:
    """Which motion odometry may report, how frames may be dated, and how a repeated image is
    recognised."""

    speed_factor: float = ranged(1.0, 3.0, default=1.1)
    """Factor by which the robot may be faster than it measures."""
    distance_tolerance_m: float = ranged(0.0, 1.0, default=0.03)
    """Distance in metres that odometry may jump by, since it comes in steps."""
    turn_tolerance_rad: float = ranged(0.0, 1.0, default=0.03)
    """Angle in radians that odometry may jump by, since it comes in steps."""
    max_gap_s: float = ranged(0.1, 10.0, default=1.0)
    """Longest time in seconds between two frames in which the robot can have moved: the gate has
    stopped it by then."""
    ahead_s: float = ranged(0.0, 1.0, default=0.1)
    """Largest time in seconds by which a frame may be dated after the present time, which is read
    at another moment."""
    steady_frames: int = ranged(1, 100, default=3)
    """Number of consistent frames after which a pose that has jumped back is trusted again."""
    sample_px: int = ranged(1, 1000, default=13)
    """Step in pixels between the pixels that are compared with those of the last frame; a camera
    that works never repeats them all, because of its noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyConfig:
    """Everything that can be set about the safety gate."""

    gate: GateConfig = field(default_factory=GateConfig)
    """Expiry of commands and frames, blocked wheels."""
    collision: CollisionMonitorConfig = field(default_factory=CollisionMonitorConfig)
    """Imminent contact."""
    keep_out: KeepOutMonitorConfig = field(default_factory=KeepOutMonitorConfig)
    """Zones and beware cells ahead."""
    sensors: SensorMonitorConfig = field(default_factory=SensorMonitorConfig)
    """Plausibility of frames."""


DEFAULT_SAFETY = SafetyConfig()
"""Configuration that the robot drives with."""
