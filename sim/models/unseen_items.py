"""Things that no data set holds, so that the network was never trained on them: they stand for what
an operator points at. Each is a few solids about the middle of the thing."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from sim.models.item_shapes import shade
from sim.models.solids import Colour, Size, Solid, box, cylinder

_DARK: Colour = (40, 40, 44)
_STEEL: Colour = (150, 152, 156)


def _ball(diameter_m: float, at_m: tuple[float, float, float], colour: Colour) -> Solid:
    return Solid(kind="ball", size_m=(diameter_m,) * 3, centre_m=at_m, colour=colour)


def _teddy(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a sitting toy bear."""
    _, width, height = size
    body, head = 0.6 * height, 0.42 * height
    limbs = [
        _ball(0.26 * height, (x * height, side * y * width, z * height), shade(colour, 0.85))
        for side in (1, -1)
        for x, y, z in ((0.3, 0.3, 0.13), (0.12, 0.45, 0.42))
    ]
    ears = [
        _ball(0.15 * height, (0.0, side * 0.17 * height, 0.93 * height), shade(colour, 0.7))
        for side in (1, -1)
    ]
    snout = _ball(0.15 * height, (0.2 * height, 0.0, 0.68 * height), shade(colour, 1.4))
    return (
        _ball(body, (0.0, 0.0, body / 2), colour),
        _ball(head, (0.02, 0.0, 0.74 * height), colour),
        snout,
        *limbs,
        *ears,
    )


def _vase(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    return (
        cylinder(0.55 * width, 0.06 * height, (0.0, 0.0), shade(colour, 0.7)),
        _ball(width, (0.0, 0.0, 0.06 * height + width / 2), colour),
        cylinder(0.36 * width, 0.35 * height, (0.0, 0.0), colour, bottom_m=0.6 * height),
        cylinder(
            0.56 * width, 0.06 * height, (0.0, 0.0), shade(colour, 1.3), bottom_m=0.94 * height
        ),
    )


def _bucket(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    rings = [
        cylinder((0.76 + 0.06 * i) * width, height / 4, (0.0, 0.0), colour, bottom_m=i * height / 4)
        for i in range(4)
    ]
    rim = cylinder(width, 0.06 * height, (0.0, 0.0), shade(colour, 0.75), bottom_m=0.95 * height)
    inside = cylinder(0.9 * width, 0.004, (0.0, 0.0), shade(colour, 0.35), bottom_m=1.01 * height)
    return (*rings, rim, inside)


def _toy_truck(size: Size, colour: Colour) -> tuple[Solid, ...]:
    length, width, height = size
    wheel = 0.36 * height
    wheels = [
        box((wheel, 0.12 * width, wheel), (x * length, side * 0.46 * width), _DARK)
        for side in (1, -1)
        for x in (-0.32, 0.3)
    ]
    return (
        box((length, 0.8 * width, 0.2 * height), (0.0, 0.0), _DARK, bottom_m=0.22 * height),
        box(
            (0.3 * length, 0.8 * width, 0.58 * height),
            (0.33 * length, 0.0),
            colour,
            bottom_m=0.42 * height,
        ),
        box(
            (0.6 * length, 0.9 * width, 0.4 * height),
            (-0.18 * length, 0.0),
            shade(colour, 0.6),
            bottom_m=0.42 * height,
        ),
        *wheels,
    )


def _watering_can(size: Size, colour: Colour) -> tuple[Solid, ...]:
    length, width, height = size
    body = cylinder(width, 0.7 * height, (-0.1 * length, 0.0), colour)
    spout = Solid(
        kind="cylinder",
        size_m=(0.16 * width, 0.16 * width, 0.6 * length),
        centre_m=(0.3 * length, 0.0, 0.55 * height),
        colour=shade(colour, 0.8),
        pitch_rad=0.9,
    )
    bar, post = (0.5 * length, 0.1 * width, 0.06 * height), (0.05 * length, 0.1 * width)
    handle = box(bar, (-0.15 * length, 0.0), _DARK, bottom_m=0.94 * height)
    posts = [
        box((*post, 0.26 * height), (x * length, 0.0), _DARK, bottom_m=0.7 * height)
        for x in (-0.36, 0.07)
    ]
    return (body, spout, handle, *posts)


def _lamp(size: Size, colour: Colour) -> tuple[Solid, ...]:
    width, _, height = size
    shade_of = Solid(
        kind="cone",
        size_m=(width, width, 0.45 * height),
        centre_m=(0.0, 0.0, 0.775 * height),
        colour=colour,
    )
    return (
        cylinder(0.6 * width, 0.06 * height, (0.0, 0.0), _STEEL),
        cylinder(0.1 * width, 0.5 * height, (0.0, 0.0), _STEEL, bottom_m=0.06 * height),
        shade_of,
    )


def _toolbox(size: Size, colour: Colour) -> tuple[Solid, ...]:
    length, width, height = size
    return (
        box((length, width, 0.55 * height), (0.0, 0.0), colour),
        box((1.02 * length, 1.02 * width, 0.2 * height), (0.0, 0.0), _DARK, bottom_m=0.55 * height),
        box((0.1 * length, 0.6 * width, 0.08 * height), (0.0, 0.0), _STEEL, bottom_m=0.92 * height),
        *(
            box(
                (0.1 * length, 0.06 * width, 0.2 * height),
                (0.0, side * 0.28 * width),
                _STEEL,
                bottom_m=0.75 * height,
            )
            for side in (1, -1)
        ),
    )


def _scooter(size: Size, colour: Colour) -> tuple[Solid, ...]:
    """Return a child's scooter, upright."""
    length, width, height = size
    wheel = (0.16 * length, 0.03, 0.16 * length)
    wheels = [box(wheel, (x * length, 0.0), _DARK) for x in (-0.4, 0.4)]
    return (
        box((0.7 * length, 0.4 * width, 0.03), (0.0, 0.0), colour, bottom_m=0.09),
        box((0.035, 0.035, height - 0.1), (0.38 * length, 0.0), _STEEL, bottom_m=0.1),
        box((0.04, width, 0.04), (0.38 * length, 0.0), shade(colour, 0.7), bottom_m=height - 0.04),
        *wheels,
    )


Builder = Callable[[Size, Colour], tuple[Solid, ...]]
UNSEEN_ITEMS: Mapping[str, tuple[Builder, Size, Colour]] = {
    "teddy": (_teddy, (0.26, 0.30, 0.36), (150, 96, 52)),
    "vase": (_vase, (0.22, 0.22, 0.42), (38, 92, 150)),
    "bucket": (_bucket, (0.28, 0.28, 0.28), (214, 66, 40)),
    "toy truck": (_toy_truck, (0.42, 0.20, 0.22), (232, 180, 30)),
    "watering can": (_watering_can, (0.44, 0.18, 0.30), (52, 140, 78)),
    "lamp": (_lamp, (0.28, 0.28, 0.48), (226, 214, 176)),
    "toolbox": (_toolbox, (0.22, 0.44, 0.24), (30, 74, 160)),
    "scooter": (_scooter, (0.62, 0.34, 0.66), (205, 50, 120)),
}
"""Builder, default size and usual colour of each kind."""
