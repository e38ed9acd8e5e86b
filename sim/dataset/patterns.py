"""Random patterns that multiply the colour of floors: greys near white, periodic at the edges."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from sim.models.textures import Texture

SIDE_PX = 256
Grey = npt.NDArray[np.float64]
"""(SIDE_PX, SIDE_PX) grey levels, or with three channels, 0 to 1."""


def smooth_noise(rng: np.random.Generator, cells: int, side_px: int = SIDE_PX) -> Grey:
    """Return (side_px, side_px) smooth noise of mean 0 and deviation 1 with `cells` nodes a side,
    periodic at the edges."""
    nodes = np.pad(rng.standard_normal((cells, cells)), 2, mode="wrap")
    edge = round(2 * side_px / cells)
    whole = cv2.resize(
        nodes, (side_px + 2 * edge, side_px + 2 * edge), interpolation=cv2.INTER_CUBIC
    )
    middle = whole[edge : edge + side_px, edge : edge + side_px]
    return np.asarray((middle - middle.mean()) / max(middle.std(), 1e-9))


def _tiles(rng: np.random.Generator) -> Grey:
    count = int(rng.choice([2, 4, 8]))
    step = SIDE_PX // count
    tones = 1.0 - rng.uniform(0.0, 0.12) * rng.random((count, count))
    if rng.random() < 0.25:  # a chequerboard
        tones -= rng.uniform(0.1, 0.6) * (np.indices((count, count)).sum(axis=0) % 2)
    levels = np.kron(tones, np.ones((step, step)))
    joint, width = rng.uniform(0.45, 1.0), int(rng.integers(1, 4))
    at = np.arange(SIDE_PX) % step < width
    levels[at[:, None] | at[None, :]] = joint
    return levels + 0.015 * smooth_noise(rng, 64)


def _wood(rng: np.random.Generator) -> Grey:
    boards = int(rng.choice([4, 8, 16]))
    step = SIDE_PX // boards
    levels = np.zeros((SIDE_PX, SIDE_PX))
    for i in range(boards):
        grain = cv2.resize(
            rng.standard_normal((step, 8)), (SIDE_PX, step), interpolation=cv2.INTER_CUBIC
        )
        levels[i * step : (i + 1) * step] = rng.uniform(0.78, 1.0) + 0.04 * grain
        levels[i * step] = 0.55
        levels[i * step : (i + 1) * step, int(rng.integers(SIDE_PX))] = 0.6
    return levels if rng.random() < 0.5 else levels.T


def _carpet(rng: np.random.Generator) -> Grey:
    levels = (
        0.85
        + rng.uniform(0.03, 0.1) * rng.standard_normal((SIDE_PX, SIDE_PX))
        + 0.04 * smooth_noise(rng, 12)
    )
    if rng.random() < 0.3:
        levels -= 0.15 * (
            np.sin(np.arange(SIDE_PX) * 2 * np.pi * int(rng.integers(4, 20)) / SIDE_PX) > 0.6
        )
    return np.asarray(levels)


def _concrete(rng: np.random.Generator) -> Grey:
    levels = (
        0.85
        + 0.05 * smooth_noise(rng, 5)
        + 0.03 * smooth_noise(rng, 21)
        + 0.02 * rng.standard_normal((SIDE_PX, SIDE_PX))
    )
    for _ in range(int(rng.integers(0, 3))):
        run = np.cumsum(rng.normal(0, 6, (14, 2)) + rng.normal(0, 12, 2), axis=0) + rng.uniform(
            0, SIDE_PX, 2
        )
        cv2.polylines(levels, [run.astype(np.int32)], False, 0.55, 1)
    return levels


def _terrazzo(rng: np.random.Generator) -> Grey:
    levels = np.full((SIDE_PX, SIDE_PX, 3), 0.86)
    for _ in range(int(rng.integers(150, 500))):
        middle = tuple(int(v) for v in rng.integers(0, SIDE_PX, 2))
        axes = tuple(int(v) for v in rng.integers(1, 5, 2))
        tone = rng.uniform(0.4, 1.0) + rng.uniform(-0.08, 0.08, 3)
        cv2.ellipse(levels, middle, axes, rng.uniform(0, 180), 0, 360, tone.tolist(), -1)
    return levels


def _grass(rng: np.random.Generator) -> Grey:
    levels = 0.7 + 0.16 * smooth_noise(rng, 7) + 0.14 * rng.standard_normal((SIDE_PX, SIDE_PX))
    return np.asarray(cv2.GaussianBlur(levels, (0, 0), 0.8) + 0.1 * smooth_noise(rng, 80))


def _plain(rng: np.random.Generator) -> Grey:
    return 0.96 + 0.02 * smooth_noise(rng, 6)


INDOOR: tuple[Callable[[np.random.Generator], Grey], ...] = (
    _tiles,
    _wood,
    _carpet,
    _concrete,
    _terrazzo,
    _plain,
)
OUTDOOR: tuple[Callable[[np.random.Generator], Grey], ...] = (_grass, _concrete, _tiles)


def pattern(rng: np.random.Generator, *, outdoor: bool) -> Texture:
    """Return a random pattern of a floor or of the ground."""
    kinds = OUTDOOR if outdoor else INDOOR
    grey = kinds[rng.integers(len(kinds))](rng)
    levels = np.clip(255 * grey, 0, 255).astype(np.uint8)
    return levels if levels.ndim == 3 else np.repeat(levels[:, :, None], 3, axis=2)
