"""Configuration of the control stage: path following, manoeuvres, speed beside people."""

from __future__ import annotations

from dataclasses import dataclass, field

from navcore.errors import BadConfiguration
from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalPlannerConfig:
    """What an operator sets about the local planner."""

    padding_m: float = ranged(0.0, 0.5, default=0.05)
    """Clearance in metres kept around the footprint wherever there is room for it."""
    lookahead_m: float = ranged(0.2, 3.0, default=0.8)
    """Distance in metres along the path to the point the robot aims at."""
    arrival_m: float = ranged(0.02, 0.3, default=0.12)
    """Goal tolerance in metres."""
    nearly_m: float = ranged(0.0, 0.5, default=0.25)
    """Looser goal tolerance in metres where only a manoeuvre would bring the robot nearer."""
    aligned_deg: float = ranged(1.0, 45.0, default=5.0)
    """Tolerance in degrees of the heading asked for at the goal."""
    braking_mps2: float = ranged(0.1, 5.0, default=0.8)
    """Deceleration in m/s² that speeds are planned with; the platform brakes harder."""
    turn_from_deg: float = ranged(10.0, 170.0, default=50.0)
    """Angle in degrees between heading and path above which the robot turns in place."""
    turn_until_deg: float = ranged(1.0, 60.0, default=12.0)
    """Angle in degrees between heading and path at which a turn in place ends."""
    turn_rate_radps: float = ranged(0.1, 2.0, default=0.9)
    """Largest yaw rate in rad/s of a turn in place."""
    back_off_m: float = ranged(0.1, 3.0, default=0.5)
    """Distance in metres that the robot backs off before it tries the path again."""
    reach_m: float = ranged(1.0, 10.0, default=2.0)
    """Distance in metres from the body up to which obstacles are considered."""

    def __post_init__(self) -> None:
        if self.turn_until_deg >= self.turn_from_deg:
            raise BadConfiguration(
                f"turn_until_deg {self.turn_until_deg:g} must be below "
                f"turn_from_deg {self.turn_from_deg:g}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ArcConfig:
    """The motion primitives: arcs of constant curvature."""

    count: int = ranged(3, 401, default=41)
    """Number of arcs; denser among small curvatures."""
    max_curvature_1pm: float = ranged(0.1, 20.0, default=3.0)
    """Largest curvature in 1/m."""
    spacing_m: float = ranged(0.005, 0.2, default=0.04)
    """Distance in metres between poses along an arc."""
    poses: int = ranged(5, 400, default=40)
    """Number of poses along an arc at that spacing."""
    first_m: tuple[float, ...] = ranged(0.001, 0.2, default=(0.01, 0.02, 0.03))
    """Distances in metres of additional poses at the start, where an obstacle may be close."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionConfig:
    """Tolerances and margins of the collision check."""

    tolerance_m: float = ranged(0.0, 0.02, default=0.002)
    """Clearance in metres that may be lost where the body is closer to something than the padding
    asks for."""
    least_padding_m: float = ranged(0.001, 0.05, default=0.005)
    """Smallest padding in metres: between two sampled poses of an arc a corner bulges out by some
    millimetres."""
    kept_besides_m: float = ranged(0.0, 0.2, default=0.02)
    """Distance in metres that is kept from uncertain beware cells beyond what the safety gate asks
    for, and twice as much by the path, since both know them by cells of a grid: what one commands,
    the next lets pass."""
    turn_padding_share: float = ranged(0.0, 1.0, default=0.5)
    """Share of the padding kept when turning in place, where the body hardly moves."""
    front_contact_m: float = ranged(0.0, 0.05, default=0.007)
    """Gap in metres up to which an obstacle counts as touching the front."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnConfig:
    """Turning in place."""

    base_rate_radps: float = ranged(0.01, 1.0, default=0.15)
    """Yaw rate in rad/s at the end of a turn."""
    gain_per_s: float = ranged(0.1, 10.0, default=1.5)
    """Yaw rate in rad/s for each radian that is left to turn."""
    step_deg: float = ranged(0.5, 10.0, default=2.0)
    """Angle in degrees between the headings that are checked for collisions."""
    face_person_deg: float = ranged(5.0, 90.0, default=30.0)
    """Angle in degrees off the heading beyond which a robot that waits for a person turns to keep
    the person in view."""
    in_view_deg: float = ranged(5.0, 180.0, default=45.0)
    """Angle in degrees off the heading up to which the camera has a person in view."""
    spin_check_deg: float = ranged(5.0, 180.0, default=30.0)
    """Angle in degrees ahead that must be free for a robot that spins to look around."""
    look_from_deg: float = ranged(10.0, 180.0, default=35.0)
    """Angle in degrees off the heading beyond which the robot turns to unobserved floor that the
    path leads over; at 180 it never does."""
    look_until_deg: float = ranged(1.0, 90.0, default=25.0)
    """Angle in degrees off the heading at which such a turn ends."""
    goal_drift_factor: float = ranged(1.0, 5.0, default=2.0)
    """Factor on the goal tolerance while the robot turns to its final heading: wheels that skid
    carry it off the spot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReverseConfig:
    """Backing off."""

    speed_mps: float = ranged(0.02, 1.0, default=0.2)
    """Speed in m/s in reverse, where the camera does not see."""
    poses: int = ranged(2, 100, default=13)
    """Number of poses of an arc that are checked; the defaults cover 0.4 m."""
    curvature_weight: float = ranged(0.0, 10.0, default=0.1)
    """Cost in free poses of a curvature of 1/m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathFollowerConfig:
    """Scoring of the motion primitives: metres gained along the path, less weighted penalties."""

    horizon_factor: float = ranged(1.0, 5.0, default=1.5)
    """Length of the path that is scored, as a multiple of the lookahead distance."""
    tangent_m: float = ranged(0.05, 1.0, default=0.3)
    """Length in metres over which the direction of the path is measured."""
    clearance_weight: float = ranged(0.0, 10.0, default=0.6)
    """Penalty for each metre of clearance below `clearance_m`."""
    clearance_m: float = ranged(0.0, 0.5, default=0.25)
    """Clearance in metres below which a pose is penalised."""
    padding_weight: float = ranged(0.0, 20.0, default=2.0)
    """Penalty for each metre of clearance below `padding_factor` paddings."""
    padding_factor: float = ranged(1.0, 10.0, default=2.4)
    """Clearance, in paddings, below which a pose is penalised strongly: odometry and map err by as
    much."""
    heading_weight: float = ranged(0.0, 5.0, default=0.15)
    """Penalty for each radian between a pose and the path."""
    curvature_weight: float = ranged(0.0, 1.0, default=0.02)
    """Penalty for each 1/m of curvature."""
    slowness_weight: float = ranged(0.0, 5.0, default=0.3)
    """Penalty for driving at zero speed instead of full speed among people; linear between."""
    speed_shares: tuple[float, ...] = ranged(0.01, 1.0, default=(1.0, 0.6, 0.35))
    """Shares of the full speed that are tried among people who walk."""
    min_progress_m: float = ranged(0.0, 0.5, default=0.05)
    """Least progress in metres of a primitive worth driving."""
    min_progress_share: float = ranged(0.0, 1.0, default=0.5)
    """Share of the distance to the goal that is progress enough."""
    stop_margin_m: float = ranged(0.0, 0.2, default=0.04)
    """Distance in metres kept to the end of the free stretch."""
    min_free_m: float = ranged(0.001, 0.2, default=0.02)
    """Free stretch in metres that speeds are planned with at the least."""
    goal_braking_share: float = ranged(0.05, 1.0, default=0.5)
    """Share of the planned deceleration used on approaching the goal."""
    goal_speed_mps: float = ranged(0.0, 0.2, default=0.02)
    """Speed in m/s that is left at the goal."""
    contact_speed_share: float = ranged(0.05, 1.0, default=0.3)
    """Share of the full speed allowed with no clearance."""
    speed_share_per_m: float = ranged(0.0, 20.0, default=2.0)
    """Share of the full speed allowed for each further metre of clearance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StateLatticeConfig:
    """The search over (x, y, heading) for a manoeuvre."""

    half_side_m: float = ranged(0.5, 10.0, default=2.2)
    """Half the side in metres of the square about the robot that is searched."""
    cell_m: float = ranged(0.02, 0.5, default=0.1)
    """Side in metres of a cell; poses in one cell are one state."""
    headings: int = ranged(8, 360, default=36)
    """Number of headings that are told apart, and of turns in place to a full circle."""
    step_m: float = ranged(0.03, 1.0, default=0.15)
    """Length in metres of a step; longer than a cell's diagonal, so that it leads to another
    cell."""
    max_states: int = ranged(100, 10_000_000, default=60_000)
    """Number of states after which the search ends."""
    clearance_m: float = ranged(0.01, 1.0, default=0.15)
    """Clearance in metres below which a step costs more."""
    switch_cost: float = ranged(0.0, 10.0, default=0.15)
    """Cost in metres of changing between forward, reverse and turning in place."""
    reverse_cost: float = ranged(1.0, 20.0, default=2.5)
    """Cost of a metre in reverse, in metres forward."""
    turn_cost: float = ranged(0.0, 10.0, default=0.6)
    """Cost in metres of turning in place by a radian."""
    clearance_cost: float = ranged(0.0, 20.0, default=1.5)
    """Additional cost of a metre without any clearance."""
    min_length_m: float = ranged(0.0, 1.0, default=0.05)
    """Length in metres that a step counts with at the least when clearance is priced."""
    sweep_m: float = ranged(0.0, 1.0, default=0.12)
    """Clearance in metres at the end of a turning step below which its intermediate poses are
    checked too: a corner bulges out by less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ManoeuvreConfig:
    """Manoeuvres: turning, reversing and driving forward by turns."""

    extra_clearance_m: float = ranged(0.0, 0.1, default=0.01)
    """Clearance in metres beyond the padding that a manoeuvre is searched with."""
    unseen_tolerance_m: float = ranged(0.0, 0.05, default=0.002)
    """Clearance in metres beyond the required one that is kept to unobserved cells."""
    advance_m: float = ranged(0.1, 10.0, default=1.5)
    """Distance in metres along the path that a manoeuvre leads, where it can."""
    min_advance_m: float = ranged(0.0, 5.0, default=0.3)
    """Least progress in metres along the path."""
    lateral_m: float = ranged(0.0, 2.0, default=0.3)
    """Largest distance in metres of its end from the path."""
    tangent_m: float = ranged(0.05, 1.0, default=0.3)
    """Length in metres over which the direction of the path is measured."""
    shortfall_cost: float = ranged(0.0, 100.0, default=5.0)
    """Cost in metres of driving of each metre of the path that is not gained."""
    view_from_m: float = ranged(0.1, 10.0, default=1.2)
    """Least distance in metres from the robot's centre at which the camera sees the ground."""
    view_to_m: float = ranged(0.2, 20.0, default=2.5)
    """Largest distance in metres from a viewpoint to the unobserved cell."""
    view_deg: float = ranged(1.0, 90.0, default=25.0)
    """Angle in degrees off the heading up to which the camera surely sees a cell."""
    forward_mps: float = ranged(0.02, 2.0, default=0.4)
    """Speed in m/s forward."""
    reverse_mps: float = ranged(0.02, 1.0, default=0.2)
    """Speed in m/s in reverse, where the camera does not see."""
    turn_radps: float = ranged(0.05, 3.0, default=0.6)
    """Largest yaw rate in rad/s."""
    turn_base_radps: float = ranged(0.01, 1.0, default=0.1)
    """Yaw rate in rad/s at the end of a turn in place."""
    turn_gain_per_s: float = ranged(0.1, 10.0, default=1.5)
    """Yaw rate in rad/s for each radian that is left to turn."""
    braking_share: float = ranged(0.05, 1.0, default=0.5)
    """Share of the planned deceleration used towards the end of a leg."""
    creep_mps: float = ranged(0.0, 0.2, default=0.03)
    """Speed in m/s at the end of a leg."""
    max_error_m: float = ranged(0.01, 0.5, default=0.12)
    """Distance in metres from the manoeuvre beyond which it is abandoned."""
    substeps: int = ranged(1, 50, default=3)
    """Number of poses that a step of the search is divided into for steering."""
    lookahead_m: float = ranged(0.05, 2.0, default=0.35)
    """Distance in metres along a leg to the point the robot aims at."""
    max_curvature_1pm: float = ranged(0.1, 20.0, default=3.0)
    """Largest curvature in 1/m that is steered."""
    reached_deg: float = ranged(0.1, 20.0, default=2.0)
    """Tolerance in degrees of a pose reached by turning."""
    reached_m: float = ranged(0.001, 0.1, default=0.01)
    """Tolerance in metres of a pose reached by driving."""
    path_distance_m: float = ranged(0.05, 5.0, default=0.5)
    """Distance in metres from the path to the manoeuvre's target beyond which it belongs to another
    path."""
    clearance_share: float = ranged(0.0, 1.0, default=0.5)
    """Share of its clearance that must be left along a manoeuvre for it to go on."""
    stop_clearance_share: float = ranged(0.0, 1.0, default=0.3)
    """Share of its clearance that must be left until the robot has stopped."""
    speed_shares: tuple[float, ...] = ranged(0.01, 1.0, default=(1.0, 0.5, 0.25))
    """Shares of the steered speed that are tried until the stopping trajectory is free."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicWindowConfig:
    """Rollouts among people and vehicles that do not give way."""

    horizon_s: float = ranged(0.2, 10.0, default=2.0)
    """Duration in seconds of a rollout."""
    step_s: float = ranged(0.01, 1.0, default=0.1)
    """Time step in seconds of a rollout."""
    first_s: float = ranged(0.05, 5.0, default=0.6)
    """Duration in seconds of the first velocity of a pair."""
    speed_shares: tuple[float, ...] = ranged(-1.0, 1.0, default=(-0.5, 0.0, 0.25, 0.5, 0.75, 1.0))
    """Speeds that are tried, as shares of the platform's; negative in reverse."""
    turn_shares: tuple[float, ...] = ranged(
        -1.0, 1.0, default=(-1.0, -0.6, -0.3, -0.12, 0.0, 0.12, 0.3, 0.6, 1.0)
    )
    """Yaw rates that are tried, as shares of the rate of a turn in place."""
    collision_cost: float = ranged(0.0, 1000.0, default=50.0)
    """Cost in metres of a collision."""
    early_cost_per_s: float = ranged(0.0, 1000.0, default=100.0)
    """Additional cost in metres of a collision for each second that it is earlier."""
    near_m: float = ranged(0.01, 3.0, default=0.3)
    """Gap in metres beyond the personal distance below which passing costs something."""
    near_cost: float = ranged(0.0, 1000.0, default=10.0)
    """Cost in metres of a second without any gap; less the later it is."""
    near_delay_s: float = ranged(0.01, 10.0, default=0.5)
    """Time in seconds that is added to the moment of passing before the cost is divided by it."""
    change_cost: float = ranged(0.0, 10.0, default=0.05)
    """Cost in metres of a change of velocity by 1 m/s at the body's outermost point."""
    batch: int = ranged(1, 1000, default=32)
    """Number of rollouts that are checked for obstacles at once."""

    def __post_init__(self) -> None:
        if self.step_s > self.horizon_s:
            raise BadConfiguration(
                f"step_s {self.step_s:g} must be at most horizon_s {self.horizon_s:g}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class SocialConfig:
    """Tolerances of the rules beside people; the rules themselves are in `PeopleConfig`."""

    stopped_gap_m: float = ranged(0.0, 1.0, default=0.05)
    """Gap in metres left between the robot that has stopped and a person who turned towards it."""
    min_walking_mps: float = ranged(0.1, 2.0, default=0.5)
    """Speed in m/s that a person who walks is assumed to reach at the least."""
    waiting_margin_m: float = ranged(0.0, 1.0, default=0.2)
    """Distance in metres added to the personal distance where the robot waits, since people do not
    walk quite straight."""
    min_speed_mps: float = ranged(0.0, 0.5, default=0.05)
    """Speed limit in m/s below which the robot stands."""
    sample_s: float = ranged(0.02, 2.0, default=0.25)
    """Largest time in seconds between the moments of the headway that are checked."""
    away_cosine: float = ranged(0.0, 1.0, default=0.5)
    """Cosine of the angle between a person's course and the line from the robot to them above which
    they walk away from it."""
    in_view_s: float = ranged(0.0, 2.0, default=0.3)
    """Time in seconds since the last image of a person up to which they count as in view."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimitConfig:
    """Speed limits of zones."""

    latency_s: float = ranged(0.0, 2.0, default=0.25)
    """Time in seconds from a camera image to the wheels' response to it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GrowthExitConfig:
    """Tuning of driving out of the growth of a zone (TOML table `control.growth_exit`)."""

    speed_mps: float = ranged(0.05, 1.0, default=0.25)
    """Speed in metres per second."""
    yaw_rate_radps: float = ranged(0.05, 2.0, default=0.5)
    """Largest yaw rate in radians per second."""
    yaw_rates: int = ranged(3, 51, default=11)
    """Number of yaw rates that are tried; an odd one has straight motions among them."""
    horizon_s: float = ranged(0.5, 5.0, default=1.5)
    """Time in seconds for which a motion is predicted."""
    poses: int = ranged(2, 50, default=10)
    """Number of poses at which it is checked."""
    goal_weight: float = ranged(0.0, 1.0, default=0.1)
    """Worth of a metre towards the goal in metres away from the zone."""
    keep_on_m: float = ranged(0.0, 1.0, default=0.1)
    """Worth in metres of going on forward or backward as before: between two walls the robot would
    turn back again and again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlConfig:
    """Tuning of the control stage."""

    arcs: ArcConfig = field(default_factory=ArcConfig)
    """Motion primitives."""
    collision: CollisionConfig = field(default_factory=CollisionConfig)
    """Collision check."""
    turn: TurnConfig = field(default_factory=TurnConfig)
    """Turning in place."""
    reverse: ReverseConfig = field(default_factory=ReverseConfig)
    """Backing off."""
    path_follower: PathFollowerConfig = field(default_factory=PathFollowerConfig)
    """Scoring of the motion primitives."""
    lattice: StateLatticeConfig = field(default_factory=StateLatticeConfig)
    """Search for manoeuvres."""
    manoeuvre: ManoeuvreConfig = field(default_factory=ManoeuvreConfig)
    """Ends and steering of manoeuvres."""
    dynamic_window: DynamicWindowConfig = field(default_factory=DynamicWindowConfig)
    """Rollouts among people who do not give way."""
    social: SocialConfig = field(default_factory=SocialConfig)
    """Tolerances beside people."""
    growth_exit: GrowthExitConfig = field(default_factory=GrowthExitConfig)
    """Driving out of the growth of a zone."""
    speed_limits: SpeedLimitConfig = field(default_factory=SpeedLimitConfig)
    """Speed limits of zones."""


CONTROL_CONFIG = ControlConfig()
"""The defaults."""
