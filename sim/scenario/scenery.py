"""What a scenario file says of many things at once: rooms to furnish and areas to strew; each seed
does it its own way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from navcore.toml_config import ranged

FARTHEST_M = 100.0
"""Worlds are at most twice as large as this."""
RoomKind = Literal["office", "meeting", "lounge", "store", "hall"]
Strewn = Literal["house", "tree", "conifer", "bush", "rock", "landmine"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """A rectangle between walls that is furnished as its kind is; doors and all that the file
    places stay clear."""

    kind: RoomKind
    """What it is used for."""
    corners: tuple[tuple[float, float], tuple[float, float]] = ranged(-FARTHEST_M, FARTHEST_M)
    """Its lowest and its highest x, y, on the middle lines of its walls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter:
    """Many things of one kind, strewn at random with room between them, and between them and all
    that was there before."""

    kind: Strewn
    """What they are."""
    count: int = ranged(1, 5000)
    """How many; fewer where they do not fit."""
    least_m: tuple[float, float, float] = ranged(0.02, 30.0)
    """Depth, width and height of the smallest; of what is round the depth is its diameter."""
    most_m: tuple[float, float, float] = ranged(0.02, 30.0)
    """The same of the largest."""
    gap_m: float = ranged(0.0, 20.0)
    """Room around each."""
    corners: tuple[tuple[float, float], tuple[float, float]] | None = ranged(
        -FARTHEST_M, FARTHEST_M, default=None
    )
    """Lowest and highest x, y of where they may be; anywhere when left out."""
