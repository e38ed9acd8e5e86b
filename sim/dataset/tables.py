"""Random tables, worktops and chairs on legs, and things that lie on a table and are none of the
beware list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sim.dataset import palette
from sim.dataset.scene import Rng
from sim.models.solids import Colour, Solid, box, cylinder

_DARK: Colour = (30, 30, 32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table in its own frame: the middle of its top is above the origin."""

    solids: tuple[Solid, ...]
    """Solids of the table."""
    height_m: float
    """Height of the top."""
    half_m: tuple[float, float]
    """Half the sides of the part of the top on which things may stand, along x and y."""


def random_table(rng: Rng) -> Table:
    """Return a table on four legs, a round one, or a kitchen unit."""
    return _TABLES[rng.integers(len(_TABLES))](rng)


def random_chair(rng: Rng) -> tuple[Solid, ...]:
    """Return a chair on four legs that faces +x, its back of bars or closed, or a stool."""
    side, seat_m = float(rng.uniform(0.36, 0.5)), float(rng.uniform(0.4, 0.5))
    height_m = float(rng.uniform(0.75, 1.05))
    colour, thick = _wood_or_any(rng), float(rng.uniform(0.025, 0.05))
    half = side / 2
    seat = (side, side, float(rng.uniform(0.02, 0.07)))
    seat_colour = colour if rng.random() < 0.5 else palette.any_colour(rng)
    solids = (
        *_legs((half, half), seat_m, thick, colour),
        box(seat, (0.0, 0.0), seat_colour, bottom_m=seat_m),
    )
    if rng.random() < 0.2:
        return solids
    back_x, back_m = -half + thick, height_m - seat_m
    posts = [
        cylinder(thick, back_m, (back_x, end * (half - thick)), colour, bottom_m=seat_m)
        for end in (1, -1)
    ]
    count = int(rng.integers(1, 5))
    bar_m = back_m / (2 * count) if rng.random() < 0.7 else 0.9 * back_m / count
    bars = [
        box(
            (0.02, side - thick, bar_m),
            (back_x, 0.0),
            colour,
            bottom_m=seat_m + back_m * (i + 1) / count - bar_m,
        )
        for i in range(count)
    ]
    return (*solids, *posts, *bars)


def random_thing(rng: Rng) -> tuple[Solid, ...]:
    """Return paper, a plate, a bowl, a fruit, a screen or a pot."""
    colour, kind = palette.any_colour(rng), int(rng.integers(len(_THINGS)))
    return _THINGS[kind](rng, colour)


def _wood_or_any(rng: Rng) -> Colour:
    if rng.random() < 0.5:
        return palette.hsv(rng.uniform(14, 40), rng.uniform(0.2, 0.7), rng.uniform(0.3, 0.95))
    return palette.any_colour(rng)


def _legs(
    half_m: tuple[float, float], height_m: float, thick_m: float, colour: Colour
) -> list[Solid]:
    x, y = half_m[0] - thick_m, half_m[1] - thick_m
    return [cylinder(thick_m, height_m, (i * x, k * y), colour) for i in (1, -1) for k in (1, -1)]


def _table(rng: Rng) -> Table:
    half = (float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.4, 1.0)))
    height = float(rng.uniform(0.4, 0.95))
    colour, thick = _wood_or_any(rng), float(rng.uniform(0.015, 0.06))
    of_legs = colour if rng.random() < 0.6 else palette.any_colour(rng)
    top = box((2 * half[0], 2 * half[1], thick), (0.0, 0.0), colour, bottom_m=height - thick)
    legs = _legs(half, height - thick, float(rng.uniform(0.03, 0.08)), of_legs)
    return Table(solids=(top, *legs), height_m=height, half_m=half)


def _round_table(rng: Rng) -> Table:
    radius, height = float(rng.uniform(0.3, 0.6)), float(rng.uniform(0.45, 1.1))
    colour, of_foot = _wood_or_any(rng), palette.any_colour(rng)
    solids = (
        cylinder(2 * radius, 0.03, (0.0, 0.0), colour, bottom_m=height - 0.03),
        cylinder(0.08, height - 0.03, (0.0, 0.0), of_foot),
        cylinder(1.1 * radius, 0.03, (0.0, 0.0), of_foot),
    )
    return Table(solids=solids, height_m=height, half_m=(0.7 * radius, 0.7 * radius))


