"""The small things on the floor: how large, heavy and of what colour each kind usually is, and what
it is made of."""

from __future__ import annotations

from collections.abc import Mapping

from sim.models.item_shapes import FORMS, Size
from sim.models.solids import Colour, Solid

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
"""Every kind of item that may lie on the floor, and its usual size."""

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
"""What an item looks like when nobody says."""

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


def item_shapes(kind: str) -> tuple[str, ...]:
    """The shapes that a kind of item comes in, the usual one first."""
    return tuple(FORMS[kind])


def item_solids(kind: str, size_m: Size, colour: Colour, shape: str) -> tuple[Solid, ...]:
    """The solids of an item of `ITEM_SIZES`, in one of its `item_shapes`."""
    return FORMS[kind][shape](size_m, colour)


def item_extent(kind: str, size_m: Size, shape: str) -> Size:
    """Along x, y and z as it lies there."""
    length, width, height = size_m
    if shape == "lying":
        return height, width, length
    return (length, 2 * width, height) if kind == "book" and shape == "open" else size_m
