"""Configuration of the perception: labels, ground, people, and which measurements count."""

from __future__ import annotations

from dataclasses import dataclass, field

from navcore.config.perception.prototype import PrototypeConfig
from navcore.errors import BadConfiguration
from navcore.toml_config import ranged

PERSON_GRID_CELLS = 128
"""Number of cells along each side of the grid of the person detector, with the camera in its
middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservationConfig:
    """Which measurements are put on the map."""

    obstacle_height_m: float = ranged(0.02, 1.0, default=0.10)
    """Height above the ground in metres from which a measurement is an obstacle (the paper's
    10 cm)."""
    ceiling_m: float = ranged(0.2, 2.8, default=1.0)
    """Height above the ground in metres from which a measurement is above the robot and not put on
    the map. It follows the height of the robot, as the safety gate does, which no file changes: a
    load that is higher needs a profile of its own. From near, the camera would see no higher, and
    what noise has put there from afar would stay."""
    drop_m: float = ranged(0.05, 2.0, default=0.15)
    """Depth below the ground in metres from which the floor is an obstacle: a stair down, a kerb, a
    pit."""
    max_slope: float = ranged(0.0, 0.5, default=0.2)
    """Rise or fall per metre up to which a surface is ground; with 0 only the plane on which the
    robot stands is."""
    max_range_m: float = ranged(0.5, 20.0, default=5.0)
    """Depth in metres beyond which a measurement is too coarse for the map."""
    min_support: int = ranged(1, 100, default=2)
    """Number of pixels that must agree on a voxel before it counts."""

    def __post_init__(self) -> None:
        if self.ceiling_m <= self.obstacle_height_m:
            raise BadConfiguration(
                f"ceiling_m {self.ceiling_m:g} must be above obstacle_height_m "
                f"{self.obstacle_height_m:g}, or nothing would ever be an obstacle"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundConfig:
    """How the height of the ground is estimated from one depth image."""

    cell_m: float = ranged(0.05, 1.0, default=0.2)
    """Side of a cell of the height map in metres."""
    cells_ahead: int = ranged(2, 200, default=30)
    """Number of cells of the height map ahead of the middle of the robot."""
    cells_aside: int = ranged(1, 200, default=25)
    """Number of cells of the height map to either side of the robot."""
    sampled_rows: int = ranged(10, 2000, default=240)
    """Approximate number of image rows that are evaluated; far away a cell has few rows."""
    sampled_columns: int = ranged(10, 2000, default=106)
    """Approximate number of image columns that are evaluated; a cell has enough of them."""
    band_m: float = ranged(0.0, 0.5, default=0.04)
    """Height in metres above the lowest point of a cell up to which points belong to its ground."""
    min_pixels: int = ranged(1, 100, default=2)
    """Number of pixels that make a measurement of a cell."""
    object_height_m: float = ranged(0.01, 1.0, default=0.1)
    """Range of heights in metres within a cell from which it holds an object, whose foot need not
    be the ground."""
    max_step_m: float = ranged(0.0, 0.5, default=0.06)
    """Largest change of height in metres across hidden ground; a larger one is an obstacle."""
    tolerance_m: float = ranged(0.0, 0.2, default=0.02)
    """Error of a height in metres; flat ground comes out as exactly flat."""
    max_range_m: float = ranged(0.5, 20.0, default=6.0)
    """Depth in metres beyond which a measurement is too coarse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourSegmenterConfig:
    """How colour rules are told from obstacles of the same colour."""

    max_slope: float = ranged(0.0, 0.5, default=0.2)
    """Rise or fall per metre up to which a surface may be ground with a marking on it."""
    obstacle_above_m: float = ranged(0.0, 1.0, default=0.1)
    """Height in metres above the maximum of a rule from which a pixel belongs to an obstacle,
    whatever the depth error."""
    pattern_cell_m: float = ranged(0.01, 0.5, default=0.04)
    """Side in metres of the cells of the floor in which two colours of a pattern are told apart."""
    pattern_range_m: float = ranged(0.5, 20.0, default=4.0)
    """Depth in metres beyond which stripes are too narrow for the camera to tell them apart."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthFilterConfig:
    """When depth refutes a label: flat prints, label bleed, small regions."""

    relief_share: float = ranged(0.0, 1.0, default=0.5)
    """Share of the least height of a class below which a region is a flat print."""
    max_flat_m: float = ranged(0.0, 0.5, default=0.025)
    """Relief in metres from which a region is never a flat print, however tall its class: a sign
    that has fallen over is still a sign."""
    min_standard_errors: float = ranged(0.0, 10.0, default=3.0)
    """Number of standard errors of the height that must fit below the threshold; a region with a
    larger error is too far away to decide on."""
    min_pixels: int = ranged(1, 1000, default=12)
    """Number of measured pixels from which a region, or the floor around it, is decided on."""
    min_measured: float = ranged(0.0, 1.0, default=0.5)
    """Share of measured pixels from which a region is decided on."""
    ring_px: int = ranged(1, 50, default=5)
    """Width in pixels of the ring around a region in which the floor is measured; of a D455 at
    424 × 240, the same angle in finer images."""
    tall_m: float = ranged(0.0, 3.0, default=0.3)
    """Least height of a class in metres from which the floor at the foot of its regions is cut
    off."""
    ground_m: float = ranged(0.0, 0.5, default=0.05)
    """Height in metres below which pixels of such a class are floor."""
    bleed_rad: float = ranged(0.0, 0.2, default=0.018)
    """Angle in radians by which a label may extend beyond the outline of its object; 6 pixels of a
    D455 at 640 × 480."""
    bleed_jump_m: float = ranged(0.0, 2.0, default=0.1)
    """Least difference of depth in metres between an object and the background that its label
    covers."""
    bleed_factor: float = ranged(0.0, 20.0, default=3.0)
    """Multiple of the recession of the floor within `bleed_rad` that this difference must also
    exceed; the tops of objects, nearer to the height of the camera, recede faster than the floor.
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class OverhangConfig:
    """When a low region is the base of a taller object."""

    cell_m: float = ranged(0.01, 0.5, default=0.05)
    """Side in metres of the columns of space in which heights are compared."""
    grid_cells: int = ranged(10, 2000, default=340)
    """Number of columns along each side of the square around the camera."""
    ceiling_m: float = ranged(0.2, 5.0, default=1.5)
    """Height in metres above which a measurement is above the robot and ignored."""
    min_pixels: int = ranged(1, 1000, default=12)
    """Number of measured pixels from which a region is decided on."""
    covered_share: float = ranged(0.0, 1.0, default=0.34)
    """Share of a region under a taller object from which the whole region is its base."""
    max_depth_error_m: float = ranged(0.0, 1.0, default=0.07)
    """Depth error in metres from which above cannot be told from behind."""
    clearly_above_m: float = ranged(0.0, 1.0, default=0.08)
    """Height in metres above the maximum of a class that exceeds the scatter of depth."""
    base_reach_m: float = ranged(0.0, 1.0, default=0.1)
    """Distance in metres to a tall object within which a marking is its base."""
    base_share: float = ranged(0.0, 1.0, default=0.5)
    """Share of a marking within that distance from which the whole marking is the base."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InstancesConfig:
    """Which labelled regions are reported as detections."""

    max_range_m: float = ranged(0.5, 20.0, default=5.0)
    """Depth in metres beyond which a position is too coarse."""
    min_pixels: int = ranged(2, 10_000, default=40)
    """Number of pixels from which a region is a detection, of a D455 at 424 × 240, the same solid
    angle in finer images; half as many must be measured."""
    max_regions: int = ranged(1, 1000, default=24)
    """Largest number of detections in one image; the largest regions are taken."""
    min_cell_pixels: int = ranged(1, 1000, default=3)
    """Number of pixels from which a cell belongs to a detection; of a D455 at 424 × 240, the same
    solid angle in finer images."""
    min_cell_share: float = ranged(0.0, 1.0, default=0.02)
    """Share of the pixels of a detection from which a cell belongs to it; fewer come from its rim,
    where depth mixes with the background."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionGrowingConfig:
    """How the object at a clicked pixel is separated by depth, and outlined on the floor."""

    floor_m: float = ranged(0.0, 0.5, default=0.04)
    """Height in metres below which a pixel is floor."""
    ceiling_m: float = ranged(0.2, 5.0, default=2.0)
    """Height in metres above which a pixel does not count for the outline."""
    depth_step_m: float = ranged(0.001, 1.0, default=0.06)
    """Difference of depth in metres between neighbouring pixels of one object."""
    cell_m: float = ranged(0.005, 0.5, default=0.025)
    """Side in metres of the cells that the outline is traced in."""
    max_range_m: float = ranged(0.5, 50.0, default=8.0)
    """Depth in metres beyond which a measurement is ignored."""
    min_pixels: int = ranged(1, 1000, default=12)
    """Number of measured pixels that an outline needs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourPickingConfig:
    """How a click into the camera image becomes a colour rule."""

    hue_deg: float = ranged(1.0, 90.0, default=16.0)
    """Largest difference of hue in degrees to the clicked pixel within its region."""
    saturation: float = ranged(0.01, 1.0, default=0.3)
    """Largest difference of saturation to the clicked pixel within its region."""
    value: float = ranged(0.01, 1.0, default=0.35)
    """Largest difference of brightness to the clicked pixel within its region."""
    grey_value: float = ranged(0.01, 1.0, default=0.1)
    """Largest difference of brightness to a clicked pixel without a hue within its region: white
    tape and a grey floor differ in nothing else."""
    outside_share: float = ranged(0.0, 0.4, default=0.02)
    """Share of the region's pixels at either end of hue, saturation and brightness that the rule
    leaves out."""
    slack_deg: float = ranged(0.0, 60.0, default=4.0)
    """Degrees of hue by which the rule is wider than its region at either end."""
    slack: float = ranged(0.0, 0.5, default=0.08)
    """Saturation and brightness by which the rule is wider than its region."""
    min_saturation: float = ranged(0.0, 1.0, default=0.18)
    """Saturation below which a clicked pixel is white or grey: it has no hue."""
    min_value: float = ranged(0.0, 1.0, default=0.1)
    """Brightness below which a clicked pixel is black: it has neither hue nor saturation."""
    above_m: float = ranged(0.0, 1.0, default=0.05)
    """Height in metres that the rule allows above the top of its region."""
    max_share: float = ranged(0.05, 1.0, default=0.5)
    """Share of all pixels of the images of the last minutes from which a rule is refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonDetectorConfig:
    """Which clusters of a depth image have the size of a person."""

    cell_m: float = ranged(0.02, 0.5, default=0.1)
    """Side in metres of the cells, which are counted from the origin of the map."""
    max_range_m: float = ranged(0.5, 20.0, default=5.5)
    """Depth in metres beyond which a measurement is too coarse; 64 cells at most, to which the grid
    around the camera reaches."""
    floor_range_m: float = ranged(0.5, 20.0, default=4.5)
    """Depth in metres beyond which the floor is seen at too small an angle."""
    body_low_m: float = ranged(0.0, 1.0, default=0.10)
    """Lowest height above the ground in metres that belongs to a body."""
    body_high_m: float = ranged(0.5, 5.0, default=1.90)
    """Greatest height above the ground in metres that belongs to a body."""
    floor_m: float = ranged(0.0, 0.5, default=0.06)
    """Height above or below the ground in metres within which a measurement shows the floor."""
    min_pixels: int = ranged(1, 100, default=4)
    """Number of pixels above the floor that make a cell occupied; of a D455 at 424 × 240, the same
    solid angle in finer images."""
    fixed_s: float = ranged(0.1, 60.0, default=2.0)
    """Time in seconds after which an occupied cell counts as fixed; no person who walks covers a
    cell for as long."""
    fresh_s: float = ranged(0.0, 60.0, default=4.0)
    """Time in seconds within which a cell must have shown floor before it was occupied to count as
    newly occupied."""
    fill_m: float = ranged(0.0, 5.0, default=0.6)
    """Distance in metres between floor pixels of a column, of every second row, within which the
    floor is continuous."""
    max_width_m: float = ranged(0.2, 5.0, default=1.2)
    """Greatest width in metres of a person, or of another object that moves in a crowd."""
    radius_m: float = ranged(0.05, 1.0, default=0.3)
    """Least radius in metres of the disc that a person covers, feet and arms included."""
    min_height_m: float = ranged(0.1, 2.0, default=0.5)
    """Least height in metres of a person."""
    face_m: float = ranged(0.0, 1.0, default=0.1)
    """Distance in metres from the visible side of a person to the middle of the body."""
    round_face_share: float = ranged(0.0, 1.0, default=0.785)
    """The same distance for a round object, as a share of its radius."""
    edge_cells: float = ranged(0.0, 2.0, default=0.7)
    """Mean width in cells that is lost when an object is put on the grid."""
    floor_share: float = ranged(0.0, 1.0, default=0.85)
    """Share of the cells of a disc that must show floor for the disc to be free; single cells fall
    between the image rows or are hidden by noise."""
    past_share: float = ranged(0.0, 1.0, default=0.9)
    """Share of the positions on a body, in view and with floor within range behind, past which
    depth must be measured for a person not to be there."""
    min_area_share: float = ranged(0.0, 1.0, default=0.04)
    """Least number of pixels of a person as a share of those of 1 m × 1 m at the same distance; a
    person in full view has about ten times as many."""

    def __post_init__(self) -> None:
        if self.radius_m >= self.max_width_m / 2:
            raise BadConfiguration(
                f"radius_m {self.radius_m:g} must be below half of max_width_m "
                f"{self.max_width_m:g}, or no person would be wider than the least disc"
            )
        reach_m = PERSON_GRID_CELLS / 2 * self.cell_m
        if self.max_range_m > reach_m:
            raise BadConfiguration(
                f"max_range_m {self.max_range_m:g} must be at most {reach_m:g}, "
                f"to which a grid of cells of cell_m {self.cell_m:g} reaches; people beyond it "
                "would not be seen"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonTrackConfig:
    """Kalman filter of one followed object, and when it counts as a person who walks or stands."""

    accel_mps2: float = ranged(0.1, 20.0, default=3.0)
    """Standard deviation of a person's acceleration in metres per second squared."""
    walks_mps: float = ranged(0.01, 2.0, default=0.3)
    """Speed in metres per second above which a person walks."""
    stands_mps: float = ranged(0.01, 2.0, default=0.15)
    """Speed in metres per second below which a person stands."""
    moved_m: float = ranged(0.0, 2.0, default=0.25)
    """Least distance in metres from the first position, or from where the person stood, for the
    person to start walking."""
    rest_radius_m: float = ranged(0.0, 2.0, default=0.35)
    """Distance in metres within which a noisy position counts as unchanged."""
    min_new_floor: float = ranged(0.0, 1.0, default=0.5)
    """Share of cells on recently seen floor above which an object has come there by itself."""
    min_course_cosine: float = ranged(-1.0, 1.0, default=0.7)
    """Least cosine of the angle between the velocity and the displacement of an object that starts
    walking."""
    stands_s: float = ranged(0.0, 60.0, default=1.0)
    """Time in seconds below `stands_mps` after which a person stands and is an obstacle."""
    width_gain: float = ranged(0.0, 1.0, default=0.3)
    """Smoothing factor of the radius estimate."""
    speed_gain: float = ranged(0.0, 1.0, default=0.2)
    """Smoothing factor of the walking speed."""
    new_floor_gain: float = ranged(0.0, 1.0, default=0.5)
    """Smoothing factor of the share of cells on recently seen floor."""
    min_labelled: float = ranged(0.0, 1.0, default=0.3)
    """Share of pixels labelled as a person above which an image votes for a person."""
    score_gain: float = ranged(0.0, 1.0, default=0.3)
    """Smoothing factor of these votes; a single image that calls a doorpost a person is not
    enough."""
    person_score: float = ranged(0.0, 1.0, default=0.45)
    """Smoothed vote above which an object is a person."""
    no_person_score: float = ranged(0.0, 1.0, default=0.1)
    """Smoothed vote at or below which a person that has never walked is an object again."""
    slows_mps2: float = ranged(0.0, 1.0, default=0.05)
    """Decay in metres per second squared of the greatest walking speed; one estimate may be far
    off."""
    brisk_share: float = ranged(0.0, 1.0, default=0.5)
    """Share of the walking speed below which a person is about to stop or turn, and the direction
    is not known."""
    max_step_s: float = ranged(0.0, 10.0, default=0.3)
    """Longest time in seconds between two images that counts as time of standing."""
    position_noise_m: float = ranged(0.0, 1.0, default=0.05)
    """Standard deviation in metres of the position of a cluster near the camera: half a cell."""
    position_noise_per_m: float = ranged(0.0, 0.1, default=0.004)
    """Growth of this standard deviation with the squared distance, per metre: the scatter of stereo
    depth."""
    cut_noise_m: float = ranged(0.0, 2.0, default=0.1)
    """Increase of this standard deviation in metres for a cluster that reaches the border of the
    image."""
    spread_mps: float = ranged(0.0, 2.0, default=0.1)
    """Growth in metres per second of the disc of a walking person who is out of sight."""
    max_spread_m: float = ranged(0.0, 2.0, default=0.3)
    """Greatest growth in metres of that disc."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PeopleTrackerConfig:
    """How clusters are assigned to tracks, and when a track is given up."""

    detector: PersonDetectorConfig = field(default_factory=PersonDetectorConfig)
    """Detection of clusters of a person's size."""
    track: PersonTrackConfig = field(default_factory=PersonTrackConfig)
    """Kalman filter of one object."""
    gate_m: float = ranged(0.05, 5.0, default=0.45)
    """Gating distance in metres between prediction and detection."""
    doubtful_s: float = ranged(0.0, 60.0, default=0.5)
    """Time in seconds out of sight after which a walking person is found again only by an object
    that has come where floor was, or that the segmenter labels as a person."""
    unseen_s: float = ranged(0.0, 60.0, default=1.0)
    """Time in seconds after which a person is given up where the camera looks and does not see
    the person: both at the predicted position and where the person was seen last."""
    past_s: float = ranged(0.0, 60.0, default=3.0)
    """Time in seconds after which a person is given up who is too near for the camera, or at the
    border of its view, while depth is measured past both positions."""
    walking_unseen_s: float = ranged(0.0, 60.0, default=8.0)
    """Time in seconds after which a walking person is given up where the camera does not look."""
    standing_unseen_s: float = ranged(0.0, 600.0, default=20.0)
    """Time in seconds after which a standing person is given up where the camera does not look."""
    turning_radps: float = ranged(0.0, 10.0, default=0.3)
    """Yaw rate in radians per second from which, while the robot hardly drives, no person is given
    up for having been out of sight for too long: it may be turning to look for them."""
    turning_mps: float = ranged(0.0, 10.0, default=0.1)
    """Speed in metres per second up to which it hardly drives."""
    object_unseen_s: float = ranged(0.0, 60.0, default=0.25)
    """Time in seconds after which an object that is no person is given up."""
    return_m: float = ranged(0.0, 5.0, default=1.0)
    """Distance in metres from where a person was lost within which a new one is the same."""
    max_gap_s: float = ranged(0.1, 60.0, default=2.0)
    """Time in seconds between two images after which all tracks are given up, as they are when time
    runs backwards."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourEvidenceConfig:
    """What a colour rule says about a class that the network knows."""

    fits: float = ranged(1.0, 1000.0, default=4.0)
    """Factor of the odds of a class at a pixel that fits its colour rule."""
    misses: float = ranged(0.001, 1.0, default=0.2)
    """Factor of the odds of a class at a pixel that the network labels as it and that its colour
    rule does not fit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceptionConfig:
    """Everything that can be set about labels, ground and people."""

    min_person_confidence: float = ranged(0.0, 1.0, default=0.5)
    """Confidence from which a network's person is followed, and from which the colour of the shoes
    is not taken for a marking."""
    ground: GroundConfig = field(default_factory=GroundConfig)
    """Height of the ground."""
    colour: ColourSegmenterConfig = field(default_factory=ColourSegmenterConfig)
    """Colour rules."""
    evidence: ColourEvidenceConfig = field(default_factory=ColourEvidenceConfig)
    """Colour rules of classes that the network knows."""
    depth: DepthFilterConfig = field(default_factory=DepthFilterConfig)
    """Labels that depth refutes."""
    overhang: OverhangConfig = field(default_factory=OverhangConfig)
    """Low regions that are the base of a taller object."""
    people: PeopleTrackerConfig = field(default_factory=PeopleTrackerConfig)
    """Detection and tracking of people."""
    instances: InstancesConfig = field(default_factory=InstancesConfig)
    """Labelled regions that are reported as detections."""
    region_growing: RegionGrowingConfig = field(default_factory=RegionGrowingConfig)
    """Objects that are outlined after a click."""
    colour_picking: ColourPickingConfig = field(default_factory=ColourPickingConfig)
    """Colour rules that are made by a click."""
    prototype: PrototypeConfig = field(default_factory=PrototypeConfig)
    """Classes by example."""


DEFAULT_PERCEPTION = PerceptionConfig()
"""Configuration that a new installation starts with."""
