"""Random colours of floors, walls, furniture, clothes and each kind of item."""

from __future__ import annotations

import colorsys

import numpy as np

from sim.models.items import ITEM_COLOURS
from sim.models.solids import Colour

_GREYS: tuple[Colour, ...] = (
    (30, 30, 32),
    (70, 72, 76),
    (120, 120, 122),
    (180, 180, 178),
    (228, 228, 224),
)
_OF_ITEMS: dict[str, tuple[Colour, ...]] = {
    "box": (
        (176, 140, 98),
        (196, 160, 116),
        (150, 112, 74),
        (168, 128, 84),
        (214, 190, 152),
        (226, 222, 212),
    ),
    "keyboard": ((30, 30, 34), (62, 64, 68), (96, 98, 102), (208, 206, 198), (236, 236, 234)),
    "landmine": (
        (88, 92, 62),
        (74, 84, 50),
        (104, 98, 72),
        (112, 92, 66),
        (96, 100, 98),
        (64, 68, 58),
        (130, 122, 88),
    ),
    "wet-floor sign": ((236, 196, 24), (250, 214, 30), (226, 176, 10), (244, 226, 60)),
    "cable": (
        (24, 24, 26),
        (40, 40, 44),
        (226, 226, 222),
        (120, 122, 126),
        (236, 120, 20),
        (30, 70, 170),
        (230, 200, 30),
    ),
}
_SKINS: tuple[Colour, ...] = (
    (240, 208, 184),
    (198, 164, 138),
    (224, 172, 132),
    (160, 112, 80),
    (116, 78, 54),
    (72, 48, 36),
)
_HAIR: tuple[Colour, ...] = (
    (24, 20, 18),
    (70, 48, 32),
    (124, 88, 52),
    (200, 172, 110),
    (150, 150, 150),
    (120, 52, 30),
)


def hsv(hue_deg: float, saturation: float, value: float) -> Colour:
    """Return a colour by its hue; saturation and value from 0 to 1."""
    red, green, blue = (
        round(255 * level) for level in colorsys.hsv_to_rgb(hue_deg % 360 / 360, saturation, value)
    )
    return red, green, blue


def pick(rng: np.random.Generator, colours: tuple[Colour, ...]) -> Colour:
    """Return one of the colours, a little lighter or darker."""
    by = rng.uniform(0.85, 1.12)
    red, green, blue = (
        int(np.clip(level * by + rng.uniform(-8, 8), 0, 255))
        for level in colours[rng.integers(len(colours))]
    )
    return red, green, blue


def vivid(rng: np.random.Generator) -> Colour:
    """Return a saturated colour of any hue."""
    return hsv(rng.uniform(0, 360), rng.uniform(0.5, 1.0), rng.uniform(0.35, 1.0))


def any_colour(rng: np.random.Generator) -> Colour:
    """Return a saturated, pale or grey colour."""
    kind = rng.random()
    if kind < 0.45:
        return vivid(rng)
    if kind < 0.75:
        return hsv(rng.uniform(0, 360), rng.uniform(0.05, 0.5), rng.uniform(0.2, 1.0))
    return pick(rng, _GREYS)


def red(rng: np.random.Generator) -> Colour:
    """Return the colour of a red floor: from crimson to vermilion, from dark to bright."""
    return hsv(rng.uniform(-14, 13), rng.uniform(0.66, 1.0), rng.uniform(0.45, 0.95))


def other_marking(rng: np.random.Generator) -> Colour:
    """Return the colour of a meaningless marking: anything but red, or pale."""
    if rng.random() < 0.25:
        return pick(rng, _GREYS)
    return hsv(rng.uniform(35, 300), rng.uniform(0.4, 1.0), rng.uniform(0.4, 1.0))


def floor(rng: np.random.Generator) -> Colour:
    """Return the colour of an indoor floor: grey, brown, or a dull hue; no red."""
    kind = rng.random()
    if kind < 0.4:
        level = rng.uniform(0.3, 0.95)
        return hsv(rng.uniform(0, 360), rng.uniform(0.0, 0.06), level)
    if kind < 0.75:
        return hsv(rng.uniform(22, 42), rng.uniform(0.15, 0.55), rng.uniform(0.35, 0.9))
    return hsv(rng.uniform(40, 300), rng.uniform(0.1, 0.5), rng.uniform(0.25, 0.8))


def wall(rng: np.random.Generator) -> Colour:
    """Return the colour of a wall, mostly pale."""
    if rng.random() < 0.15:
        return any_colour(rng)
    return hsv(rng.uniform(0, 360), rng.uniform(0.0, 0.18), rng.uniform(0.7, 1.0))


def item(rng: np.random.Generator, kind: str) -> Colour:
    """Return the colour of one kind of item: its default, a typical one, or any."""
    if rng.random() < 0.2:
        return ITEM_COLOURS[kind]
    typical = _OF_ITEMS.get(kind)
    if typical is not None and (kind != "cable" or rng.random() < 0.7):
        return pick(rng, typical)
    return any_colour(rng)


def spilt(rng: np.random.Generator, surface: str) -> Colour:
    """Return the colour of water, mud or a chemical."""
    if surface == "water":
        return hsv(rng.uniform(195, 230), rng.uniform(0.05, 0.35), rng.uniform(0.45, 0.9))
    if surface == "mud":
        return hsv(rng.uniform(18, 36), rng.uniform(0.35, 0.65), rng.uniform(0.2, 0.5))
    return hsv(rng.uniform(55, 130), rng.uniform(0.55, 1.0), rng.uniform(0.5, 0.95))


def skin(rng: np.random.Generator) -> Colour:
    """Return the colour of skin."""
    return pick(rng, _SKINS)


def hair(rng: np.random.Generator) -> Colour:
    """Return the colour of hair."""
    return pick(rng, _HAIR)
