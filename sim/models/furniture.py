"""Shapes of furniture: each kind is a few solids in its own frame, front towards +x.

Nothing here leaves a space that looks drivable and is not: the space below a desk or a table is
closed by panels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from sim.models.outdoors import OUTDOORS
from sim.models.solids import Colour, Size, Solid, box, cylinder

FURNITURE_SIZES: Mapping[str, Size] = {
    "desk": (0.75, 1.5, 0.74),
    "table": (1.0, 2.0, 0.74),
    "chair": (0.5, 0.5, 0.92),
    "armchair": (0.75, 0.75, 0.85),
    "sofa": (0.85, 1.8, 0.8),
    "shelf": (0.35, 1.2, 1.9),
    "cabinet": (0.45, 0.9, 1.2),
    "plant": (0.4, 0.4, 1.2),
    "bin": (0.3, 0.3, 0.4),
    "box": (0.5, 0.5, 0.5),
    "cylinder": (0.4, 0.4, 0.8),
    "house": (6.0, 8.0, 4.2),
    "tree": (0.4, 0.4, 9.0),
    "conifer": (0.35, 0.35, 11.0),
    "bush": (0.9, 0.9, 0.9),
    "rock": (0.8, 0.7, 0.5),
}
"""Default size of each kind of furniture."""

FURNITURE_COLOURS: Mapping[str, Colour] = {
    "desk": (176, 142, 100),
    "table": (150, 118, 84),
    "chair": (70, 72, 78),
    "armchair": (120, 112, 104),
    "sofa": (98, 96, 100),
    "shelf": (158, 128, 92),
    "cabinet": (150, 152, 156),
    "plant": (92, 104, 80),
    "bin": (84, 86, 90),
    "box": (166, 140, 108),
    "cylinder": (140, 140, 144),
    "house": (184, 172, 150),
    "tree": (98, 82, 66),
    "conifer": (84, 70, 60),
    "bush": (92, 106, 70),
    "rock": (134, 132, 128),
}
"""Default colour of each kind; dull, so that only beware objects are saturated."""

_DARK: Colour = (60, 60, 64)


def furniture_solids(kind: str, size_m: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return the solids of a kind in `FURNITURE_SIZES`."""
    return _FURNITURE[kind](size_m, colour)


def _board(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a table or desk: a top on two closed sides and a closed front."""
    depth, width, height = size
    panel, top = 0.04, 0.04
    side = (depth - 0.06, panel, height - top)
    return (
        box((depth, width, top), (0.0, 0.0), colour, bottom_m=height - top),
        box(side, (0.0, width / 2 - 0.05), colour),
        box(side, (0.0, -width / 2 + 0.05), colour),
        box((panel, width - 0.1, height - top), (depth / 2 - 0.06, 0.0), colour),
    )


def _desk(size: Size, colour: Colour) -> tuple[Solid, ...]:
    depth, width, height = size
    drawers = box((depth - 0.12, 0.42, height - 0.04), (0.0, width / 2 - 0.28), colour)
    screen = box((0.04, 0.55, 0.34), (depth / 4, -0.1), _DARK, bottom_m=height + 0.08)
    foot = box((0.18, 0.2, 0.08), (depth / 4, -0.1), _DARK, bottom_m=height)
    return (*_board(size, colour), drawers, screen, foot)


def _table(size: Size, colour: Colour) -> tuple[Solid, ...]:
    back = box((0.04, size[1] - 0.1, size[2] - 0.04), (-size[0] / 2 + 0.06, 0.0), colour)
    return (*_board(size, colour), back)


def _chair(size: Size, colour: Colour) -> tuple[Solid, ...]:
    depth, width, height = size
    return (
        box((depth * 0.92, width * 0.92, 0.06), (0.0, 0.0), _DARK, bottom_m=0.03),
        cylinder(0.08, 0.34, (0.0, 0.0), _DARK, bottom_m=0.09),
        box((depth, width, 0.08), (0.0, 0.0), colour, bottom_m=0.42),
        box((0.07, width * 0.9, height - 0.55), (-depth / 2 + 0.05, 0.0), colour, bottom_m=0.55),
    )


def _seat(size: Size, colour: Colour) -> tuple[Solid, ...]:
    depth, width, height = size
    arm = (depth, 0.14, 0.58)
    return (
        box((depth, width, 0.42), (0.0, 0.0), colour),
        box((0.2, width, height), (-depth / 2 + 0.1, 0.0), colour),
        box(arm, (0.0, width / 2 - 0.07), colour),
        box(arm, (0.0, -width / 2 + 0.07), colour),
    )


def _shelf(size: Size, colour: Colour) -> tuple[Solid, ...]:
    depth, width, height = size
    boards = [
        box((depth, width, 0.03), (0.0, 0.0), colour, bottom_m=z)
        for z in (0.0, height * 0.35, height * 0.68)
    ]
    sides = [
        box((depth, 0.03, height), (0.0, side * (width / 2 - 0.015)), colour) for side in (1, -1)
    ]
    back = box((0.02, width, height), (-depth / 2 + 0.01, 0.0), colour)
    files = [
        box(
            (depth * 0.75, width * share, height * 0.22),
            (-0.02, (share - 0.9) * width / 2),
            tone,
            bottom_m=z + 0.03,
        )
        for z, share, tone in (
            (0.0, 0.8, (120, 116, 112)),
            (height * 0.35, 0.6, (146, 140, 130)),
            (height * 0.68, 0.7, _DARK),
        )
    ]
    return (*boards, *sides, back, *files)


def _cabinet(size: Size, colour: Colour) -> tuple[Solid, ...]:
    gap = box((0.01, 0.01, size[2] - 0.1), (size[0] / 2 + 0.002, 0.0), _DARK, bottom_m=0.05)
    return (box(size, (0.0, 0.0), colour), gap)


def _plant(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    return (
        cylinder(width * 0.9, 0.36, (0.0, 0.0), (150, 132, 116)),
        cylinder(0.05, height * 0.3, (0.0, 0.0), (104, 88, 70), bottom_m=0.36),
        cylinder(width, height * 0.4, (0.0, 0.0), colour, bottom_m=height * 0.5),
        cylinder(width * 0.6, height * 0.15, (0.0, 0.0), colour, bottom_m=height * 0.9),
    )


def _plain_box(size: Size, colour: Colour) -> tuple[Solid, ...]:
    return (box(size, (0.0, 0.0), colour),)


def _plain_cylinder(size: Size, colour: Colour) -> tuple[Solid, ...]:
    return (cylinder(size[0], size[2], (0.0, 0.0), colour),)


_FURNITURE: Mapping[str, Callable[[Size, Colour], tuple[Solid, ...]]] = {
    "desk": _desk,
    "table": _table,
    "chair": _chair,
    "armchair": _seat,
    "sofa": _seat,
    "shelf": _shelf,
    "cabinet": _cabinet,
    "plant": _plant,
    "bin": _plain_cylinder,
    "box": _plain_box,
    "cylinder": _plain_cylinder,
    **OUTDOORS,
}
