"""Configuration of the point map."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from navcore.toml_config import ranged


class ClearingRules(NamedTuple):
    """When a depth image disproves a point of the map, as compiled kernels take it."""

    constant_m: float
    """Tolerance of depth in metres at no distance."""
    per_m2: float
    """Growth of the tolerance in metres per squared metre of distance."""
    nearest_m: float
    """Smallest depth in metres that counts as measured."""
    flat_m: float
    """Height in metres below which beware points are flat and are not cleared."""
    nearer_share: float
    """Share of a point's former distance below which a new measurement replaces the point."""


class FadingRules(NamedTuple):
    """When near looks speak against a certain flat point, as compiled kernels take it."""

    near_m: float
    """Depth in metres beyond which a look says nothing."""
    tolerance_m: float
    """Tolerance of depth in metres at no distance."""
    colour: float
    """Least difference of colour."""
    dark: int
    """Sum of red, green and blue below which a pixel says nothing."""
    most: int
    """Largest number of looks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FadingConfig:
    """How flat points of the colour rules fade when they are no longer there: evidence in log-odds
    in equal steps, one for each near look that shows them, one against for each that shows the
    floor in another colour."""

    first: int = ranged(2, 100, default=5)
    """Number of looks that a point has from its first detection on, at which it counts at once."""
    most: int = ranged(2, 250, default=30)
    """Largest number of looks that speak for a point; as many against it remove it."""
    near_m: float = ranged(0.3, 10.0, default=2.5)
    """Depth in metres beyond which a look says nothing: a marking is seen at a grazing angle
    there."""
    tolerance_m: float = ranged(0.005, 0.5, default=0.02)
    """Difference in metres of measured depth and point, at no distance, beyond which the point is
    covered by something else; it grows with depth as that of clearing."""
    colour: float = ranged(0.01, 1.0, default=0.15)
    """Difference of the shares of red, green and blue from which a pixel shows another colour than
    the point was seen with: less is the same thing in another light."""
    dark: int = ranged(0, 765, default=90)
    """Sum of red, green and blue (0 to 255 each) below which a pixel is too dark to say
    anything."""

    @property
    def rules(self) -> FadingRules:
        """The values that compiled kernels need."""
        return FadingRules(
            near_m=self.near_m,
            tolerance_m=self.tolerance_m,
            colour=self.colour,
            dark=self.dark,
            most=self.most,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfidenceConfig:
    """How images change the confidence of beware points, in log-odds."""

    prior: float = ranged(-10.0, 10.0, default=-1.0)
    """Log-odds of an object at a position that no image has shown before."""
    overlooked: float = ranged(-10.0, 10.0, default=-2.0)
    """Log-odds of an object at a position in which earlier images showed nothing: one detection is
    not enough there."""
    claim_share: float = ranged(0.0, 1.0, default=0.5)
    """Share of the network's log-odds that one image adds; consecutive images err alike."""
    miss: float = ranged(0.0, 10.0, default=0.25)
    """Log-odds that an image without the object subtracts."""
    least: float = ranged(-10.0, 0.0, default=-2.5)
    """Smallest log-odds; a point that reaches them is forgotten."""
    most: float = ranged(0.0, 10.0, default=3.0)
    """Largest log-odds."""
    certain: float = ranged(0.0, 1.0, default=0.95)
    """Largest confidence that the beware list can ask for (the logistic of `most`, rounded
    down)."""
    trusted_m: float = ranged(0.2, 20.0, default=4.0)
    """Depth in metres beyond which images do not count; a network may miss small objects there."""
    border_px: int = ranged(1, 200, default=8)
    """Width in pixels of the image border that does not count, where objects are cut off; of a D455
    at 424 × 240, the same angle in finer images."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RejectionConfig:
    """What counts where an operator said that a detection is not one of its class."""

    margin: float = ranged(0.0, 10.0, default=1.0)
    """Log-odds by which the mean confidence of a region must exceed the highest of the looks that
    were rejected at its position, to count there."""
    around_m: float = ranged(0.0, 2.0, default=0.2)
    """Distance in metres around a rejected detection within which its class is rejected, too: the
    next look at it covers other cells."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RaycastConfig:
    """How densely lines of sight are cast through the map."""

    stride_px: int = ranged(1, 64, default=4)
    """Distance in pixels between the columns, and between the rows, that a ray is cast through; of
    a D455 at 424 × 240, the same angle in finer images."""
    volume_stride: int = ranged(1, 64, default=3)
    """Every how many of those rays marks the explored volume, in columns and in rows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainConfig:
    """How slope, steps and roughness of the ground are measured and kept; what the robot takes of
    them is in its profile."""

    enabled: bool = True
    """Whether slopes and steps beyond the robot's limits are obstacles."""
    cell_m: float = ranged(0.05, 0.5, default=0.1)
    """Side of a cell in metres, to whole cells of the map; slope and roughness are those of 5 × 5
    cells, a step is measured from one neighbour to the opposite one."""
    max_range_m: float = ranged(0.5, 10.0, default=3.0)
    """Depth in metres beyond which heights are too coarse."""
    min_pixels: int = ranged(1, 100, default=3)
    """Number of pixels that make the height of a cell."""
    min_cells: int = ranged(6, 25, default=15)
    """Number of heights among the 5 × 5 cells from which a plane is fitted to them."""
    look_every_m: float = ranged(0.0, 1.0, default=0.15)
    """Distance in metres after which another look counts: images from one position err alike."""
    look_every_deg: float = ranged(0.0, 90.0, default=3.0)
    """Turn in degrees after which another look counts."""
    min_looks: int = ranged(1, 100, default=3)
    """Number of looks from which the ground of a cell is known."""
    smooth_m: float = ranged(0.0, 0.1, default=0.005)
    """Roughness in metres, the standard deviation of heights from the plane, up to which a slope is
    that of the ground and not the edge of an object."""
    uneven_slope: float = ranged(0.0, 1.0, default=0.05)
    """Slope relative to the plane on which the robot stands below which ground is that plane."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingConfig:
    """When a pose gets a new ID, when a point is removed, and how much memory the points may
    take."""

    pose_spacing_m: float = ranged(0.01, 5.0, default=0.25)
    """Distance in metres below which a pose can be a known one; beyond it a new pose ID begins."""
    pose_spacing_deg: float = ranged(1.0, 180.0, default=10.0)
    """Turn in degrees below which a pose can be a known one; beyond it a new pose ID begins."""
    clearing_m: float = ranged(0.02, 1.0, default=0.10)
    """Distance in metres that the camera must see behind a point, at no distance, to remove it."""
    clearing_per_m2: float = ranged(0.0, 0.2, default=0.012)
    """Growth of that distance in metres per squared metre of depth: the error of stereo depth grows
    with the square of the depth."""
    nearest_m: float = ranged(0.0, 2.0, default=0.2)
    """Smallest depth in metres at which points are checked; the camera measures nothing nearer."""
    flat_m: float = ranged(0.0, 0.5, default=0.05)
    """Height in metres below which beware points are floor markings, which depth cannot
    disprove."""
    nearer_share: float = ranged(0.0, 1.0, default=0.7)
    """Share of a point's former distance below which a new measurement replaces the point."""
    floor_m: float = ranged(0.0, 0.5, default=0.05)
    """Height in metres within which a measurement shows the floor and disproves a prior map."""
    body_m: float = ranged(0.0, 1.0, default=0.15)
    """Distance in metres from a person's points within which obstacles belong to the person."""
    people_s: float = ranged(0.1, 600.0, default=5.0)
    """Time in seconds after which a person whom no image has shown, and whom the tracker does not
    follow, is no person on the map any more, but the obstacle that depth shows."""
    bodies_from_m: float = ranged(0.0, 10.0, default=2.0)
    """Distance in metres from the robot from which obstacles of a loaded map go that belong to a
    person of it."""
    budget_mb: float = ranged(0.01, 512.0, default=256.0)
    """Memory of the points in megabytes. Beyond it the oldest are thinned to one a cell and class:
    detail goes, obstacles stay. With more, the map file could become larger than is read."""
    budget_slack: float = ranged(0.0, 1.0, default=0.9)
    """Share of the budget above which new points stay thinned after thinning."""
    confidence: ConfidenceConfig = field(default_factory=ConfidenceConfig)
    """How images change the confidence of beware points."""
    fading: FadingConfig = field(default_factory=FadingConfig)
    """How flat points of the colour rules fade."""
    rejection: RejectionConfig = field(default_factory=RejectionConfig)
    """What counts where an operator has rejected a detection."""
    terrain: TerrainConfig = field(default_factory=TerrainConfig)
    """Slope, steps and roughness of the ground."""
    raycast: RaycastConfig = field(default_factory=RaycastConfig)
    """How densely lines of sight are cast."""

    @property
    def clearing(self) -> ClearingRules:
        """The values that compiled kernels need to find outdated points."""
        return ClearingRules(
            constant_m=self.clearing_m,
            per_m2=self.clearing_per_m2,
            nearest_m=self.nearest_m,
            flat_m=self.flat_m,
            nearer_share=self.nearer_share,
        )
