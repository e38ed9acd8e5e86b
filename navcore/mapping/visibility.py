"""What is known of the space, besides what stands in it: measured, looked over, stood on. All else
is unknown."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.perception import ObservationConfig
from navcore.grid.bitplane import ONE, PAD, BitPlane, empty_plane
from navcore.grid.cell_mask import CellMask, window
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.raycast import BLOCK, look
from navcore.mapping.voxels import BIN_M
from navcore.robot.frame import Frame

Bits = npt.NDArray[np.uint64]
Indices = npt.NDArray[np.int64]


class VisibilityMap:
    """Only grows. One bit for each cell, and for each block of 4 × 4 cells one for each 5 cm of
    height."""

    def __init__(self, spec: GridSpec) -> None:
        self.spec = spec
        self.measured, self.looked, self.driven = (
            empty_plane(spec.rows, spec.cols) for _ in range(3)
        )
        """Planes of the cells in which anything was measured, over which a line of sight passed, on
        which the robot stood."""
        self.volume: Bits = np.zeros(
            (-(-spec.rows // BLOCK), -(-spec.cols // BLOCK)), dtype=np.uint64
        )
        """(⌈rows / 4⌉, ⌈cols / 4⌉) a bit for each height bin in which anything was measured or
        through which one looked."""

    def note(self, cells: Indices, heights: Bits) -> None:
        """Note in which (N,) cells, row · cols + col, anything was measured, and (N,) the height
        bins, a bit for each."""
        _note(cells, heights, self.spec.cols, self.measured, self.volume)

    def was_measured(self, cells: Indices) -> npt.NDArray[np.bool_]:
        """(N,) whether anything was ever measured in cells, row · cols + col."""
        rows, cols = np.divmod(cells.astype(np.int64), self.spec.cols)
        words = self.measured[rows + PAD, (cols + PAD) >> 6]
        return np.asarray(words >> (cols & 63).astype(np.uint64) & ONE).astype(np.bool_)

    def look(self, frame: Frame, rules: ObservationConfig) -> None:
        """Note which space lies open between the camera and what it measured; for pictures and the
        explored area."""
        look(
            frame,
            self.spec,
            max_range_m=rules.max_range_m,
            ceiling_m=rules.ceiling_m,
            looked=self.looked,
            volume=self.volume,
        )

    @property
    def seen(self) -> CellMask:
        """Snapshot of the cells into which the camera has looked: measured there, or over them at
        something beyond."""
        return CellMask(self.measured | self.looked, self.spec.rows, self.spec.cols)

    def known(self, part: GridSpec) -> BoolGrid:
        """(rows, cols) of a part of the grid that the camera measured or the robot stood on:
        nothing unseen hides there."""
        top, left = self.spec.cell(
            part.origin_x_m + part.resolution_m / 2, part.origin_y_m + part.resolution_m / 2
        )
        bottom, right = top + part.rows, left + part.cols
        over, beside = max(top - 2, 0), max(left - 2, 0)
        around = (over, beside, min(bottom + 2, self.spec.rows), min(right + 2, self.spec.cols))
        if part.rows == 0 or part.cols == 0:
            return np.zeros((part.rows, part.cols), dtype=np.bool_)
        known = (window(self.measured, *around) | window(self.driven, *around)).view(np.uint8)
        # A pixel that measured nothing, or a gap between two rows of pixels, is no unseen place:
        # single cells are closed.
        closed = cv2.morphologyEx(known, cv2.MORPH_CLOSE, np.ones((3, 3), dtype=np.uint8))
        return closed[top - over :, left - beside :][: part.rows, : part.cols].view(np.bool_)

    def mark_driven(self, outline: npt.NDArray[np.float64]) -> None:
        """Note that the robot stands on, or is known to stand clear within, a convex outline (N, 2)
        of the map frame."""
        spec = self.spec
        cells = (outline - np.array([spec.origin_x_m, spec.origin_y_m])) / spec.resolution_m
        (left, top), (right, bottom) = (
            np.floor(cells.min(axis=0)).astype(int),
            np.ceil(cells.max(axis=0)).astype(int) + 1,
        )
        left, top = max(left, 0), max(top, 0)
        right, bottom = min(right, spec.cols), min(bottom, spec.rows)
        if left >= right or top >= bottom:
            return
        canvas = np.zeros((bottom - top, right - left), dtype=np.uint8)
        corners = np.round((cells - (left + 0.5, top + 0.5)) * 256).astype(np.int32)
        cv2.fillConvexPoly(canvas, corners, 1, shift=8)
        _set_cells(self.driven, np.argwhere(canvas) + np.array([top, left]))

    @property
    def area_m2(self) -> float:
        """Area of the cells looked into."""
        return int(np.bitwise_count(self.measured | self.looked).sum()) * self.spec.resolution_m**2

    @property
    def volume_m3(self) -> float:
        """Volume of the blocks of 4 cells × 4 cells × 5 cm that a line of sight passed through or
        ended in."""
        return (
            int(np.bitwise_count(self.volume).sum()) * (BLOCK * self.spec.resolution_m) ** 2 * BIN_M
        )


@compiled
def _note(cells: Indices, heights: Bits, cols: int, measured: BitPlane, volume: Bits) -> None:
    for index in range(len(cells)):
        row, col = cells[index] // cols, cells[index] % cols
        measured[row + PAD, (col + PAD) >> 6] |= ONE << np.uint64(col & 63)
        volume[row // BLOCK, col // BLOCK] |= heights[index]


@compiled
def _set_cells(plane: BitPlane, cells: Indices) -> None:
    for index in range(len(cells)):
        row, col = cells[index, 0], cells[index, 1]
        plane[row + PAD, (col + PAD) >> 6] |= ONE << np.uint64(col & 63)
