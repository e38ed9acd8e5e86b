"""Shapes of items: each is a few solids about the middle of the item, made from its size and
colour."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from sim.models.solids import Colour, Size, Solid, box, cylinder, lay_down

_PAPER: Colour = (232, 230, 222)
_DARK: Colour = (44, 44, 48)
_SEGMENTS = 28
"""Number of straight pieces of a cable."""
Curve = npt.NDArray[np.float64]
"""(N, 2) points x, y."""


def cable_solids(points: Curve, thickness_m: float, colour: Colour) -> tuple[Solid, ...]:
    """Return a cable along (N, 2) points, a short cylinder for each straight piece."""
    solids = []
    for (x0, y0), (x1, y1) in pairwise(points.tolist()):
        size_m = (thickness_m, thickness_m, math.hypot(x1 - x0, y1 - y0) + 0.5 * thickness_m)
        middle, yaw_rad = (
            ((x0 + x1) / 2, (y0 + y1) / 2, thickness_m / 2),
            math.atan2(y1 - y0, x1 - x0),
        )
        solids.append(
            Solid(
                kind="cylinder",
                size_m=size_m,
                centre_m=middle,
                colour=colour,
                yaw_rad=yaw_rad,
                pitch_rad=math.pi / 2,
            )
        )
    return tuple(solids)


def shade(colour: Colour, by: float) -> Colour:
    """Return the colour scaled by `by`: lighter above 1, darker below."""
    red, green, blue = (min(255, max(0, round(level * by))) for level in colour)
    return red, green, blue


def _plain(size: Size, colour: Colour) -> tuple[Solid, ...]:
    return (box(size, (0.0, 0.0), colour),)


def _mug(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    handle = box(
        (0.03, 0.012, 0.6 * height), (width / 2 + 0.012, 0.0), colour, bottom_m=0.2 * height
    )
    return (cylinder(width, height, (0.0, 0.0), colour), handle)


def _coffee(size: Size, colour: Colour) -> tuple[Solid, ...]:
    return (
        *_mug(size, colour),
        cylinder(0.86 * size[0], 0.002, (0.0, 0.0), (58, 38, 26), bottom_m=size[2]),
    )


def _paper_cup(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a cup that is narrower at its foot, with a sleeve and a lid."""
    width, _, height = size
    return (
        cylinder(0.74 * width, 0.36 * height, (0.0, 0.0), colour),
        cylinder(
            0.86 * width, 0.36 * height, (0.0, 0.0), shade(colour, 0.8), bottom_m=0.36 * height
        ),
        cylinder(0.96 * width, 0.2 * height, (0.0, 0.0), colour, bottom_m=0.72 * height),
        cylinder(width, 0.08 * height, (0.0, 0.0), _PAPER, bottom_m=0.92 * height),
    )


def _lying_cup(size: Size, colour: Colour) -> tuple[Solid, ...]:
    body = cylinder(size[0], size[2], (0.0, 0.0), colour)
    inside = cylinder(0.86 * size[0], 0.002, (0.0, 0.0), shade(colour, 0.35), bottom_m=size[2])
    return lay_down((body, inside), size[2], size[0])


def _closed_book(size: Size, colour: Colour) -> tuple[Solid, ...]:
    length, width, height = size
    cover, pages = 0.17 * height, (length - 0.01, width - 0.02, 0.66 * height)
    return (
        box((length, width, cover), (0.0, 0.0), colour),
        box(pages, (0.003, 0.0), _PAPER, bottom_m=cover),
        box((length, width, cover), (0.0, 0.0), colour, bottom_m=height - cover),
    )


def _titled_book(size: Size, colour: Colour) -> tuple[Solid, ...]:
    length, width, height = size
    light = (235, 225, 190) if sum(colour) < 380 else (40, 36, 60)
    title = box((0.2 * length, 0.7 * width, 0.001), (0.22 * length, 0.0), light, bottom_m=height)
    line = box((0.06 * length, 0.4 * width, 0.001), (-0.25 * length, 0.0), light, bottom_m=height)
    return (*_closed_book(size, colour), title, line)


