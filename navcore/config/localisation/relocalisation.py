"""Configuration of relocalisation: where in a kept map the robot is."""

from __future__ import annotations

from dataclasses import dataclass, field

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceSearchConfig:
    """Search of a submap in a kept map by branch and bound."""

    cell_m: float = ranged(0.05, 0.5, default=0.1)
    """Edge of the cells of the search in metres; positions are refined afterwards."""
    sigma_m: float = ranged(0.02, 0.5, default=0.1)
    """Standard deviation in metres of the distance between a point and its surface in the
    search."""
    yaw_step_deg: float = ranged(0.5, 10.0, default=2.0)
    """Step of the heading in degrees."""
    levels: int = ranged(2, 7, default=5)
    """Number of times that the edge of a search block is doubled."""
    max_points: int = ranged(20, 2_000, default=120)
    """Points of the submap that are searched with, evenly thinned."""
    least_points: int = ranged(5, 1_000, default=40)
    """Points below which nothing is searched."""
    least_score: float = ranged(0.1, 1.0, default=0.3)
    """Mean likelihood below which a place is no candidate in the search."""
    least_evidence: float = ranged(0.0, 1.0, default=0.45)
    """Evidence below which a place is no candidate in the search."""
    kept_margin: float = ranged(0.0, 1.0, default=0.2)
    """Evidence below that of the best down to which places are candidates."""
    separation_m: float = ranged(0.1, 5.0, default=0.5)
    """Distance in metres below which two candidates of like heading are the same place."""
    separation_deg: float = ranged(1.0, 90.0, default=15.0)
    """Angle in degrees below which two candidates at one position are the same place."""
    max_candidates: int = ranged(2, 200, default=30)
    """Largest number of candidates that are refined."""
    wall_crossings: int = ranged(0, 10_000, default=3)
    """Number of lines of sight of the map's own scans that may cross a wall by chance; what more of
    them cross is seen over or through."""
    seen_lines: int = ranged(1, 10_000, default=3)
    """Number of lines of sight of the map's own scans that must cross a cell of floor to show that
    nothing stands there."""
    clear_m: float = ranged(0.05, 2.0, default=0.25)
    """Distance in metres from every surface of the map within which no floor counts as clear."""
    facing_deg: float = ranged(5.0, 90.0, default=20.0)
    """Largest angle in degrees between the normals of a point and of its surface."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceFitConfig:
    """Refinement of one place, and how well the submap fits there."""

    wide_m: float = ranged(0.05, 2.0, default=0.4)
    """Distance in metres within which a point finds its surface at first."""
    narrow_m: float = ranged(0.02, 1.0, default=0.15)
    """Distance in metres within which a point finds its surface at last; a point that does fits."""
    sigma_m: float = ranged(0.01, 0.5, default=0.05)
    """Standard deviation in metres of the distance of a point that fits."""
    unknown_worth: float = ranged(0.0, 1.0, default=0.4)
    """Evidence of a point where the map knows nothing, of which one on its surface gives 1."""
    contradicted_cost: float = ranged(0.0, 20.0, default=3.0)
    """Evidence that a point takes away where the map has seen that nothing stands."""
    walls_cost: float = ranged(0.0, 20.0, default=1.0)
    """Evidence that a line of sight through a wall takes away."""
    steps: int = ranged(1, 100, default=12)
    """Gauss–Newton steps."""
    ray_start_m: float = ranged(0.0, 2.0, default=0.3)
    """Length in metres of a line of sight beside the camera that is not checked."""
    ray_end_m: float = ranged(0.05, 2.0, default=0.35)
    """Length in metres of a line of sight before the measured surface that is not checked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RelocalisationConfig:
    """When a place is believed."""

    search: PlaceSearchConfig = field(default_factory=PlaceSearchConfig)
    """Search by branch and bound."""
    fit: PlaceFitConfig = field(default_factory=PlaceFitConfig)
    """Refinement and fit of a place."""
    beside_margin: float = ranged(0.0, 1.0, default=0.05)
    """Evidence in which a fit beside the best place may lack for the place to be as uncertain as
    they are apart."""
    margin: float = ranged(0.0, 1.0, default=0.1)
    """Evidence by which the best place must exceed every other."""
    least_fit_share: float = ranged(0.1, 1.0, default=0.4)
    """Share of the points of several scans that must fit; a map has seen one side of most things,
    and what it has not seen speaks neither for a place nor against it."""
    least_closeness: float = ranged(0.1, 1.0, default=0.72)
    """Mean likelihood, of the points that fit, that the scans which confirm a place must reach:
    another room of the same shape fits roughly, this one as closely as the sensor measures."""
    tracked_share: float = ranged(0.1, 1.0, default=0.9)
    """Share of the points of single scans, of those of which the map tells, that must fit, averaged
    over a second."""
    least_evidence: float = ranged(0.0, 1.0, default=0.4)
    """Evidence that a place must reach: below it too much speaks against the place."""
    through_walls_share: float = ranged(0.0, 1.0, default=0.15)
    """Share of the lines of sight through walls of the map that a place must stay below to be
    believed."""
    contradicted_share: float = ranged(0.0, 1.0, default=0.05)
    """Share of the points where the map has seen that nothing stands that a place must stay
    below."""
    confirm_m: float = ranged(0.5, 50.0, default=2.0)
    """Distance in metres from the first of the new scans that the robot has to reach before they
    may confirm a place."""
    confirm_turn_deg: float = ranged(30.0, 720.0, default=120.0)
    """Turn in degrees after which scans may confirm a place instead, if the robot has turned by
    `round_deg` in all, the place exceeds every other by `turn_margin`, and the map contradicts less
    than `turn_contradicted_share`: a room may have its like in another building."""
    round_deg: float = ranged(180.0, 720.0, default=330.0)
    """Turn in degrees with which the robot has seen everything around it."""
    turn_margin: float = ranged(0.0, 1.0, default=0.2)
    """Evidence by which the best place must exceed every other where the robot has only turned."""
    turn_contradicted_share: float = ranged(0.0, 1.0, default=0.01)
    """Share of the points where the map has seen that nothing stands that a place must stay below
    where the robot has only turned."""
    same_m: float = ranged(0.05, 2.0, default=0.3)
    """Distance in metres within which two answers are the same place."""
    same_deg: float = ranged(0.5, 30.0, default=4.0)
    """Angle in degrees within which two answers are the same place."""
    click_m: float = ranged(0.1, 10.0, default=1.0)
    """Distance in metres around the operator's position within which the robot is looked for."""
    click_deg: float = ranged(5.0, 180.0, default=30.0)
    """Angle in degrees around the operator's heading within which it is looked for."""
    click_fit_share: float = ranged(0.1, 1.0, default=0.85)
    """Share of the points of the newest scan that must fit at an operator's place."""
    click_sigma_m: float = ranged(0.01, 1.0, default=0.08)
    """Standard deviation in metres, along its least certain direction, above which an operator's
    place is refused: in a corridor it could be anywhere along it."""
    search_m: float = ranged(0.1, 10.0, default=0.5)
    """Distance in metres to drive between two searches."""
    search_turn_deg: float = ranged(5.0, 360.0, default=40.0)
    """Turn in degrees between two searches."""
    tracked_s: float = ranged(0.0, 60.0, default=3.0)
    """Time in seconds for which single scans must have fitted at the place."""
    recent_m: float = ranged(0.5, 20.0, default=4.0)
    """Distance in metres driven over which scans tell whether the robot is beside the place at
    which it is believed: odometry has hardly drifted over it."""
    moved_fit_share: float = ranged(0.1, 1.0, default=0.7)
    """Share of the points of these scans that must fit beside that place."""
    submap_m: float = ranged(2.0, 100.0, default=12.0)
    """Distance in metres driven after which a scan is forgotten, as it is after three turns:
    odometry has drifted since."""
    scan_spacing_m: float = ranged(0.05, 2.0, default=0.25)
    """Distance in metres after which the next scan is kept."""
    scan_spacing_deg: float = ranged(1.0, 60.0, default=12.0)
    """Turn in degrees after which the next scan is kept."""


DEFAULT_RELOCALISATION = RelocalisationConfig()
"""The configuration unless another is given."""
