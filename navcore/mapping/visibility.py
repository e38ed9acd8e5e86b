"""Visibility map: the cells that were measured, seen across or driven on; all others are
unknown."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.mapping import RaycastConfig
from navcore.config.perception import ObservationConfig
from navcore.geometry.arrays import Indices, Words
from navcore.grid.bitplane import ONE, PAD, BitPlane, empty_plane
from navcore.grid.cell_mask import CellMask, window
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.raycast import BLOCK, cast_rays
from navcore.mapping.voxels import BIN_M
from navcore.robot.frame import Frame


class VisibilityMap:
    """Known cells, one bit each, and known volume, one bit for each block of 4 × 4 cells × 5 cm.

    Known space never becomes unknown again.
    """

    def __init__(self, spec: GridSpec, density: RaycastConfig) -> None:
        self.spec = spec
        self._density = density
        self.measured: BitPlane = empty_plane(spec.rows, spec.cols)
        """Plane of the cells in which a surface was measured."""
        self.visible: BitPlane = empty_plane(spec.rows, spec.cols)
        """Plane of the cells over which a line of sight passed."""
        self.driven: BitPlane = empty_plane(spec.rows, spec.cols)
        """Plane of the cells that the robot drove on."""
        self.volume: Words = np.zeros(
            (-(-spec.rows // BLOCK), -(-spec.cols // BLOCK)), dtype=np.uint64
        )
        """(⌈rows / 4⌉, ⌈cols / 4⌉) blocks, one bit for each height bin in which a surface was
        measured or through which a line of sight passed."""

    def mark_measured(self, cells: Indices, heights: Words) -> None:
        """Mark the (N,) cells, row · cols + col, in which a surface was measured.

        `heights`: (N,) one bit for each measured height bin.
        """
        _mark_measured(cells, heights, self.spec.cols, self.measured, self.volume)

    def was_measured(self, cells: Indices) -> npt.NDArray[np.bool_]:
        """Return (N,) whether a surface was ever measured in cells, row · cols + col."""
        rows, cols = np.divmod(cells.astype(np.int64), self.spec.cols)
        words = self.measured[rows + PAD, (cols + PAD) >> 6]
        return np.asarray(words >> (cols & 63).astype(np.uint64) & ONE).astype(np.bool_)

    def integrate_rays(self, frame: Frame, rules: ObservationConfig) -> None:
        """Mark the space between the camera and the surfaces it measured; used for images of the
        map and the explored area."""
        cast_rays(
            frame,
            self.spec,
            rules,
            self._density,
            visible=self.visible,
            volume=self.volume,
        )

    @property
    def seen(self) -> CellMask:
        """Snapshot of the cells that were measured or seen across."""
        return CellMask(self.measured | self.visible, self.spec.rows, self.spec.cols)

    def known(self, part: GridSpec) -> BoolGrid:
        """Return the (rows, cols) cells of a part of the grid that were measured or driven on:
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
        # A pixel without a measurement, or a gap between two rows of pixels, is no unknown space:
        # single cells are closed.
        closed = cv2.morphologyEx(known, cv2.MORPH_CLOSE, np.ones((3, 3), dtype=np.uint8))
        return closed[top - over :, left - beside :][: part.rows, : part.cols].view(np.bool_)

    def mark_driven(self, outline: npt.NDArray[np.float64]) -> None:
        """Mark the cells of a convex outline, (N, 2) metres of the map frame, that the robot stands
        on or has as free space around it."""
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
        """Area in square metres of the cells that were measured or seen across."""
        return int(np.bitwise_count(self.measured | self.visible).sum()) * self.spec.resolution_m**2

    @property
    def volume_m3(self) -> float:
        """Volume in cubic metres of the blocks of 4 × 4 cells × 5 cm that a line of sight passed
        through or ended in."""
        return (
            int(np.bitwise_count(self.volume).sum()) * (BLOCK * self.spec.resolution_m) ** 2 * BIN_M
        )


@compiled
def _mark_measured(
    cells: Indices, heights: Words, cols: int, measured: BitPlane, volume: Words
) -> None:
    for index in range(len(cells)):
        row, col = cells[index] // cols, cells[index] % cols
        measured[row + PAD, (col + PAD) >> 6] |= ONE << np.uint64(col & 63)
        volume[row // BLOCK, col // BLOCK] |= heights[index]


@compiled
def _set_cells(plane: BitPlane, cells: Indices) -> None:
    for index in range(len(cells)):
        row, col = cells[index, 0], cells[index, 1]
        plane[row + PAD, (col + PAD) >> 6] |= ONE << np.uint64(col & 63)
