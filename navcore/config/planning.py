"""Configuration of the planning stage: the smoothed path, viewpoints, escape from zones."""

from __future__ import annotations

from dataclasses import dataclass, field

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticBandConfig:
    """The elastic band that moves the path away from obstacles."""

    stretch_m: float = ranged(0.5, 100.0, default=8.0)
    """Length in metres of the path that is relaxed; the local planner sees no further."""
    extra_clearance_m: float = ranged(0.0, 2.0, default=0.1)
    """Clearance in metres beyond the circle in which the robot turns, kept where there is room for
    it."""
    iterations: int = ranged(1, 1000, default=60)
    """Number of times that each point is moved."""
    repulsion: float = ranged(0.0, 1.0, default=0.25)
    """Share of the missing clearance that a point moves in one iteration."""
    contraction: float = ranged(0.0, 1.0, default=0.5)
    """Share of the distance to the middle between its neighbours that a point moves in one
    iteration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GapViewpointConfig:
    """Viewpoints before blocked gaps and goals."""

    goal_neighbour_m: float = ranged(0.1, 20.0, default=1.5)
    """Search radius in metres for a free cell next to a blocked goal."""
    goal_believed_m: float = ranged(0.1, 50.0, default=3.0)
    """Distance in metres to the goal within which a blocked goal is believed at once."""
    gap_m: float = ranged(0.5, 10.0, default=2.0)
    """Radius in metres about the gap that the robot drives to; as long as its body fits through
    there, it drives to no other gap."""
    gap_reached_m: float = ranged(0.05, 2.0, default=0.3)
    """Distance in metres to the viewpoint within which the gap counts as measured, and the most
    promising gap is chosen again."""
    detour_m: float = ranged(0.5, 500.0, default=5.0)
    """Length in metres by which a path has to be longer than before, or than the straight line, for
    the robot to look for a shorter way that only safety margins or people close, and by which that
    one has to be shorter at least."""
    gap_price: float = ranged(1.0, 20.0, default=4.0)
    """Cost of a metre of that way where it is closed, in metres of free floor."""
    gap_search_cells: int = ranged(1_000, 100_000_000, default=300_000)
    """Number of cells after which its search is given up: some 0.05 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EscapeConfig:
    """The search for the shortest path out of a forbidden area."""

    first_range_m: float = ranged(0.5, 100.0, default=4.0)
    """Distance in metres about the robot that is searched first; doubled until an exit is found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstraintRemovalConfig:
    """The search for the smallest set of rules that block the path."""

    max_states: int = ranged(100, 100_000_000, default=100_000)
    """Number of pairs (region, rules removed) after which the search is given up: about a
    second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanningConfig:
    """Tuning of the planning stage."""

    unknown_price: float = ranged(1.0, 20.0, default=1.0)
    """Cost of a metre of path over floor that was not seen yet, in metres of seen floor. 1 is the
    paper's rule, unknown is free, and plans by jump-point search; above 1 an exact weighted A*
    plans, which takes longer on large maps; where it takes too long (`plan_budget`), 1 counts."""
    goal_tolerance_m: float = ranged(0.0, 0.3, default=0.15)
    """Distance in metres from a goal, at most half of the robot's width, within which the path may
    end where the goal itself is too close to something. The robot has arrived there."""
    elastic_band: ElasticBandConfig = field(default_factory=ElasticBandConfig)
    """Smoothing of the path."""
    viewpoint: GapViewpointConfig = field(default_factory=GapViewpointConfig)
    """Viewpoints before blocked gaps and goals."""
    escape: EscapeConfig = field(default_factory=EscapeConfig)
    """Search for a path out of a forbidden area."""
    constraint_removal: ConstraintRemovalConfig = field(default_factory=ConstraintRemovalConfig)
    """Search for the rules that block the path."""


PLANNING_CONFIG = PlanningConfig()
"""The defaults."""
