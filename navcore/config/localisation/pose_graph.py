"""Configuration of the pose graph and of loop closure."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseGraphConfig:
    """Optimisation of the pose graph."""

    inlier_chi2: float = ranged(1.0, 100.0, default=16.3)
    """Squared Mahalanobis distance beyond which a loop or an absolute position is an outlier; 16.3
    is the 99.9 % quantile of χ² with three degrees of freedom."""
    gnc_factor: float = ranged(1.05, 10.0, default=1.4)
    """Factor by which graduated non-convexity tightens its cost from step to step; 1.4 in Yang et
    al. 2020."""
    gnc_steps: int = ranged(1, 500, default=100)
    """Largest number of those steps."""
    max_steps: int = ranged(1, 200, default=40)
    """Largest number of Levenberg–Marquardt steps of the last optimisation."""
    converged_m: float = ranged(1e-9, 0.01, default=1e-5)
    """Largest change of a pose in metres and radians at which the optimisation ends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopClosureConfig:
    """Which keyframes are matched with earlier ones, and which matches count as loops."""

    new_keyframes: int = ranged(1, 1_000, default=10)
    """Number of new keyframes after which loops are looked for."""
    least_driven_m: float = ranged(1.0, 1_000.0, default=10.0)
    """Distance in metres driven between two keyframes below which they are no loop."""
    ahead_m: float = ranged(0.0, 5.0, default=2.0)
    """Distance in metres before the robot at which what it sees is compared with what earlier
    keyframes saw."""
    overlap_m: float = ranged(0.5, 10.0, default=2.5)
    """Distance in metres between what two keyframes see, beyond the uncertainty, above which they
    are not matched."""
    sigmas: float = ranged(1.0, 10.0, default=3.0)
    """Standard deviations of odometry within which a loop is looked for and must lie."""
    most_reach_m: float = ranged(0.5, 20.0, default=4.0)
    """Largest half edge in metres of the search window; keyframes less certain are not matched."""
    most_reach_deg: float = ranged(5.0, 180.0, default=45.0)
    """Largest half range of headings of the search in degrees."""
    submap_m: float = ranged(0.5, 20.0, default=3.0)
    """Distance in metres driven before and after a keyframe whose scans are matched with it."""
    refined_m: float = ranged(0.0, 20.0, default=1.5)
    """Distance in metres driven before and after a keyframe whose scans the scan of a later one is
    matched with at last: over more of it odometry's errors are in the map that it makes."""
    per_keyframe: int = ranged(1, 20, default=2)
    """Largest number of earlier places that a keyframe is matched with."""
    least_fit_share: float = ranged(0.1, 1.0, default=0.3)
    """Share of the points that must fit: a robot that comes back the other way sees the other sides
    of most things, which speaks neither for a match nor against it."""
    least_points: int = ranged(1, 10_000, default=40)
    """Number of points that must fit."""
    least_closeness: float = ranged(0.1, 1.0, default=0.75)
    """Mean likelihood that the points which fit must reach: how near they are to their surfaces."""
    contradicted_share: float = ranged(0.0, 1.0, default=0.02)
    """Share of the points where was seen that nothing stands that a match must stay below."""
    through_walls_share: float = ranged(0.0, 1.0, default=0.1)
    """Share of the lines of sight through walls that a match must stay below."""
    margin: float = ranged(0.0, 1.0, default=0.1)
    """Evidence by which the best match must exceed every other."""
    most_sigma_m: float = ranged(0.01, 5.0, default=0.15)
    """Largest standard deviation in metres of the position by a match, as along a corridor."""
    agreeing: int = ranged(1, 20, default=3)
    """Least number of loops near each other that must agree."""
    agree_driven_m: float = ranged(0.5, 100.0, default=12.0)
    """Distance in metres driven within which loops must agree."""
    agree_m: float = ranged(0.02, 2.0, default=0.2)
    """Distance in metres within which two loops agree."""
    agree_deg: float = ranged(0.2, 20.0, default=2.5)
    """Angle in degrees within which two loops agree."""


DEFAULT_LOOP_CLOSURE = LoopClosureConfig()
"""The configuration unless another is given."""
DEFAULT_POSE_GRAPH = PoseGraphConfig()
"""The configuration unless another is given."""
