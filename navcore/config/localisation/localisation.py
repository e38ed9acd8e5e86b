"""Configuration of localisation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from navcore.config.localisation.pose_graph import LoopClosureConfig, PoseGraphConfig
from navcore.config.localisation.relocalisation import RelocalisationConfig
from navcore.config.localisation.scan_odometry import ScanOdometryConfig
from navcore.toml_config import ranged


class ScanRules(NamedTuple):
    """What becomes a scan point, as compiled kernels take it."""

    low_m: float
    """Least height above the ground in metres."""
    high_m: float
    """Largest height in metres on level ground."""
    high_on_slopes_m: float
    """Largest height in metres where the ground rises or falls."""
    min_range_m: float
    """Least depth in metres."""
    max_range_m: float
    """Largest depth in metres."""
    column_step: int
    """Number of neighbouring columns that make one direction of the scan."""
    min_pixels: int
    """Least number of pixels of a surface in one direction."""
    min_height_m: float
    """Least vertical extent of a surface in metres."""
    correlated_px: float
    """Number of neighbouring pixels whose errors count as one."""
    floor_m: float
    """Least standard deviation of a point in metres."""
    line_m: float
    """Reach in metres within which neighbours decide on the normal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanConfig:
    """Which pixels of a depth image become points of the virtual scan."""

    low_m: float = ranged(0.05, 1.0, default=0.15)
    """Least height above the ground in metres; below, the floor and its noise begin."""
    high_m: float = ranged(0.2, 3.0, default=1.6)
    """Largest height in metres on level ground."""
    high_on_slopes_m: float = ranged(0.2, 3.0, default=0.6)
    """Largest height in metres on uneven ground: without roll and pitch, a point that is high is
    displaced sideways."""
    min_range_m: float = ranged(0.1, 5.0, default=0.3)
    """Least depth in metres."""
    max_range_m: float = ranged(1.0, 20.0, default=5.8)
    """Largest depth in metres."""
    column_step: int = ranged(1, 16, default=2)
    """Number of neighbouring columns that make one direction of the scan."""
    min_pixels: int = ranged(1, 200, default=6)
    """Least number of pixels of a surface in one direction."""
    min_height_m: float = ranged(0.0, 1.0, default=0.08)
    """Least vertical extent of a surface in metres; a table top has none."""
    correlated_px: float = ranged(1.0, 1000.0, default=8.0)
    """Number of neighbouring pixels whose errors count as one: those of stereo matching are alike
    within its window."""
    floor_m: float = ranged(0.001, 0.2, default=0.01)
    """Least standard deviation of a point in metres."""
    line_m: float = ranged(0.05, 1.0, default=0.25)
    """Distance in metres within which the neighbours of a point decide on its normal."""
    person_m: float = ranged(0.0, 5.0, default=1.2)
    """Size in metres below which all that is seen may be one person who is not recognised yet: by
    such a scan the robot does not locate itself."""
    person_view_rad: float = ranged(0.1, 3.0, default=0.8)
    """Angle in radians that such a thing fills at most: of a wall before the camera no end is
    seen."""

    @property
    def rules(self) -> ScanRules:
        """The values for compiled kernels."""
        return ScanRules(
            low_m=self.low_m,
            high_m=self.high_m,
            high_on_slopes_m=self.high_on_slopes_m,
            min_range_m=self.min_range_m,
            max_range_m=self.max_range_m,
            column_step=self.column_step,
            min_pixels=self.min_pixels,
            min_height_m=self.min_height_m,
            correlated_px=self.correlated_px,
            floor_m=self.floor_m,
            line_m=self.line_m,
        )


