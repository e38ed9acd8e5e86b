"""What people look like: a few solids, facing +x."""

from __future__ import annotations

from dataclasses import dataclass

from sim.models.solids import Colour, Solid, box, cylinder


@dataclass(frozen=True, slots=True, kw_only=True)
class Appearance:
    """How somebody is dressed and how tall."""

    height_m: float = 1.75
    """Of the whole person."""
    girth: float = 1.0
    """How broad, by that of the usual person."""
    skin: Colour = (198, 164, 138)
    """Of face and hands."""
    hair: Colour | None = None
    """None for none, or a hood of the skin's colour."""
    shirt: Colour = (122, 122, 134)
    """Of body and arms."""
    trousers: Colour = (58, 60, 70)
    """Of the legs."""
    shoes: Colour = (60, 60, 64)
    """Of the shoes."""
    skirt: bool = False
    """Whether a skirt of the trousers' colour hangs over the legs, or a coat."""


USUAL = Appearance()
"""Everybody in a scenario."""


def person_solids(stride: float = 0.0, look: Appearance = USUAL) -> tuple[Solid, ...]:
    """A person who faces +x; `stride` is how far the left foot is ahead of the hip, in metres."""
    up, out = look.height_m / USUAL.height_m, look.girth
    legs = [
        cylinder(0.16 * out, 0.84 * up, (side * stride, side * 0.10 * out), look.trousers)
        for side in (1, -1)
    ]
    shoes = [
        box((0.26, 0.10, 0.07), (side * stride + 0.04, side * 0.10 * out), look.shoes)
        for side in (1, -1)
    ]
    arms = [
        cylinder(
            0.09 * out,
            0.60 * up,
            (-side * stride * 0.7, side * 0.24 * out),
            look.shirt,
            bottom_m=0.82 * up,
        )
        for side in (1, -1)
    ]
    torso = box((0.24 * out, 0.40 * out, 0.62 * up), (0.0, 0.0), look.shirt, bottom_m=0.84 * up)
    head = cylinder(0.19, 0.27 * up, (0.0, 0.0), look.skin, bottom_m=1.48 * up)
    return (*legs, *shoes, torso, *arms, head, *_more(look, stride, up))


def _more(look: Appearance, stride: float, up: float) -> tuple[Solid, ...]:
    """What not everybody has: hair, with hands of the skin's colour; a skirt or coat."""
    more: list[Solid] = []
    if look.hair is not None:
        size = (0.23, 0.23, 0.16 * up)
        more.append(
            Solid(
                kind="ball",
                size_m=size,
                centre_m=(-0.02, 0.0, look.height_m - 0.05 * up),
                colour=look.hair,
            )
        )
        hands = ((-side * stride * 0.7, side * 0.24 * look.girth, 0.80 * up) for side in (1, -1))
        more += [
            Solid(kind="ball", size_m=(0.09, 0.09, 0.12), centre_m=hand, colour=look.skin)
            for hand in hands
        ]
    if look.skirt:
        size = (0.44 * look.girth + stride, 0.44 * look.girth + stride, 0.5 * up)
        more.append(
            Solid(
                kind="cylinder", size_m=size, centre_m=(0.0, 0.0, 0.65 * up), colour=look.trousers
            )
        )
    return tuple(more)
