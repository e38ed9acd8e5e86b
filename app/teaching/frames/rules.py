"""Numbers of the capture and annotation of frames."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureRules:
    """What is captured, and how much."""

    step_m: float = ranged(0.0, 10.0, default=0.2)
    """Distance in metres from the pose of a stored frame below which a frame may be its
    near-duplicate."""
    step_rad: float = ranged(0.0, 3.2, default=0.15)
    """Turn in radians from the pose of a stored frame below which a frame may be its
    near-duplicate."""
    alike: float = ranged(0.0, 255.0, default=6.0)
    """Mean difference of the grey values of two thumbnails, out of 255, below which images from
    poses that near show the same."""
    same: float = ranged(0.0, 255.0, default=1.5)
    """The same difference below which two images show the same whatever their poses: of two drives
    the poses may differ, and a recording may repeat itself."""
    max_frames: int = ranged(1, 100_000, default=500)
    """Number of frames from which nothing more is captured."""
    max_bytes: int = ranged(1, 10**12, default=500_000_000)
    """Size of all frames in bytes from which nothing more is captured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionRules:
    """How the region around a clicked pixel grows."""

    depth_step_m: float = ranged(0.001, 1.0, default=0.03)
    """Difference of depth in metres between neighbouring pixels of one object, one metre away; it
    grows with the distance, as the step between the rows of a floor does."""
    max_share: float = ranged(0.0, 1.0, default=0.5)
    """Largest share of the image that a region may take; a larger one is no object."""
