"""Settings of classes by example."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class PrototypeConfig:
    """How clicks become a prototype, and what a frame shows of one."""

    floor_m: float = ranged(0.0, 0.5, default=0.03)
    """Height in metres below which a pixel is floor, which no click takes."""
    max_range_m: float = ranged(0.5, 20.0, default=6.0)
    """Depth in metres beyond which nothing is compared."""
    depth_step_m: float = ranged(0.001, 1.0, default=0.04)
    """Difference of depth in metres between neighbouring pixels of one object."""
    colour_step: float = ranged(0.5, 100.0, default=6.0)
    """Difference of colour (CIE L*a*b*) between neighbouring pixels of one object."""
    max_extent_m: float = ranged(0.1, 5.0, default=1.5)
    """Extent in metres from which what was clicked is furniture or a wall."""
    min_cells: int = ranged(1, 1000, default=6)
    """Number of cells of the network's features that a click has to cover."""
    clear_m: float = ranged(0.0, 2.0, default=0.3)
    """Distance in metres from what was clicked within which nothing counts as background."""
    max_height_m: float = ranged(0.1, 5.0, default=1.0)
    """Height in metres up to which the background looks like an object on the floor; the threshold
    is fitted to that most of all."""
    shrinkage: float = ranged(0.001, 10.0, default=0.1)
    """Variance that is added to that of every channel, as a share of that of the background."""
    hard_share: float = ranged(0.01, 1.0, default=0.1)
    """Share of the background, that with the largest scores, that the weights are fitted to
    again."""
    own_share: float = ranged(0.0, 1.0, default=0.8)
    """Share of the object's own variance in the spread of a channel; the rest is the background's,
    because a few clicks show little of how an object varies."""
    radius_slack: float = ranged(1.0, 10.0, default=1.5)
    """Factor by which a pixel may lie farther from the centre than almost all clicked cells."""
    twin_share: float = ranged(0.0, 0.5, default=0.05)
    """Share of the background up to which what looks like the object is another of its kind."""
    away_share: float = ranged(0.001, 1.0, default=0.05)
    """Share of the background that what was taken away amounts to, so that the threshold keeps it
    out."""
    background_share: float = ranged(0.0, 0.1, default=0.0015)
    """Share of the background that may score above the threshold."""
    min_separation: float = ranged(0.0, 1.0, default=0.5)
    """Share of the clicked cells that has to score above the threshold; else the object looks like
    what is around it."""
    sureness: float = ranged(0.1, 20.0, default=3.0)
    """Log-odds of a pixel that scores as the clicked object typically did; those at the threshold
    are 0."""
    size_slack: float = ranged(1.0, 5.0, default=1.5)
    """Factor by which regions may be larger and lower than what was clicked."""
    min_region_px: int = ranged(1, 1000, default=12)
    """Number of pixels of the camera image that a region needs; of a D455 at 424 × 240, the same
    solid angle in finer images."""
