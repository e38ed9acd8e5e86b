"""Scenery that each seed generates: rooms to furnish and areas to scatter objects over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from navcore.toml_config import ranged
from sim.models.solids import FARTHEST_M

RoomKind = Literal["office", "meeting", "lounge", "store", "hall"]
ScatterKind = Literal["house", "tree", "conifer", "bush", "rock", "landmine"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """A rectangle between walls that is furnished by its kind; doors and everything in the file
    stay clear."""

    kind: RoomKind
    """Use of the room."""
    corners: tuple[tuple[float, float], tuple[float, float]] = ranged(-FARTHEST_M, FARTHEST_M)
    """Lowest and highest corner x, y, on the middle lines of its walls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter:
    """Many objects of one kind, scattered at random with gaps between them and around all earlier
    objects."""

    kind: ScatterKind
    """Kind of the objects."""
    count: int = ranged(1, 5000)
    """Number of objects; fewer where they do not fit."""
    least_m: tuple[float, float, float] = ranged(0.02, 30.0)
    """Depth, width and height of the smallest object; a round one has its diameter as depth."""
    most_m: tuple[float, float, float] = ranged(0.02, 30.0)
    """Depth, width and height of the largest object; a round one has its diameter as depth."""
    gap_m: float = ranged(0.0, 20.0)
    """Gap around each object."""
    corners: tuple[tuple[float, float], tuple[float, float]] | None = ranged(
        -FARTHEST_M, FARTHEST_M, default=None
    )
    """Lowest and highest corner x, y of their area; the whole world when left out."""
