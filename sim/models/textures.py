"""Textures of posters, spills and worn paint."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from sim.models.item_shapes import shade
from sim.models.items import ITEM_COLOURS
from sim.models.solids import Colour

Texture = npt.NDArray[np.uint8]
"""(H, W, 3) red, green, blue; the first row lies farthest along y."""

PRINT_PX = 128
"""Side of the texture of a print."""
SPILL_PX = 128
"""Side of the texture of a spill."""
SPILL_SIDE_M = 2.0
"""Length after which the gloss of a spill repeats."""
MODULE_PX = 24
"""Side of a square of a tag in its texture."""
PLATE_SHARE = 10 / 8
"""Side of the plate of a tag, relative to its black square of 8 modules: one white module around.
"""
GLOSS = {"water": 0.5, "mud": 0.12, "chemical": 0.4}
"""Strength of the highlights of each kind of spill, 0 to 1."""


def print_texture(shows: str) -> Texture:
    """Return a drawing of one kind of item on white paper with a frame."""
    sheet = np.full((PRINT_PX, PRINT_PX, 3), (244, 242, 236), dtype=np.uint8)
    cv2.rectangle(sheet, (3, 3), (PRINT_PX - 4, PRINT_PX - 4), (120, 116, 110), 2)
    _DRAWINGS[shows](sheet, ITEM_COLOURS[shows])
    return sheet


def tag_texture(number: int) -> Texture:
    """Return an AprilTag of the family 36h11 with its white border."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    square = cv2.aruco.generateImageMarker(family, number, 8 * MODULE_PX)
    plate = np.pad(square, MODULE_PX, constant_values=255)
    return np.repeat(plate[:, :, None], 3, axis=2).astype(np.uint8)


def spill_texture(colour: Colour, gloss: float, seed: int) -> Texture:
    """Return blotches of a colour with soft highlights of strength `gloss`, 0 to 1, periodic at the
    edges."""
    rng = np.random.default_rng(seed)
    tone = 1.0 + 0.14 * smooth_noise(rng, 6)[:, :, None]
    light = np.clip(smooth_noise(rng, 9) - 1.0, 0.0, 1.0)[:, :, None]
    levels = np.array(colour) * tone
    return np.asarray(np.clip(levels + gloss * light * (255.0 - levels), 0, 255), dtype=np.uint8)


def worn_texture(seed: int) -> Texture:
    """Return the wear of paint, white where it is new, which multiplies its colour."""
    noise = smooth_noise(np.random.default_rng(seed), 6)[:, :, None]
    level = np.clip(240.0 + 12.0 * noise, 0, 255)
    return np.repeat(level, 3, axis=2).astype(np.uint8)


def smooth_noise(rng: np.random.Generator, cells: int) -> npt.NDArray[np.float64]:
    """Return (SPILL_PX, SPILL_PX) smooth noise of mean 0 and deviation 1, periodic at the edges."""
    nodes = np.tile(rng.standard_normal((cells, cells)), (3, 3))
    smooth = cv2.resize(nodes, (3 * SPILL_PX, 3 * SPILL_PX), interpolation=cv2.INTER_CUBIC)
    middle = smooth[SPILL_PX : 2 * SPILL_PX, SPILL_PX : 2 * SPILL_PX]
    return np.asarray((middle - middle.mean()) / middle.std())


def _draw_cup(sheet: Texture, colour: Colour) -> None:
    cv2.ellipse(sheet, (88, 64), (20, 18), 0, -90, 90, colour, 7)
    cv2.fillPoly(sheet, [np.array([(32, 34), (88, 34), (82, 100), (38, 100)])], colour)
    cv2.ellipse(sheet, (60, 34), (28, 8), 0, 0, 360, shade(colour, 0.5), -1)
    cv2.ellipse(sheet, (60, 100), (22, 6), 0, 0, 360, colour, -1)


