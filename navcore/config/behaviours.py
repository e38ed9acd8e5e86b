"""Configuration of the behaviours: recovery, waiting for people, lanes, driving by hand."""

from __future__ import annotations

from dataclasses import dataclass, field

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryConfig:
    """Tuning of the recovery of a blocked robot (TOML table `recovery`)."""

    wait_s: float = ranged(0.0, 60.0, default=2.0)
    """Time in seconds for which the robot waits before any other recovery."""
    people_s: float = ranged(0.0, 600.0, default=30.0)
    """Time in seconds for which it waits, in all at a position, for people beside it who may walk
    on, before it recovers from them as from anything else."""
    again_s: float = ranged(1.0, 600.0, default=10.0)
    """Time in seconds after which a robot that has given up because the safety gate kept it from
    every motion, or because all passages are blocked, tries all of them again; twice as long each
    further time that all passages to a goal are blocked."""
    back_m: float = ranged(0.1, 5.0, default=1.0)
    """Distance in metres over which it backs off."""
    left_m: float = ranged(0.5, 20.0, default=2.5)
    """Distance in metres from where it was blocked beyond which the recovery starts afresh."""
    manoeuvre_s: float = ranged(1.0, 120.0, default=20.0)
    """Time in seconds after which a recovery counts as failed."""
    tries: int = ranged(1, 20, default=3)
    """Number of short retreats or manoeuvres at one position after which the robot counts as
    blocked."""
    retry_m: float = ranged(0.05, 5.0, default=0.5)
    """A manoeuvre that starts within this distance in metres of the last one has gained nothing."""
    trail_step_m: float = ranged(0.02, 1.0, default=0.1)
    """Spacing in metres of the remembered driven path."""
    trail_points: int = ranged(2, 1000, default=50)
    """Number of points of the remembered driven path."""
    closed_half_side_m: float = ranged(0.05, 2.0, default=0.2)
    """Half the side in metres of the square that closes a blocked passage."""
    closed_gap_m: float = ranged(0.0, 1.0, default=0.05)
    """Distance in metres kept between that square and the circle the robot turns in."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WaitingConfig:
    """Tuning of what counts as waiting."""

    position_m: float = ranged(0.1, 10.0, default=1.0)
    """A robot that has moved less than this in metres still waits at the same position."""
    max_gap_s: float = ranged(0.05, 5.0, default=0.3)
    """Time in seconds between two images beyond which the time between them does not count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneConfig:
    """Tuning of keep-outs along the lanes of people who walk to and fro."""

    remembered_s: float = ranged(1.0, 600.0, default=20.0)
    """Time in seconds after which a position of a person no longer belongs to a lane."""
    remembered_m: float = ranged(1.0, 50.0, default=8.0)
    """Distance in metres from the robot beyond which it does not either."""
    spacing_m: float = ranged(0.05, 2.0, default=0.2)
    """Spacing in metres of the positions of a lane."""
    max_detour_m: float = ranged(0.0, 100.0, default=4.0)
    """Length in metres by which the route may grow for a lane to be avoided."""
    reopened_s: float = ranged(0.0, 600.0, default=20.0)
    """Time in seconds for which a lane that was opened again stays open."""
    update_s: float = ranged(0.1, 60.0, default=2.0)
    """Period in seconds at which closed lanes follow the people and the robot."""
    gap_m: float = ranged(0.0, 2.0, default=0.15)
    """Distance in metres between a lane and the circle the robot turns in, which it leaves free."""
    person_radius_m: float = ranged(0.05, 1.0, default=0.3)
    """Half the width in metres of a person."""
    simplify_m: float = ranged(0.0, 1.0, default=0.05)
    """Tolerance in metres by which the outline of a lane is simplified."""
    min_area_m2: float = ranged(0.0, 10.0, default=0.05)
    """Area in square metres below which a part of a lane is left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AbsenceConfig:
    """Tuning of how long people who walk to and fro are expected to stay out of sight."""

    place_m: float = ranged(0.1, 50.0, default=3.0)
    """Distance in metres that the robot may have moved from where it has seen them before."""
    in_view_s: float = ranged(0.0, 2.0, default=0.3)
    """Time in seconds since the last image of a person up to which they count as in view."""
    least_s: float = ranged(0.1, 60.0, default=1.5)
    """Time in seconds out of sight below which it is no absence."""
    most_s: float = ranged(1.0, 600.0, default=20.0)
    """Time in seconds above which it is none either: they were elsewhere."""
    remembered: int = ranged(2, 100, default=6)
    """Number of absences that are remembered."""
    share: float = ranged(0.0, 1.0, default=0.8)
    """Share of the last absence on a side, or the shorter of the last two, for which people stay
    away."""
    cross_s: float = ranged(0.5, 60.0, default=4.0)
    """Time in seconds that must be left of it for the robot to set off."""
    longest_share: float = ranged(1.0, 10.0, default=1.25)
    """Share of the longer one after which the robot that waits for their return gives it up."""
    longest_besides_s: float = ranged(0.0, 60.0, default=2.0)
    """Time in seconds that it waits besides."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneRetreatConfig:
    """Tuning of the retreat from the lane of a person who walks to and fro."""

    margin_m: float = ranged(0.0, 2.0, default=0.15)
    """Distance in metres kept from the lane beyond the personal distance."""
    longest_m: float = ranged(0.1, 5.0, default=2.5)
    """Length in metres of the driven path within which it must lead out of the lane."""
    longest_s: float = ranged(1.0, 600.0, default=60.0)
    """Time in seconds after which a retreat counts as failed: people may hold it up for long."""
    blocked_s: float = ranged(0.1, 60.0, default=3.0)
    """The same where the way back is blocked by something else."""
    retry_m: float = ranged(0.05, 5.0, default=0.5)
    """Distance in metres from where a retreat failed within which no other begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TeleopConfig:
    """Tuning of the check of velocities that are given by hand."""

    pose_age_s: float = ranged(0.0, 2.0, default=0.35)
    """Greatest age in seconds of the pose, added to the reaction time."""
    step_s: float = ranged(0.01, 0.5, default=0.05)
    """Time step in seconds of the predicted motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BehavioursConfig:
    """Tuning of the behaviours beside the recovery."""

    waiting: WaitingConfig = field(default_factory=WaitingConfig)
    """What counts as waiting."""
    lanes: LaneConfig = field(default_factory=LaneConfig)
    """Lanes of people who walk to and fro."""
    lane_retreat: LaneRetreatConfig = field(default_factory=LaneRetreatConfig)
    """Retreat from such a lane."""
    absence: AbsenceConfig = field(default_factory=AbsenceConfig)
    """How long such people stay out of sight."""
    teleop: TeleopConfig = field(default_factory=TeleopConfig)
    """Driving by hand."""