def _kitchen_unit(rng: Rng) -> Table:
    """Return a worktop on a closed front with doors and handles."""
    half = (float(rng.uniform(0.28, 0.34)), float(rng.uniform(0.5, 1.2)))
    height = float(rng.uniform(0.84, 0.94))
    front, of_handles = palette.any_colour(rng), palette.any_colour(rng)
    doors = int(rng.integers(1, 5))
    width = 2 * half[1] / doors
    worktop = (2 * half[0], 2 * half[1] + 0.02, 0.04)
    solids = [
        box((2 * half[0] - 0.04, 2 * half[1], height - 0.04), (-0.02, 0.0), front),
        box(worktop, (0.0, 0.0), _wood_or_any(rng), bottom_m=height - 0.04),
    ]
    for i in range(doors):
        y = -half[1] + (i + 0.5) * width
        gap = (half[0] - 0.04, y - width / 2)
        handle = (half[0] - 0.03, y)
        solids += [
            box((0.01, 0.008, height - 0.14), gap, _DARK, bottom_m=0.08),
            box((0.02, 0.12, 0.012), handle, of_handles, bottom_m=height - 0.16),
        ]
    return Table(solids=tuple(solids), height_m=height, half_m=(half[0] - 0.03, half[1]))


_TABLES: tuple[Callable[[Rng], Table], ...] = (_table, _table, _round_table, _kitchen_unit)
"""Kinds of tables; the first is twice as frequent."""


def _paper(rng: Rng, _: Colour) -> tuple[Solid, ...]:
    white = palette.hsv(rng.uniform(0, 360), rng.uniform(0, 0.1), rng.uniform(0.8, 1.0))
    return (box((0.21, 0.3, 0.001), (0.0, 0.0), white),)


def _plate(rng: Rng, colour: Colour) -> tuple[Solid, ...]:
    width = float(rng.uniform(0.15, 0.28))
    return (
        cylinder(0.6 * width, 0.01, (0.0, 0.0), colour),
        cylinder(width, 0.012, (0.0, 0.0), colour, bottom_m=0.01),
    )


def _bowl(rng: Rng, colour: Colour) -> tuple[Solid, ...]:
    width = float(rng.uniform(0.2, 0.3))
    return tuple(
        cylinder((0.55 + 0.15 * i) * width, 0.02, (0.0, 0.0), colour, bottom_m=0.02 * i)
        for i in range(4)
    )


def _fruit(rng: Rng, colour: Colour) -> tuple[Solid, ...]:
    width = float(rng.uniform(0.05, 0.12))
    middle = (0.0, 0.0, width / 2)
    return (Solid(kind="ball", size_m=(width, width, width), centre_m=middle, colour=colour),)


def _screen(rng: Rng, colour: Colour) -> tuple[Solid, ...]:
    width, height = float(rng.uniform(0.3, 0.6)), float(rng.uniform(0.2, 0.4))
    return (
        box((0.16, 0.2, 0.015), (0.0, 0.0), colour),
        box((0.03, 0.05, 0.12), (0.0, 0.0), colour),
        box((0.03, width, height), (0.0, 0.0), (26, 26, 30), bottom_m=0.1),
    )


def _pot(rng: Rng, colour: Colour) -> tuple[Solid, ...]:
    width, height = float(rng.uniform(0.16, 0.26)), float(rng.uniform(0.1, 0.2))
    handles = [
        box((0.03, 0.05, 0.012), (0.0, end * (width / 2 + 0.02)), _DARK, bottom_m=0.75 * height)
        for end in (1, -1)
    ]
    return (cylinder(width, height, (0.0, 0.0), colour), *handles)


_THINGS: tuple[Callable[[Rng, Colour], tuple[Solid, ...]], ...] = (
    _paper,
    _plate,
    _bowl,
    _fruit,
    _screen,
    _pot,
)
