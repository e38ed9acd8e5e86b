"""Shape of people: a few solids, facing +x."""

from __future__ import annotations

from dataclasses import dataclass

from sim.models.solids import Colour, Solid, box, cylinder

PERSON = "person"
"""Class of people in a beware list."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Appearance:
    """Body and clothes of a person."""

    height_m: float = 1.75
    """Height of the person."""
    girth: float = 1.0
    """Breadth as a multiple of the default breadth."""
    skin: Colour = (198, 164, 138)
    """Colour of face and hands."""
    hair: Colour | None = None
    """Colour of the hair; None for none, or a hood of the colour of the skin."""
    shirt: Colour = (122, 122, 134)
    """Colour of body and arms."""
    trousers: Colour = (58, 60, 70)
    """Colour of the legs."""
    shoes: Colour = (60, 60, 64)
    """Colour of the shoes."""
    skirt: bool = False
    """Whether a skirt or coat of the trousers' colour hangs over the legs."""


DEFAULT_APPEARANCE = Appearance()
"""The appearance of all people in scenarios."""


def person_solids(
    stride: float = 0.0, appearance: Appearance = DEFAULT_APPEARANCE
) -> tuple[Solid, ...]:
    """Return a person who faces +x; `stride` is the distance of the left foot ahead of the hip, in
    metres."""
    up, out = appearance.height_m / DEFAULT_APPEARANCE.height_m, appearance.girth
    legs = [
        cylinder(0.16 * out, 0.84 * up, (side * stride, side * 0.10 * out), appearance.trousers)
        for side in (1, -1)
    ]
    shoes = [
        box((0.26, 0.10, 0.07), (side * stride + 0.04, side * 0.10 * out), appearance.shoes)
        for side in (1, -1)
    ]
    arms = [
        cylinder(
            0.09 * out,
            0.60 * up,
            (-side * stride * 0.7, side * 0.24 * out),
            appearance.shirt,
            bottom_m=0.82 * up,
        )
        for side in (1, -1)
    ]
    torso = box(
        (0.24 * out, 0.40 * out, 0.62 * up), (0.0, 0.0), appearance.shirt, bottom_m=0.84 * up
    )
    head = cylinder(0.19, 0.27 * up, (0.0, 0.0), appearance.skin, bottom_m=1.48 * up)
    return (*legs, *shoes, torso, *arms, head, *_extras(appearance, stride, up))


def _extras(appearance: Appearance, stride: float, up: float) -> tuple[Solid, ...]:
    """Return the optional parts: hair with hands of the colour of the skin; a skirt or coat."""
    extras: list[Solid] = []
    if appearance.hair is not None:
        size = (0.23, 0.23, 0.16 * up)
        extras.append(
            Solid(
                kind="ball",
                size_m=size,
                centre_m=(-0.02, 0.0, appearance.height_m - 0.05 * up),
                colour=appearance.hair,
            )
        )
        hands = (
            (-side * stride * 0.7, side * 0.24 * appearance.girth, 0.80 * up) for side in (1, -1)
        )
        extras += [
            Solid(kind="ball", size_m=(0.09, 0.09, 0.12), centre_m=hand, colour=appearance.skin)
            for hand in hands
        ]
    if appearance.skirt:
        size = (0.44 * appearance.girth + stride, 0.44 * appearance.girth + stride, 0.5 * up)
        extras.append(
            Solid(
                kind="cylinder",
                size_m=size,
                centre_m=(0.0, 0.0, 0.65 * up),
                colour=appearance.trousers,
            )
        )
    return tuple(extras)
