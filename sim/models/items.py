"""Items on the floor: default size, mass and colour of each kind, and its shapes."""

from __future__ import annotations

from collections.abc import Mapping

from sim.models.item_shapes import ITEM_SHAPES
from sim.models.solids import Colour, Size, Solid

ITEM_SIZES: Mapping[str, Size] = {
    "cup": (0.09, 0.09, 0.10),
    "book": (0.22, 0.30, 0.035),
    "bag": (0.20, 0.35, 0.30),
    "shoe": (0.28, 0.10, 0.10),
    "bottle": (0.075, 0.075, 0.26),
    "cable": (1.0, 0.6, 0.01),
    "box": (0.32, 0.26, 0.20),
    "keyboard": (0.15, 0.44, 0.025),
    "landmine": (0.26, 0.26, 0.09),
    "wet-floor sign": (0.34, 0.30, 0.60),
}
"""Default size of each kind of item, along x, y and z of the upright item."""

ITEM_COLOURS: Mapping[str, Colour] = {
    "cup": (25, 55, 205),
    "book": (25, 150, 45),
    "bag": (96, 90, 84),
    "shoe": (84, 78, 74),
    "bottle": (60, 110, 90),
    "cable": (40, 40, 44),
    "box": (176, 140, 98),
    "keyboard": (62, 64, 68),
    "landmine": (88, 92, 62),
    "wet-floor sign": (236, 196, 24),
}
"""Default colour of each kind."""

ITEM_MASSES_KG: Mapping[str, float] = {
    "cup": 0.3,
    "book": 0.6,
    "bag": 3.0,
    "shoe": 0.4,
    "bottle": 0.5,
    "cable": 0.3,
    "box": 1.5,
    "keyboard": 0.7,
    "landmine": 2.0,
    "wet-floor sign": 1.2,
}
"""Mass of each kind."""


def item_shapes(kind: str) -> tuple[str, ...]:
    """Return the shapes of a kind of item, the default first."""
    return tuple(ITEM_SHAPES[kind])


def item_solids(kind: str, size_m: Size, colour: Colour, shape: str) -> tuple[Solid, ...]:
    """Return the solids of an item of a kind in `ITEM_SIZES`, in one of its `item_shapes`."""
    return ITEM_SHAPES[kind][shape](size_m, colour)


def item_extent(kind: str, size_m: Size, shape: str) -> Size:
    """Return the size of the bounding box of the item as it lies, along x, y and z."""
    length, width, height = size_m
    if shape == "lying":
        return height, width, length
    return (length, 2 * width, height) if kind == "book" and shape == "open" else size_m
