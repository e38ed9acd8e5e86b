"""Patterns that multiply the colours of floors, walls and trees: greys near white, so that no hue
changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
import numpy.typing as npt

from sim.models.solids import Pattern
from sim.models.textures import SPILL_PX, Texture, smooth_noise

SIDE_PX = SPILL_PX
Grey = npt.NDArray[np.float64]
"""(SIDE_PX, SIDE_PX) grey levels, 0 to 1, periodic at the edges."""


@cache
def surface_texture(pattern: Pattern) -> Texture:
    """Return the (SIDE_PX, SIDE_PX, 3) texture of a pattern, the same each time; read only."""
    grey = _PATTERNS[pattern][0](np.random.default_rng(len(pattern)))
    texture = np.repeat(np.clip(255 * grey, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
    texture.flags.writeable = False
    return texture


def pattern_period_m(pattern: Pattern) -> float:
    """Return the length after which the pattern repeats; 0 for a plain surface, which needs no
    texture."""
    return _PATTERNS[pattern][1] if pattern != "plain" else 0.0


def _noise(rng: np.random.Generator) -> Grey:
    return rng.standard_normal((SIDE_PX, SIDE_PX))


def _joints(grey: Grey, rows: int, cols: int, shifted: bool, tone: float) -> Grey:
    """Return the grey levels with dark joints between rows and columns of stones; `shifted` offsets
    every second row by half a stone."""
    y, x = np.indices(grey.shape)
    row = y * rows // SIDE_PX
    along = (x + (row % 2) * shifted * SIDE_PX // (2 * cols)) % (SIDE_PX // cols)
    return np.where((y % (SIDE_PX // rows) < 2) | (along < 2), tone, grey)


def _tiles(rng: np.random.Generator) -> Grey:
    tones = np.kron(0.97 - 0.05 * rng.random((4, 4)), np.ones((SIDE_PX // 4, SIDE_PX // 4)))
    return _joints(tones + 0.008 * smooth_noise(rng, 32), 4, 4, False, 0.8)


def _carpet(rng: np.random.Generator) -> Grey:
    return 0.9 + 0.035 * _noise(rng) + 0.02 * smooth_noise(rng, 8)


def _grass(rng: np.random.Generator) -> Grey:
    return 0.82 + 0.07 * smooth_noise(rng, 7) + 0.06 * smooth_noise(rng, 32) + 0.05 * _noise(rng)


def _bark(rng: np.random.Generator) -> Grey:
    return 0.8 + 0.1 * rng.standard_normal((1, SIDE_PX)) + 0.06 * smooth_noise(rng, 16)


def _leaves(rng: np.random.Generator) -> Grey:
    return 0.8 + 0.14 * smooth_noise(rng, 24) + 0.05 * _noise(rng)


def _brick(rng: np.random.Generator) -> Grey:
    return _joints(0.88 + 0.05 * smooth_noise(rng, 16), 8, 4, True, 0.98)


def _thatch(rng: np.random.Generator) -> Grey:
    return _joints(0.9 + 0.04 * smooth_noise(rng, 16), 8, 8, True, 0.65)


_PATTERNS: Mapping[Pattern, tuple[Callable[[np.random.Generator], Grey], float]] = {
    "plain": (lambda rng: np.ones((SIDE_PX, SIDE_PX)), 1.0),
    "tiles": (_tiles, 2.4),
    "carpet": (_carpet, 2.0),
    "grass": (_grass, 5.0),
    "bark": (_bark, 1.0),
    "leaves": (_leaves, 2.0),
    "brick": (_brick, 1.0),
    "thatch": (_thatch, 1.6),
}