def _open_book(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return an open book, its back along x and each page `size_m[1]` wide, with lines of text on
    both."""
    length, width, height = size
    cover = box((length, 2 * width, 0.004), (0.0, 0.0), colour)
    solids = [cover]
    for side in (1, -1):
        solids.append(
            box(
                (length - 0.012, width - 0.012, 0.5 * height),
                (0.0, side * width / 2),
                _PAPER,
                bottom_m=0.004,
            )
        )
        lines = np.linspace(-0.38, 0.38, 6) * length
        top = 0.004 + 0.5 * height
        solids += [
            box(
                (0.02 * length, 0.72 * width, 0.0006),
                (x, side * width / 2),
                (150, 148, 146),
                bottom_m=top,
            )
            for x in lines.tolist()
        ]
    return tuple(solids)


def _bottle(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    shoulder = (width, width, 0.2 * height)
    return (
        cylinder(width, 0.58 * height, (0.0, 0.0), colour),
        cylinder(
            1.01 * width, 0.22 * height, (0.0, 0.0), shade(colour, 1.5), bottom_m=0.2 * height
        ),
        Solid(kind="cone", size_m=shoulder, centre_m=(0.0, 0.0, 0.68 * height), colour=colour),
        cylinder(0.4 * width, 0.15 * height, (0.0, 0.0), colour, bottom_m=0.78 * height),
        cylinder(
            0.46 * width, 0.07 * height, (0.0, 0.0), shade(colour, 0.55), bottom_m=0.93 * height
        ),
    )


def _flask(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a straight bottle with a wide screw cap."""
    width, _, height = size
    return (
        cylinder(width, 0.8 * height, (0.0, 0.0), colour),
        cylinder(
            0.86 * width, 0.04 * height, (0.0, 0.0), shade(colour, 0.7), bottom_m=0.8 * height
        ),
        cylinder(0.8 * width, 0.16 * height, (0.0, 0.0), _DARK, bottom_m=0.84 * height),
    )


def _cable(
    curve: Callable[[Curve], tuple[Curve, Curve]],
) -> Callable[[Size, Colour], tuple[Solid, ...]]:
    def solids(size: Size, colour: Colour) -> tuple[Solid, ...]:
        points = np.column_stack(curve(np.linspace(0.0, 1.0, _SEGMENTS + 1)))
        low, high = points.min(axis=0), points.max(axis=0)
        span = np.maximum(high - low, 1e-9)
        return cable_solids(
            ((points - (low + high) / 2) / span) * (size[0], size[1]), size[2], colour
        )

    return solids


def _parcel(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a cardboard parcel with a strip of tape and an address label."""
    length, width, height = size
    tape = shade(colour, 1.22)
    return (
        box(size, (0.0, 0.0), colour),
        box(
            (length + 0.002, 0.16 * width, 0.45 * height),
            (0.0, 0.0),
            tape,
            bottom_m=0.55 * height + 0.001,
        ),
        box(
            (0.3 * length, 0.24 * width, 0.001),
            (0.2 * length, 0.28 * width),
            _PAPER,
            bottom_m=height,
        ),
        box(
            (0.001, 0.4 * width, 0.3 * height),
            (length / 2, -0.25 * width),
            _PAPER,
            bottom_m=0.3 * height,
        ),
    )


def _open_box(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a box of four sides, dark inside, with open flaps."""
    length, width, height = size
    flap = 0.3 * min(length, width)
    flaps = [
        Solid(
            kind="box",
            size_m=(flap, along, 0.005),
            centre_m=(math.cos(yaw) * reach, math.sin(yaw) * reach, height + 0.2 * flap),
            colour=shade(colour, 1.1),
            yaw_rad=yaw,
            pitch_rad=-0.5,
        )
        for yaw, along, reach in (
            (0.0, width, length / 2 + 0.42 * flap),
            (math.pi, width, length / 2 + 0.42 * flap),
            (math.pi / 2, length, width / 2 + 0.42 * flap),
            (-math.pi / 2, length, width / 2 + 0.42 * flap),
        )
    ]
    inside = box(
        (0.94 * length, 0.94 * width, 0.001), (0.0, 0.0), shade(colour, 0.4), bottom_m=height
    )
    return (box(size, (0.0, 0.0), colour), inside, *flaps)


def _keys(columns: Sequence[int]) -> Callable[[Size, Colour], tuple[Solid, ...]]:
    """Return a keyboard shape with five rows of keys in blocks of these column counts; the first
    block has the space bar."""

    def solids(size: Size, colour: Colour) -> tuple[Solid, ...]:
        depth, width, height = size
        body = box((depth, width, 0.7 * height), (0.0, 0.0), colour)
        key_colour = shade(colour, 1.6) if sum(colour) < 330 else shade(colour, 0.72)
        pitch_y, pitch_x = (
            0.97 * width / (sum(columns) + 0.4 * (len(columns) - 1)),
            0.92 * depth / 5,
        )
        keys, left = [], 0.485 * width
        for block, count in enumerate(columns):
            for row in range(5):
                x = (row - 2) * pitch_x
                cells = (
                    [(0, 3), (3, count - 6), (count - 3, 3)]
                    if row == 0 and block == 0
                    else [(i, 1) for i in range(count)]
                )
                for first, many in cells:
                    y = left - (first + many / 2) * pitch_y
                    key = (0.8 * pitch_x, (many - 0.2) * pitch_y, 0.3 * height)
                    keys.append(box(key, (x, y), key_colour, bottom_m=0.7 * height))
            left -= (count + 0.4) * pitch_y
        return (body, *keys)

    return solids


def _disc_mine(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    return (
        cylinder(width, 0.75 * height, (0.0, 0.0), colour),
        cylinder(0.5 * width, 0.2 * height, (0.0, 0.0), shade(colour, 0.7), bottom_m=0.75 * height),
        cylinder(
            0.16 * width, 0.05 * height, (0.0, 0.0), shade(colour, 1.3), bottom_m=0.95 * height
        ),
        box(
            (0.1 * width, 0.08 * width, 0.3 * height),
            (0.5 * width, 0.0),
            shade(colour, 0.6),
            bottom_m=0.2 * height,
        ),
    )


def _stepped_mine(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    return (
        cylinder(width, 0.45 * height, (0.0, 0.0), colour),
        cylinder(
            0.8 * width, 0.25 * height, (0.0, 0.0), shade(colour, 0.85), bottom_m=0.45 * height
        ),
        cylinder(0.62 * width, 0.3 * height, (0.0, 0.0), shade(colour, 1.2), bottom_m=0.7 * height),
    )


def _ribbed_mine(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    ribs = tuple(
        Solid(
            kind="box",
            size_m=(0.42 * width, 0.05 * width, 0.08 * height),
            centre_m=(0.25 * width * math.cos(turn), 0.25 * width * math.sin(turn), 0.84 * height),
            colour=shade(colour, 0.65),
            yaw_rad=turn,
        )
        for turn in (np.arange(8) * math.pi / 4).tolist()
    )
    plate = cylinder(
        0.34 * width, 0.2 * height, (0.0, 0.0), shade(colour, 1.15), bottom_m=0.8 * height
    )
    return (cylinder(width, 0.8 * height, (0.0, 0.0), colour), *ribs, plate)


def _sign(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return two boards that lean on each other, with a dark emblem and lines of text on both."""
    depth, width, height = size
    board, lean = 0.012, math.atan2(depth / 2 - 0.012, height)
    length = (height - 0.01) / math.cos(lean)
    solids = []
    for side in (1, -1):
        for along, high, wide, colour_here, off in (
            (0.0, length, width, colour, 0.0),
            (0.16 * length, 0.26 * length, 0.5 * width, _DARK, 0.5 * board),
            (-0.1 * length, 0.05 * length, 0.8 * width, _DARK, 0.5 * board),
            (-0.2 * length, 0.05 * length, 0.8 * width, (196, 30, 30), 0.5 * board),
        ):
            x = (depth / 2 - 0.012) / 2 - along * math.sin(lean) + off * math.cos(lean)
            z = height / 2 + along * math.cos(lean) + off * math.sin(lean)
            thick = board if off == 0.0 else 0.003
            solids.append(
                Solid(
                    kind="box",
                    size_m=(thick, wide, high),
                    centre_m=(side * x, 0.0, z),
                    colour=colour_here,
                    pitch_rad=-side * lean,
                )
            )
    return tuple(solids)


def _lying(
    upright: Callable[[Size, Colour], tuple[Solid, ...]],
) -> Callable[[Size, Colour], tuple[Solid, ...]]:
    return lambda size, colour: lay_down(upright(size, colour), size[2], size[0])


ITEM_SHAPES: Mapping[str, Mapping[str, Callable[[Size, Colour], tuple[Solid, ...]]]] = {
    "cup": {"mug": _mug, "coffee": _coffee, "paper": _paper_cup, "lying": _lying_cup},
    "book": {"closed": _closed_book, "titled": _titled_book, "open": _open_book},
    "bag": {"plain": _plain},
    "shoe": {"plain": _plain},
    "bottle": {"standing": _bottle, "flask": _flask, "lying": _lying(_bottle)},
    "cable": {
        "wave": _cable(lambda s: (s, np.sin(3.0 * math.pi * s))),
        "arc": _cable(lambda s: (np.cos(1.3 * math.pi * s), np.sin(1.3 * math.pi * s))),
        "loop": _cable(lambda s: (s + 0.3 * np.sin(2 * math.pi * s), -np.cos(2 * math.pi * s))),
        "spiral": _cable(
            lambda s: (
                (0.35 + s) * np.cos(4.5 * math.pi * s),
                (0.35 + s) * np.sin(4.5 * math.pi * s),
            ),
        ),
    },
    "box": {"parcel": _parcel, "open": _open_box},
    "keyboard": {"full": _keys((14, 3, 4)), "compact": _keys((13,))},
    "landmine": {"disc": _disc_mine, "stepped": _stepped_mine, "ribbed": _ribbed_mine},
    "wet-floor sign": {"board": _sign},
}
"""Shape builders by kind and shape; the first shape of each kind is its default."""
