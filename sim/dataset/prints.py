"""Pictures of things as prints show them: each thing rendered on a floor of one colour."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from navcore.geometry.arrays import Bools
from sim.dataset import palette
from sim.models.items import ITEM_SIZES, item_shapes, item_solids
from sim.models.person import PERSON, Appearance, person_solids
from sim.models.solids import Solid
from sim.models.textures import PRINT_PX, Texture
from sim.sensors.stereo_noise import Rgb

PRINT_KINDS = (*ITEM_SIZES, PERSON)
"""What the rendered prints show, in the order of their numbers."""
PRINT_MARGIN = 0.12
"""Margin of a rendered print on each side of what it shows, relative to the length of that."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RenderedPrint:
    """A picture of one thing."""

    number: int
    """Number among the prints of the renderer."""
    image: Texture
    """(H, W, 3) colours; the first row is the upper edge."""
    outline: Bools
    """(H, W) pixels of the thing; the others show the floor around it."""


def thing_solids(rng: np.random.Generator, kind: str) -> tuple[Solid, ...]:
    """Return a thing of one of the `PRINT_KINDS` in its default size, in a random shape and random
    colours."""
    if kind == PERSON:
        return person_solids(
            0.1,
            Appearance(
                shirt=palette.any_colour(rng),
                trousers=palette.any_colour(rng),
                hair=palette.hair(rng),
            ),
        )
    return item_solids(
        kind, ITEM_SIZES[kind], palette.item(rng, kind), str(rng.choice(item_shapes(kind)))
    )


def cropped(rgb: Rgb, shown: Bools) -> tuple[Texture, Bools]:
    """Return the square around these pixels with a margin and a white frame, and the pixels of the
    square among them."""
    rows, columns = np.nonzero(shown)
    if len(rows) == 0:
        blank = np.full((PRINT_PX, PRINT_PX, 3), 240, dtype=np.uint8)
        return blank, np.zeros((PRINT_PX, PRINT_PX), dtype=np.bool_)
    half = round((0.5 + PRINT_MARGIN) * max(np.ptp(rows), np.ptp(columns)) + 3)
    row, column = (
        (int(rows.min()) + int(rows.max())) // 2,
        (int(columns.min()) + int(columns.max())) // 2,
    )
    window = (slice(row, row + 2 * half), slice(column, column + 2 * half))
    square = np.pad(rgb, ((half, half), (half, half), (0, 0)), mode="edge")[window]
    inside = np.pad(shown, half)[window].astype(np.uint8)
    size = (PRINT_PX, PRINT_PX)
    image = cv2.resize(square, size, interpolation=cv2.INTER_LINEAR)
    framed = cv2.rectangle(image, (0, 0), (PRINT_PX - 1, PRINT_PX - 1), (245, 245, 240), 5)
    outline = cv2.resize(inside, size, interpolation=cv2.INTER_NEAREST) > 0
    return np.asarray(framed, dtype=np.uint8), np.asarray(outline)