class MatchRules(NamedTuple):
    """How a scan is matched, as compiled kernels take it."""

    search_m: float
    """Distance in metres within which a surface is looked for at first."""
    fine_m: float
    """The same at last."""
    fit_m: float
    """Distance in metres below which a point fits."""
    point_sigma_m: float
    """Standard deviation in metres of surfaces without a line."""
    surface_sigma_m: float
    """Standard deviation in metres of the mean of a surface."""
    min_hits: int
    """Least number of scan points in a surface."""
    iterations: int
    """Number of Gauss–Newton steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchConfig:
    """How a scan is matched with the map."""

    cell_m: float = ranged(0.02, 0.5, default=0.08)
    """Edge of a map cell in metres; each keeps the mean of the surface within it."""
    search_m: float = ranged(0.1, 2.0, default=0.5)
    """Distance in metres within which a surface is looked for at first."""
    fine_m: float = ranged(0.05, 1.0, default=0.15)
    """The same at last."""
    fit_m: float = ranged(0.01, 0.5, default=0.08)
    """Distance in metres from its surface below which a point fits, beside three standard
    deviations of its depth."""
    point_sigma_m: float = ranged(0.005, 0.5, default=0.04)
    """Standard deviation in metres, across all directions, of a surface without a line: a leg, a
    post, a corner."""
    surface_sigma_m: float = ranged(0.001, 0.2, default=0.01)
    """Standard deviation in metres of the mean of a surface."""
    min_hits: int = ranged(1, 100, default=1)
    """Least number of scan points in a surface that is matched."""
    iterations: int = ranged(1, 100, default=12)
    """Largest number of Gauss–Newton steps."""
    min_points: int = ranged(3, 1000, default=15)
    """Least number of points in a scan, and of them that fit, for a match."""
    window_m: float = ranged(0.1, 5.0, default=1.0)
    """Half the edge in metres of the window of the correlative search."""
    window_deg: float = ranged(1.0, 180.0, default=24.0)
    """Half the range of headings of the correlative search in degrees."""

    @property
    def rules(self) -> MatchRules:
        """The values for compiled kernels."""
        return MatchRules(
            search_m=self.search_m,
            fine_m=self.fine_m,
            fit_m=self.fit_m,
            point_sigma_m=self.point_sigma_m,
            surface_sigma_m=self.surface_sigma_m,
            min_hits=self.min_hits,
            iterations=self.iterations,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryConfig:
    """Expected errors of odometry.

    The defaults are those of worn tyres and a cheap gyro. The errors that stay the same are learnt
    within metres where scans measure the motion, so a better base loses little by them, and a worse
    one is not taken for exact.
    """

    length_scale: float = ranged(0.0, 0.2, default=0.02)
    """Standard deviation over runs of the relative error of lengths."""
    length_floor: float = ranged(0.0, 0.1, default=0.004)
    """Standard deviation of the relative error of lengths that scans measure, which is the same for
    all of them: below it no scan of a new map brings the error of odometry."""
    gyro_scale: float = ranged(0.0, 0.2, default=0.01)
    """Standard deviation over runs of the relative error of turns."""
    gyro_bias_degph: float = ranged(0.0, 10_000.0, default=108.0)
    """Standard deviation over runs of the bias of the gyro after calibration, degrees per hour."""
    gyro_bias_drift_degph: float = ranged(0.0, 10_000.0, default=8.0)
    """Standard deviation of the change of that bias within an hour, degrees per hour."""
    gyro_noise_deg: float = ranged(0.0, 5.0, default=0.02)
    """White noise of the gyro, degrees per square root of a second."""
    slip_m: float = ranged(0.0, 1.0, default=0.012)
    """Standard deviation of the distance after one metre by slip, metres."""
    aside_m: float = ranged(0.0, 1.0, default=0.006)
    """Standard deviation of the position across after one metre, metres."""
    turn_slip_m: float = ranged(0.0, 1.0, default=0.013)
    """Standard deviation of the position after a turn of one radian, metres."""
    standing_mps: float = ranged(0.0, 0.1, default=0.005)
    """Speed in m/s below which the robot stands."""
    standing_radps: float = ranged(0.0, 0.1, default=0.004)
    """Yaw rate in rad/s below which the robot stands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingConfig:
    """What a match is worth, when the robot is lost, and how corrections are applied."""

    correlated_points: float = ranged(1.0, 10_000.0, default=12.0)
    """Number of points of a match against the saved map that count as one measurement: neighbours
    and consecutive frames err alike."""
    young_points: float = ranged(0.0, 100.0, default=0.2)
    """Number of measurements that a whole match against the robot's own new map counts as: its
    errors are those of the poses it was made from."""
    floor_m: float = ranged(0.0, 0.2, default=0.012)
    """Standard deviation in metres that no match falls below."""
    floor_deg: float = ranged(0.0, 5.0, default=0.05)
    """The same for the heading in degrees."""
    gate_sigmas: float = ranged(1.0, 10.0, default=3.0)
    """Deviation from odometry, in standard deviations, beyond which a match or a position fix is
    refused."""
    refused_s: float = ranged(0.1, 60.0, default=3.0)
    """Time in seconds for which refused position fixes must agree with each other, while nothing
    confirms the estimate, to be believed."""
    refused_m: float = ranged(0.1, 100.0, default=3.0)
    """Distance in metres, a radian counting as half a metre, over which refused matches with the
    saved map must agree with each other, while nothing confirms the estimate, to be believed."""
    located_share: float = ranged(0.1, 1.0, default=0.6)
    """Share of points that fit from which a match is believed."""
    lost_share: float = ranged(0.0, 1.0, default=0.45)
    """Share of points that fit below which a frame contradicts the map."""
    elsewhere_share: float = ranged(0.0, 1.0, default=0.4)
    """Share of points that fit below which a frame contradicts the map, whatever is near the
    others, if lines of sight cross its surfaces."""
    elsewhere_blocked_share: float = ranged(0.0, 1.0, default=0.1)
    """Share of lines of sight that cross surfaces of the map above which they do."""
    fitting_share: float = ranged(0.0, 1.0, default=0.9)
    """Share of the points near surfaces of the map that fit from which those do not count,"""
    fitting_near: float = ranged(0.0, 1.0, default=0.25)
    """if at least this share of all points is near surfaces."""
    discontinuous_share: float = ranged(0.0, 1.0, default=0.45)
    """Share of points that fit the surfaces of the last metres below which the robot was moved by
    other means than its wheels, unless something that has stepped in hides them."""
    replaced_share: float = ranged(0.0, 1.0, default=0.2)
    """The same, below which nothing that steps in between two frames explains it."""
    judged_points: int = ranged(1, 1000, default=40)
    """Least number of points by which that is judged: few far points scatter too much."""
    step_m: float = ranged(0.01, 5.0, default=0.3)
    """Motion in metres between two frames beyond which those surfaces tell nothing."""
    step_rad: float = ranged(0.01, math.pi, default=0.25)
    """The same for a turn in radians."""
    lost_s: float = ranged(0.1, 60.0, default=2.5)
    """Time in seconds of contradicting frames after which the robot is lost."""
    lost_m: float = ranged(0.1, 50.0, default=1.5)
    """Distance in metres of contradicting frames after which the robot is lost."""
    flow_m: float = ranged(0.001, 1.0, default=0.02)
    """Largest correction of the position in one frame while driving, metres."""
    flow_deg: float = ranged(0.01, 45.0, default=0.3)
    """Largest correction of the heading in one frame while driving, degrees."""
    pending_m: float = ranged(0.01, 10.0, default=0.1)
    """Correction in metres beyond which it waits until the robot stands."""
    pending_deg: float = ranged(0.1, 180.0, default=2.0)
    """The same for the heading in degrees."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StartConfig:
    """When the place at which the robot starts in a saved map is believed."""

    sigma_m: float = ranged(0.01, 5.0, default=0.3)
    """Standard deviation in metres of the place at which the robot was switched on."""
    sigma_deg: float = ranged(0.1, 90.0, default=8.0)
    """The same for its heading in degrees."""
    share: float = ranged(0.1, 1.0, default=0.8)
    """Share of points that must fit."""
    fitting_s: float = ranged(0.0, 60.0, default=1.0)
    """Time in seconds for which they must fit."""
    telling_points: int = ranged(1, 1000, default=100)
    """Number of points in view from which a map that shows nothing there, or that fits better
    elsewhere, speaks against the place."""
    probation_m: float = ranged(0.0, 50.0, default=4.0)
    """Distance in metres over floor where the robot has not been since the first looks have
    confirmed a place, after which this may be confirmed for good by all that was seen; its turn
    counts as 0.5 m for each radian, a full turn at most."""
    trial_m: float = ranged(0.0, 500.0, default=20.0)
    """The same distance after which what was seen stays on the map even if the place is not
    confirmed for good, as where two places are alike all the way; where little of what was seen is
    on the map it counts only if the operator has put the robot there."""
    unfit_m: float = ranged(0.1, 500.0, default=6.0)
    """Distance in metres over which too little of what was seen fits there, and other places fit
    as well, from which the place is given up."""
    doubts: int = ranged(1, 100, default=2)
    """Number of searches in succession that must speak against the place."""
    beside_m: float = ranged(0.0, 20.0, default=2.0)
    """Distance in metres from the place within which another one takes over if all these searches
    find that one and no more."""
    beside_deg: float = ranged(0.0, 180.0, default=30.0)
    """The same for the heading in degrees."""
    decide_s: float = ranged(0.1, 60.0, default=3.0)
    """Time in seconds after which a place that was not confirmed is looked for in the whole map,
    unless too little is in view to tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalisationConfig:
    """Localisation by odometry, scans and absolute positions."""

    scan: ScanConfig = field(default_factory=ScanConfig)
    """Virtual scan."""
    match: MatchConfig = field(default_factory=MatchConfig)
    """Matching of scans."""
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    """Errors of odometry."""
    scan_odometry: ScanOdometryConfig = field(default_factory=ScanOdometryConfig)
    """Motion between scans."""
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    """Fusion."""
    start: StartConfig = field(default_factory=StartConfig)
    """Confirmation of the place at which the robot starts in a saved map."""
    loops: LoopClosureConfig = field(default_factory=LoopClosureConfig)
    """Loop closure."""
    graph: PoseGraphConfig = field(default_factory=PoseGraphConfig)
    """Optimisation of the pose graph."""
    relocalisation: RelocalisationConfig = field(default_factory=RelocalisationConfig)
    """Search of a lost robot's place."""


DEGPH = math.radians(1.0) / 3600
"""One degree per hour in rad/s."""