def _draw_book(sheet: Texture, colour: Colour) -> None:
    cv2.fillPoly(sheet, [np.array([(26, 78), (74, 42), (108, 66), (60, 104)])], colour)
    cv2.fillPoly(sheet, [np.array([(60, 104), (108, 66), (108, 76), (60, 114)])], (226, 222, 210))
    cv2.fillPoly(sheet, [np.array([(26, 78), (60, 104), (60, 114), (26, 88)])], shade(colour, 0.7))
    cv2.line(sheet, (50, 76), (78, 56), (236, 230, 190), 4)


def _draw_bag(sheet: Texture, colour: Colour) -> None:
    cv2.ellipse(sheet, (64, 50), (22, 24), 0, 180, 360, shade(colour, 0.6), 6)
    cv2.rectangle(sheet, (28, 50), (100, 106), colour, -1)


def _draw_shoe(sheet: Texture, colour: Colour) -> None:
    cv2.fillPoly(
        sheet, [np.array([(22, 50), (50, 50), (72, 72), (104, 80), (108, 94), (22, 94)])], colour
    )
    cv2.rectangle(sheet, (20, 92), (110, 100), shade(colour, 0.5), -1)


def _draw_bottle(sheet: Texture, colour: Colour) -> None:
    cv2.fillPoly(
        sheet,
        [
            np.array(
                [(56, 14), (72, 14), (72, 38), (84, 54), (84, 112), (44, 112), (44, 54), (56, 38)]
            )
        ],
        colour,
    )
    cv2.rectangle(sheet, (44, 68), (84, 94), shade(colour, 1.6), -1)
    cv2.rectangle(sheet, (55, 12), (73, 20), shade(colour, 0.5), -1)


def _draw_cable(sheet: Texture, colour: Colour) -> None:
    x = np.linspace(18, 110, 60)
    points = np.column_stack([x, 64 + 30 * np.sin(x / 14)]).astype(np.int32)
    cv2.polylines(sheet, [points], False, colour, 4, cv2.LINE_AA)


def _draw_box(sheet: Texture, colour: Colour) -> None:
    cv2.fillPoly(sheet, [np.array([(22, 52), (64, 34), (106, 52), (64, 72)])], shade(colour, 1.15))
    cv2.fillPoly(sheet, [np.array([(22, 52), (64, 72), (64, 112), (22, 90)])], colour)
    cv2.fillPoly(sheet, [np.array([(64, 72), (106, 52), (106, 90), (64, 112)])], shade(colour, 0.8))
    cv2.line(sheet, (43, 43), (85, 62), (214, 192, 150), 5)


def _draw_keyboard(sheet: Texture, colour: Colour) -> None:
    cv2.rectangle(sheet, (12, 42), (116, 88), colour, -1)
    for row in range(4):
        for column in range(11):
            left, top = 16 + 9 * column, 46 + 10 * row
            cv2.rectangle(sheet, (left, top), (left + 6, top + 7), shade(colour, 1.7), -1)


def _draw_landmine(sheet: Texture, colour: Colour) -> None:
    cv2.ellipse(sheet, (64, 76), (46, 22), 0, 0, 360, shade(colour, 0.7), -1)
    cv2.ellipse(sheet, (64, 66), (46, 22), 0, 0, 360, colour, -1)
    cv2.ellipse(sheet, (64, 60), (22, 10), 0, 0, 360, shade(colour, 0.6), -1)


def _draw_sign(sheet: Texture, colour: Colour) -> None:
    cv2.fillPoly(sheet, [np.array([(48, 14), (80, 14), (98, 114), (30, 114)])], colour)
    cv2.fillPoly(sheet, [np.array([(64, 28), (80, 58), (48, 58)])], (30, 30, 30))
    for y in (72, 86):
        cv2.line(sheet, (46, y), (82, y), (30, 30, 30), 5)


_DRAWINGS = {
    "cup": _draw_cup,
    "book": _draw_book,
    "bag": _draw_bag,
    "shoe": _draw_shoe,
    "bottle": _draw_bottle,
    "cable": _draw_cable,
    "box": _draw_box,
    "keyboard": _draw_keyboard,
    "landmine": _draw_landmine,
    "wet-floor sign": _draw_sign,
}
