"""Laser scan: distances all round the robot at one height, and the mount of the scanner.

The scanner is for people: it sees who comes from beside or behind, where the camera does not look,
and what is there when the robot turns or reverses. It knows nothing of what lies lower or higher,
so the map and the beware list remain the camera's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.errors import BadFrame
from navcore.geometry.arrays import Floats
from navcore.toml_config import ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannerMount:
    """Laser scanner that sees all round; a robot without this table has none. An empty table is a
    common safety laser scanner."""

    x_m: float = ranged(-5.0, 5.0, default=0.0)
    """Distance in metres ahead of the centre of the footprint."""
    z_m: float = ranged(0.05, 3.0, default=0.45)
    """Height in metres above the floor: above the body, at the legs of people."""
    rays: int = ranged(36, 7200, default=720)
    """Number of rays in a turn."""
    max_range_m: float = ranged(0.5, 100.0, default=8.0)
    """Largest distance in metres that is measured."""
    noise_m: float = ranged(0.0, 0.5, default=0.01)
    """Standard error of a distance in metres."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaserScan:
    """One turn of the scanner, as of the frame that brings it: what ROS calls a `LaserScan`, with
    its ray 0 along the x axis of the base and the others counter-clockwise at equal angles."""

    ranges_m: npt.NDArray[np.float32]
    """(N,) distance in metres along each ray; ∞ where nothing was measured within range (REP
    117)."""
    x_m: float
    """x of the scanner in metres of the base frame; it is in the middle plane."""
    max_range_m: float
    """Largest distance in metres that is measured."""

    @property
    def step_rad(self) -> float:
        """Angle between two rays in radians."""
        return 2 * math.pi / len(self.ranges_m)

    def hits(self) -> Floats:
        """(K, 2) x and y in metres of the base frame of what the rays met."""
        met = np.flatnonzero(np.isfinite(self.ranges_m))
        angles, ranges = met * self.step_rad, self.ranges_m[met].astype(np.float64)
        return np.column_stack([self.x_m + ranges * np.cos(angles), ranges * np.sin(angles)])

    def reaches(self, x_m: float, y_m: float, tolerance_m: float) -> bool:
        """Return whether a position of the base frame is in range and nothing stands before it by
        more than a tolerance."""
        away_m, bearing = math.hypot(x_m - self.x_m, y_m), math.atan2(y_m, x_m - self.x_m)
        ray = round(bearing / self.step_rad) % len(self.ranges_m)
        return away_m <= self.max_range_m and bool(self.ranges_m[ray] >= away_m - tolerance_m)


def check_scan(scan: LaserScan) -> None:
    """Raise `BadFrame` for a scan that must not be used, with the reason."""
    ranges = scan.ranges_m
    if ranges.ndim != 1 or len(ranges) < 36 or ranges.dtype != np.float32:
        raise BadFrame(
            f"the laser scan is {ranges.dtype} {ranges.shape}, expected float32 and at least 36 "
            "rays"
        )
    if not (math.isfinite(scan.x_m) and 0 < scan.max_range_m < math.inf):
        raise BadFrame(
            f"the laser scanner is at x = {scan.x_m:g} m with a range of {scan.max_range_m:g} m, "
            "expected finite numbers and a positive range"
        )
    if not (ranges > 0).all():  # false for NaN too
        raise BadFrame("the laser scan holds distances that are not positive; none is infinite")
