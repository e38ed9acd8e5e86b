"""Configuration of the detection of fiducial markers."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged

LARGEST_TAG = 586
"""Largest number in the family 36h11."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TagConfig:
    """When an AprilTag in the image is believed, and how sure its pose is."""

    corner_error_px: float = ranged(0.05, 5.0, default=0.35)
    """Standard error in pixels of a corner of a tag along each axis of the image."""
    max_residual_px: float = ranged(0.1, 20.0, default=1.5)
    """Greatest root mean square distance in pixels between the corners in the image and those of
    an upright tag at the estimated pose; a tag that is not upright is refused by it."""
    min_side_px: float = ranged(8.0, 200.0, default=16.0)
    """Least length in pixels of the shortest side of a tag in the image."""
    position_floor_m: float = ranged(0.0, 1.0, default=0.01)
    """Standard error of the position in metres that no view goes below: mount and intrinsics of the
    camera."""
    yaw_floor_deg: float = ranged(0.0, 10.0, default=0.3)
    """Standard error of the heading in degrees that no view goes below."""
    max_yaw_error_deg: float = ranged(0.1, 90.0, default=10.0)
    """Standard error of the heading in degrees above which a view makes no fix: it does not know
    which way the tag faces."""
    correlation_s: float = ranged(0.0, 60.0, default=2.0)
    """Time in seconds for which the errors of successive fixes by one tag stay alike."""


DEFAULT_TAGS = TagConfig()
"""The default configuration."""
