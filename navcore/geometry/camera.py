"""Pinhole camera model: intrinsics and projection."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """Pinhole camera, pixels; column j and row i as in the paper's equations 1 to 3."""

    width: int
    """Columns."""
    height: int
    """Rows."""
    fx: float
    """Focal length along the columns, px."""
    fy: float
    """Focal length along the rows, px."""
    cx: float
    """Column of the optical axis, px."""
    cy: float
    """Row of the optical axis, px."""
