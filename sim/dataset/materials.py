"""Random materials of surfaces: wood, fabric, metal, stone, paint and print, each as a coloured
texture that repeats over the surface."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from sim.dataset import palette
from sim.dataset.patterns import SIDE_PX, Grey, smooth_noise
from sim.models.textures import Texture

Rng = np.random.Generator
Levels = npt.NDArray[np.float64]
"""(SIDE_PX, SIDE_PX, 3) colours, 0 to 255."""


def material_texture(rng: Rng) -> Texture:
    """Return the texture of a random material."""
    levels = _MATERIALS[rng.integers(len(_MATERIALS))](rng)
    return np.asarray(np.clip(levels, 0, 255), dtype=np.uint8)


def package_texture(rng: Rng) -> Texture:
    """Return what is printed on a package, a label, a cover or a mug: a ground that changes
    slowly, pictures, a title, and lines of text."""
    levels = np.full((SIDE_PX, SIDE_PX, 3), palette.any_colour(rng), dtype=np.float64)
    if rng.random() < 0.5:
        slope = 0.5 + 0.5 * smooth_noise(rng, 2).clip(-1, 1)[:, :, None]
        levels += rng.uniform(0.2, 0.8) * slope * (np.array(palette.any_colour(rng)) - levels)
    for _ in range(int(rng.integers(1, 7))):
        _picture(levels, rng)
    printed = np.ascontiguousarray(np.clip(levels, 0, 255).astype(np.uint8))
    for _ in range(int(rng.integers(0, 3))):
        letters = "".join(chr(int(code)) for code in rng.integers(65, 91, rng.integers(2, 8)))
        at = (int(rng.integers(0, SIDE_PX // 2)), int(rng.integers(30, SIDE_PX)))
        height, thick = float(rng.uniform(0.7, 3.0)), int(rng.integers(1, 9))
        cv2.putText(printed, letters, at, int(rng.integers(8)), height, _tone(rng), thick)
    for _ in range(int(rng.integers(0, 4))):
        row, col, tone = *(int(v) for v in rng.integers(0, SIDE_PX, 2)), _tone(rng)
        for line in range(int(rng.integers(2, 12))):
            end = col + int(rng.integers(20, 90))
            cv2.line(printed, (col, row + 6 * line), (end, row + 6 * line), tone, 2)
    return printed


def _picture(levels: Levels, rng: Rng) -> None:
    """Draw an ellipse or a block of two colours that flow into each other."""
    middle, half = rng.integers(0, SIDE_PX, 2).tolist(), rng.integers(12, 90, 2).tolist()
    mask = np.zeros((SIDE_PX, SIDE_PX))
    if rng.random() < 0.6:
        cv2.ellipse(mask, middle, half, float(rng.uniform(0, 180)), 0, 360, 1.0, -1)
    else:
        low, high = np.subtract(middle, half), np.add(middle, half)
        cv2.rectangle(mask, low.tolist(), high.tolist(), 1.0, -1)
    flow = smooth_noise(rng, int(rng.integers(3, 24)))[:, :, None] > rng.uniform(-1, 1)
    picture = np.where(flow, palette.any_colour(rng), palette.any_colour(rng))
    levels += mask[:, :, None] * (picture - levels)


def _tone(rng: Rng) -> tuple[int, int, int]:
    """Return the colour of letters: black or white as often as any other."""
    grey = 255 * int(rng.integers(2))
    return (grey, grey, grey) if rng.random() < 0.5 else palette.any_colour(rng)


def _coloured(grey: Grey, colour: tuple[int, int, int]) -> Levels:
    return np.asarray(grey[:, :, None] * np.array(colour, dtype=np.float64))


def _wood(rng: Rng) -> Levels:
    """Return grain along the columns: stretched noise, and rings that bend with it."""
    colour = palette.hsv(rng.uniform(12, 42), rng.uniform(0.15, 0.75), rng.uniform(0.25, 0.95))
    bend = cv2.resize(smooth_noise(rng, 4), (SIDE_PX, SIDE_PX))
    across = np.arange(SIDE_PX)[:, None] / SIDE_PX + rng.uniform(0.0, 0.06) * bend
    rings = np.sin(2 * np.pi * int(rng.integers(3, 14)) * across)
    fibres = cv2.resize(
        rng.standard_normal((SIDE_PX, int(rng.integers(3, 12)))),
        (SIDE_PX, SIDE_PX),
        interpolation=cv2.INTER_CUBIC,
    )
    grey = 0.9 + rng.uniform(0.02, 0.14) * rings + rng.uniform(0.02, 0.09) * fibres
    if rng.random() < 0.4:  # boards
        step = SIDE_PX // int(rng.choice([2, 4]))
        tones = rng.uniform(0.85, 1.1, SIDE_PX // step)
        grey *= np.repeat(tones, step)[:, None]
        grey[np.arange(SIDE_PX) % step < 2] *= rng.uniform(0.4, 0.8)
    return _coloured(np.asarray(grey), colour)


def _fabric(rng: Rng) -> Levels:
    """Return a weave, in stripes or checks of several colours in half of the cases."""
    y, x = np.indices((SIDE_PX, SIDE_PX))
    weave = 0.92 + rng.uniform(0.02, 0.1) * ((x + y) % 2) + 0.05 * smooth_noise(rng, 40)
    weave += rng.uniform(0.01, 0.06) * rng.standard_normal((SIDE_PX, SIDE_PX))
    levels = _coloured(weave, palette.any_colour(rng))
    if rng.random() < 0.5:
        step = SIDE_PX // int(rng.choice([2, 4, 8]))
        other = np.array(palette.any_colour(rng), dtype=np.float64)
        stripe = (x % step < step * rng.uniform(0.1, 0.6)).astype(np.float64)
        if rng.random() < 0.5:
            stripe = (stripe + (y % step < step * rng.uniform(0.1, 0.6))) / 2
        levels += stripe[:, :, None] * (weave[:, :, None] * other - levels)
    return levels


def _metal(rng: Rng) -> Levels:
    """Return brushed metal: streaks along the columns, and what it mirrors as a slow change."""
    streaks = np.repeat(rng.standard_normal((SIDE_PX, 1)), SIDE_PX, axis=1)
    grey = 0.8 + rng.uniform(0.01, 0.06) * streaks + rng.uniform(0.03, 0.12) * smooth_noise(rng, 3)
    return _coloured(
        grey, palette.hsv(rng.uniform(0, 360), rng.uniform(0, 0.1), rng.uniform(0.4, 1))
    )


def _stone(rng: Rng) -> Levels:
    """Return a worktop: speckles of some tones, with veins in half of the cases."""
    grey = 0.85 + rng.uniform(0.02, 0.15) * smooth_noise(rng, int(rng.choice([24, 48, 80])))
    grey += rng.uniform(0.01, 0.08) * rng.standard_normal((SIDE_PX, SIDE_PX))
    if rng.random() < 0.5:
        grey -= rng.uniform(0.05, 0.3) * (np.abs(smooth_noise(rng, 5)) < 0.06)
    return _coloured(grey, palette.floor(rng))


def _paint(rng: Rng) -> Levels:
    """Return paint with slow changes of its tone, and scratches and stains."""
    grey = 0.93 + rng.uniform(0.01, 0.06) * smooth_noise(rng, 4)
    for _ in range(int(rng.integers(0, 8))):
        start = rng.integers(0, SIDE_PX, 2)
        end = start + rng.integers(-60, 60, 2)
        cv2.line(grey, start.tolist(), end.tolist(), float(rng.uniform(0.6, 1.1)), 1)
    return _coloured(np.asarray(grey), palette.any_colour(rng))


def _print(rng: Rng) -> Levels:
    """Return a printed surface: blocks of colours, and lines as of text."""
    levels = np.full((SIDE_PX, SIDE_PX, 3), palette.any_colour(rng), dtype=np.float64)
    for _ in range(int(rng.integers(2, 9))):
        low, high = np.sort(rng.integers(0, SIDE_PX, (2, 2)), axis=0)
        levels[low[0] : high[0], low[1] : high[1]] = palette.any_colour(rng)
    for _ in range(int(rng.integers(0, 14))):
        row, col = (int(v) for v in rng.integers(0, SIDE_PX, 2))
        length, tone = int(rng.integers(20, 140)), palette.any_colour(rng)
        cv2.line(levels, (col, row), (col + length, row), tone, int(rng.integers(1, 5)))
    return levels


_MATERIALS: tuple[Callable[[Rng], Levels], ...] = (
    _wood,
    _wood,
    _fabric,
    _metal,
    _stone,
    _paint,
    _print,
)
"""Kinds of material; wood is twice as frequent, as most furniture is of it."""
