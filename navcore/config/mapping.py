"""Configuration of the point map."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.toml_config import ranged

BODY_M = 0.15
"""Obstacles as near as this to what was seen of somebody are taken for the rest of him."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingConfig:
    """How poses are told apart, when a point is given up, and how much may be kept."""

    pose_spacing_m: float = ranged(0.01, 5.0, default=0.25)
    """A new pose ID begins after this distance …"""
    pose_spacing_deg: float = ranged(1.0, 180.0, default=10.0)
    """… or after this turn."""
    clearing_m: float = ranged(0.02, 1.0, default=0.10)
    """How far behind a point the camera must see, at no distance, before the point is taken for
    gone …"""
    clearing_per_m2: float = ranged(0.0, 0.2, default=0.012)
    """… and how much more per squared metre of distance, since stereo depth scatters with its
    square."""
    budget_mb: float = ranged(0.01, 16_384.0, default=256.0)
    """Memory of the points. Beyond it the oldest are thinned to one a cell and class: detail goes,
    obstacles stay."""
