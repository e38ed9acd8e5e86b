"""Shapes of trees, bushes, rocks and houses, each a few solids; crowns hang higher than any robot
is tall.

Their greens and browns are dull, because only beware objects are saturated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from sim.models.solids import Colour, Size, Solid, box, cylinder

CROWN_M = 2.0
"""Lowest height of branches."""
_LEAVES: Colour = (98, 112, 72)
_NEEDLES: Colour = (76, 96, 76)
_ROOF: Colour = (112, 92, 82)
_DARK: Colour = (62, 58, 54)


def _ball(size: Size, at_m: tuple[float, float, float], colour: Colour) -> Solid:
    return Solid(kind="ball", size_m=size, centre_m=at_m, colour=colour, pattern="leaves")


def _tree(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a trunk, thicker at its foot, below a crown of two balls; the girth is that of the
    foot."""
    girth, _, height = size
    stem, spread = max(height - 2.2, CROWN_M + 0.5), max(0.36 * height, 1.6)
    low = max(stem, CROWN_M + 0.35 * spread)
    return (
        replace(cylinder(girth, 0.5, (0.0, 0.0), colour), kind="cone", pattern="bark"),
        _trunk(0.8 * girth, stem, colour),
        _ball((spread, spread, 0.7 * spread), (0.0, 0.0, low), _LEAVES),
        _ball(
            (0.75 * spread, 0.75 * spread, 0.7 * spread),
            (0.2 * spread, 0.1 * spread, low + 0.35 * spread),
            _LEAVES,
        ),
    )


def _conifer(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a straight trunk through three cones."""
    girth, _, height = size
    tier, spread = (height - CROWN_M) / 2.6, max(0.3 * height, 1.6)
    cones = (
        Solid(
            kind="cone",
            size_m=(share * spread, share * spread, tier),
            centre_m=(0.0, 0.0, CROWN_M + (0.5 + 0.8 * i) * tier),
            colour=_NEEDLES,
            pattern="leaves",
        )
        for i, share in enumerate((1.0, 0.75, 0.45))
    )
    return (_trunk(girth, CROWN_M + tier, colour), *cones)


def _trunk(girth_m: float, height_m: float, colour: Colour) -> Solid:
    return replace(cylinder(girth_m, height_m, (0.0, 0.0), colour), pattern="bark")


def _bush(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    return (
        _ball((width, width, 1.3 * height), (0.0, 0.0, 0.35 * height), colour),
        _ball(
            (0.6 * width, 0.6 * width, 0.8 * height),
            (0.16 * width, 0.1 * width, 0.55 * height),
            colour,
        ),
    )


def _rock(size: Size, colour: Colour) -> tuple[Solid, ...]:
    depth, width, height = size
    side = (depth + width) / 2
    lower = Solid(
        kind="cone",
        size_m=(side, side, 0.7 * height),
        centre_m=(0.0, 0.0, 0.35 * height),
        colour=colour,
    )
    upper = Solid(
        kind="ball",
        size_m=(0.7 * side, 0.7 * side, 0.7 * height),
        centre_m=(0.0, 0.0, 0.65 * height),
        colour=colour,
    )
    return (lower, upper)


def _house(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a closed house, its door towards +x, with a roof of two slopes along y."""
    depth, width, height = size
    eaves = 0.6 * height
    body = replace(box((depth, width, eaves), (0.0, 0.0), colour), pattern="brick")
    roofs = (
        Solid(
            kind="box",
            size_m=(0.66 * depth, width + 0.6, 0.12),
            centre_m=(side * 0.29 * depth, 0.0, eaves + 0.2 * height),
            colour=_ROOF,
            pitch_rad=side * 0.5,
            pattern="thatch",
        )
        for side in (1, -1)
    )
    gable = box((0.55 * depth, width - 0.02, 0.22 * height), (0.0, 0.0), colour, bottom_m=eaves)
    door = box((0.04, 1.0, 2.0), (depth / 2, 0.0), _DARK)
    windows = (
        box((0.04, 0.9, 0.8), (depth / 2, side * width / 4), _DARK, bottom_m=1.0)
        for side in (1, -1)
    )
    return (body, gable, *roofs, door, *windows)


OUTDOORS: Mapping[str, Callable[[Size, Colour], tuple[Solid, ...]]] = {
    "house": _house,
    "tree": _tree,
    "conifer": _conifer,
    "bush": _bush,
    "rock": _rock,
}
"""Shape of each outdoor kind of `sim.models.furniture`."""
