"""Patterns of floors, in greys about white: the floor's colour is multiplied with them. They repeat
at their edges."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from sim.models.textures import Texture

SIDE_PX = 256
Grey = npt.NDArray[np.float64]
"""(SIDE_PX, SIDE_PX) or with three channels, 0 to 1."""


def clouds(rng: np.random.Generator, cells: int, side_px: int = SIDE_PX) -> Grey:
    """Smooth noise of mean 0 and deviation 1 that repeats at its edges, of so many spots a side."""
    spots = np.pad(rng.standard_normal((cells, cells)), 2, mode="wrap")
    edge = round(2 * side_px / cells)
    whole = cv2.resize(
        spots, (side_px + 2 * edge, side_px + 2 * edge), interpolation=cv2.INTER_CUBIC
    )
    middle = whole[edge : edge + side_px, edge : edge + side_px]
    return np.asarray((middle - middle.mean()) / max(middle.std(), 1e-9))


def _tiles(rng: np.random.Generator) -> Grey:
    count = int(rng.choice([2, 4, 8]))
    step = SIDE_PX // count
    tones = 1.0 - rng.uniform(0.0, 0.12) * rng.random((count, count))
    if rng.random() < 0.25:  # a chequerboard
        tones -= rng.uniform(0.1, 0.6) * (np.indices((count, count)).sum(axis=0) % 2)
    picture = np.kron(tones, np.ones((step, step)))
    joint, width = rng.uniform(0.45, 1.0), int(rng.integers(1, 4))
    at = np.arange(SIDE_PX) % step < width
    picture[at[:, None] | at[None, :]] = joint
    return picture + 0.015 * clouds(rng, 64)


def _wood(rng: np.random.Generator) -> Grey:
    boards = int(rng.choice([4, 8, 16]))
    step = SIDE_PX // boards
    picture = np.zeros((SIDE_PX, SIDE_PX))
    for i in range(boards):
        grain = cv2.resize(
            rng.standard_normal((step, 8)), (SIDE_PX, step), interpolation=cv2.INTER_CUBIC
        )
        picture[i * step : (i + 1) * step] = rng.uniform(0.78, 1.0) + 0.04 * grain
        picture[i * step] = 0.55
        picture[i * step : (i + 1) * step, int(rng.integers(SIDE_PX))] = 0.6
    return picture if rng.random() < 0.5 else picture.T


def _carpet(rng: np.random.Generator) -> Grey:
    picture = (
        0.85
        + rng.uniform(0.03, 0.1) * rng.standard_normal((SIDE_PX, SIDE_PX))
        + 0.04 * clouds(rng, 12)
    )
    if rng.random() < 0.3:
        picture -= 0.15 * (
            np.sin(np.arange(SIDE_PX) * 2 * np.pi * int(rng.integers(4, 20)) / SIDE_PX) > 0.6
        )
    return np.asarray(picture)


def _concrete(rng: np.random.Generator) -> Grey:
    picture = (
        0.85
        + 0.05 * clouds(rng, 5)
        + 0.03 * clouds(rng, 21)
        + 0.02 * rng.standard_normal((SIDE_PX, SIDE_PX))
    )
    for _ in range(int(rng.integers(0, 3))):
        run = np.cumsum(rng.normal(0, 6, (14, 2)) + rng.normal(0, 12, 2), axis=0) + rng.uniform(
            0, SIDE_PX, 2
        )
        cv2.polylines(picture, [run.astype(np.int32)], False, 0.55, 1)
    return picture


def _terrazzo(rng: np.random.Generator) -> Grey:
    picture = np.full((SIDE_PX, SIDE_PX, 3), 0.86)
    for _ in range(int(rng.integers(150, 500))):
        middle = tuple(int(v) for v in rng.integers(0, SIDE_PX, 2))
        axes = tuple(int(v) for v in rng.integers(1, 5, 2))
        tone = rng.uniform(0.4, 1.0) + rng.uniform(-0.08, 0.08, 3)
        cv2.ellipse(picture, middle, axes, rng.uniform(0, 180), 0, 360, tone.tolist(), -1)
    return picture


def _grass(rng: np.random.Generator) -> Grey:
    picture = 0.7 + 0.16 * clouds(rng, 7) + 0.14 * rng.standard_normal((SIDE_PX, SIDE_PX))
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.8) + 0.1 * clouds(rng, 80))


def _plain(rng: np.random.Generator) -> Grey:
    return 0.96 + 0.02 * clouds(rng, 6)


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
    """A random pattern of a floor or of the ground."""
    kinds = OUTDOOR if outdoor else INDOOR
    grey = kinds[rng.integers(len(kinds))](rng)
    levels = np.clip(255 * grey, 0, 255).astype(np.uint8)
    return levels if levels.ndim == 3 else np.repeat(levels[:, :, None], 3, axis=2)
