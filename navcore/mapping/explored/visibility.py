"""Visibility map: the cells that were measured, seen across or driven on; all others are
unknown."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.config.mapping import RaycastConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.arrays import Indices, Words
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import ONE, PAD, BitPlane, BitPlanes
from navcore.grid.cell_mask import CellMask, window
from navcore.grid.grid import BoolGrid, Box, Cell, GridSpec
from navcore.grid.growth import Growth, joined
from navcore.mapping.explored.patch import (
    DRIVEN,
    FLOOR,
    MEASURED,
    VISIBLE,
    Explored,
    Patch,
    empty_patch,
)
from navcore.mapping.explored.raycast import BLOCK, cast_rays
from navcore.mapping.explored.submap import (
    PackedSubmap,
    Submaps,
    mark_submaps,
    placed,
    reaching_beyond,
)
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mapping.views.voxels import BIN_M, frustum_box
from navcore.robot.frame import Frame


class VisibilityMap:
    """Known cells, one bit each, and known volume, one bit for each block of 4 × 4 cells × 5 cm.

    Known space never becomes unknown again; it moves with the poses from which it was explored.
    What was explored from a frozen pose never moves: its memory is that of the grid, whatever the
    number of poses.
    """

    def __init__(self, spec: GridSpec, density: RaycastConfig, pose_ids: PoseIds) -> None:
        self.spec = spec
        self._density, self._pose_ids = density, pose_ids
        self.base = Explored.empty(spec)
        """Known space that belongs to no pose ID or to frozen ones, and never moves."""
        self.live = Explored.empty(spec)
        """Known space: the base, and the submap of each pose ID at its present pose."""
        self.submaps = Submaps()
        """Known space by pose ID; of frozen ones only what may lie beyond the grid."""
        self._touched: Box | None = None  # part in which the base has grown since the snapshot

    def mark_measured(
        self, cells: Indices, heights: Words, box: Box, pose_id: int, floor_bins: np.uint64
    ) -> Patch:
        """Mark the (N,) cells of a part of the grid, row · cols + col, in which a surface was
        measured from a pose ID; return the cells that the map has thereby.

        `heights`: (N,) one bit for each measured height bin. `floor_bins`: the bins of the floor;
        0 if it does not matter whether the floor was measured.
        """
        patch = empty_patch(box)
        corner = (patch.top, patch.left)
        _mark_measured(
            cells, heights, self.spec.cols, corner, floor_bins, patch.planes, patch.volume
        )
        return self._mark(pose_id, patch)

    def was_measured(self, cells: Indices) -> npt.NDArray[np.bool_]:
        """Return (N,) whether a surface was ever measured in cells, row · cols + col."""
        return self._bits(self.measured, cells)

    def has_floor(self, cells: Indices) -> npt.NDArray[np.bool_]:
        """Return (N,) whether the floor of cells, row · cols + col, was measured since a prior map
        was loaded."""
        return self._bits(self.live.planes[FLOOR], cells)

    def _bits(self, plane: BitPlane, cells: Indices) -> npt.NDArray[np.bool_]:
        rows, cols = np.divmod(cells.astype(np.int64), self.spec.cols)
        words = plane[rows + PAD, (cols + PAD) >> 6]
        return np.asarray(words >> (cols & 63).astype(np.uint64) & ONE).astype(np.bool_)

    def integrate_rays(self, frame: Frame, rules: ObservationConfig) -> None:
        """Mark the space between the camera and the surfaces it measured; used for images of the
        map and the explored area."""
        top, left, bottom, right = frustum_box(frame, self.spec, rules.max_range_m)
        if top >= bottom or left >= right:
            return
        # One more cell on each side: two ways of rounding may differ by one.
        patch = empty_patch((max(top - 1, 0), max(left - 1, 0), bottom + 1, right + 1))
        cast_rays(
            frame,
            self.spec,
            rules,
            self._density,
            corner=(patch.top, patch.left),
            visible=patch.planes[VISIBLE],
            volume=patch.volume,
        )
        self._mark(self._pose_ids.id_of(frame.pose), patch)

    def grow(self, growth: Growth) -> None:
        """Continue on a larger grid; the added cells are unknown unless they were explored from
        poses that were corrected since."""
        self.spec = growth.new
        self.base, self.live = self.base.grown(growth), self.live.grown(growth)
        self.submaps.shift(growth.rows, growth.cols)
        # What lies on the old grid is there already, and unpacking all of them takes long.
        submaps, poses = self.submaps.values(), self._pose_ids.poses
        returning = reaching_beyond(growth.old, submaps, poses, self.spec)
        mark_submaps(self.live, returning, poses, self.spec)

    def snapshot(self) -> tuple[Explored, Mapping[int, PackedSubmap]]:
        """Return a copy of the base, and the submaps as values; what is explored afterwards is
        noted for `replace`."""
        self._touched = None
        return self.base.copied(), self.submaps.snapshot()

    def beyond(self) -> dict[int, PackedSubmap]:
        """Return the submaps that may have cells beyond the grid."""
        return reaching_beyond(self.spec, self.submaps.values(), self._pose_ids.poses, self.spec)

    @property
    def seen(self) -> CellMask:
        """Snapshot of the cells that were measured or seen across."""
        return CellMask(self.measured | self.visible, self.spec.rows, self.spec.cols)

    @property
    def floor(self) -> CellMask:
        """Snapshot of the cells that were measured, seen across or driven on."""
        return _floor_of(self.live)

    def unseen_on(self, spec: GridSpec) -> BoolGrid:
        """Return (rows, cols) of a grid aligned to this one, True for the cells that were neither
        measured, seen across nor driven on; cells beyond this map are unseen. Any thread may call
        it."""
        live = self.live  # read once: another thread may be growing the grid
        own, resolution_m, floor = live.spec, live.spec.resolution_m, _floor_of(live)
        top = round((spec.origin_y_m - own.origin_y_m) / resolution_m)
        left = round((spec.origin_x_m - own.origin_x_m) / resolution_m)
        low, high = max(top, 0), min(top + spec.rows, floor.rows)
        near, far = max(left, 0), min(left + spec.cols, floor.cols)
        unseen = np.ones((spec.rows, spec.cols), dtype=np.bool_)
        if low < high and near < far:
            unseen[low - top : high - top, near - left : far - left] = ~floor.window(
                low, near, high, far
            )
        return unseen

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

    def mark_driven(self, outline: npt.NDArray[np.float64], pose: Pose2) -> None:
        """Mark the cells of a convex outline, (N, 2) metres of the map frame, that the robot stands
        on or has as free space around it at a pose."""
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
        patch = empty_patch((top, left, bottom, right))
        corner = np.array([top - patch.top, left - patch.left])
        _set_cells(patch.planes[DRIVEN], np.argwhere(canvas) + corner)
        self._mark(self._pose_ids.id_of(pose), patch)

    def restore(
        self,
        spec: GridSpec,
        base: tuple[CellMask, CellMask, CellMask],
        volume: Words,
        submaps: Mapping[int, PackedSubmap],
    ) -> None:
        """Replace the known space, with frozen poses; `base` are cells of `spec` that were
        measured, visible and driven on."""
        self.spec, poses = spec, self._pose_ids.poses
        self.base = Explored.empty(spec)
        for plane, mask in zip((MEASURED, VISIBLE, DRIVEN), base, strict=True):
            self.base.planes[plane] = mask.plane
        self.base.volume[:] = volume
        mark_submaps(self.base, submaps, poses, spec)
        self.base.planes[FLOOR] = 0  # it has disproved the prior map before that was stored
        self.live = self.base.copied()
        self.submaps.restore(reaching_beyond(spec, submaps, poses, spec))

    def forget_floor(self) -> None:
        """Forget where the floor was measured."""
        self.live.planes[FLOOR] = self.base.planes[FLOOR] = 0
        self.submaps.forget_floor()

    def restore_floor(self, floor: BitPlane) -> None:
        """Take the cells of a plane, whose poses are frozen, for those whose floor was measured."""
        self.live.planes[FLOOR] = self.base.planes[FLOOR] = floor

    def replace(self, live: Explored) -> Indices:
        """Set the known space to one computed from the newest snapshot and what was explored since;
        return the (N,) cells, row · cols + col, of floor measured since, and maybe before."""
        patches = [
            self.submaps.placed(pose_id, self._pose_ids[pose_id], self.spec)
            for pose_id in sorted(self.submaps.touched)
        ]
        if self._touched is not None:
            patches.append(self.base.part(self._touched))
        for patch in patches:
            patch.mark_on(live.planes, live.volume)
        self.live = live
        floor = [patch.cells(FLOOR, self.spec.cols) for patch in patches]
        return np.concatenate([np.empty(0, dtype=np.int64), *floor])

    @property
    def measured(self) -> BitPlane:
        """Live plane of the cells in which a surface was measured."""
        plane: BitPlane = self.live.planes[MEASURED]
        return plane

    @property
    def visible(self) -> BitPlane:
        """Live plane of the cells over which a line of sight passed."""
        plane: BitPlane = self.live.planes[VISIBLE]
        return plane

    @property
    def driven(self) -> BitPlane:
        """Live plane of the cells that the robot drove on."""
        plane: BitPlane = self.live.planes[DRIVEN]
        return plane

    @property
    def area_m2(self) -> float:
        """Area in square metres of the cells that were measured or seen across."""
        return int(np.bitwise_count(self.measured | self.visible).sum()) * self.spec.resolution_m**2

    @property
    def volume_m3(self) -> float:
        """Volume in cubic metres of the blocks of 4 × 4 cells × 5 cm that a line of sight passed
        through or ended in."""
        return (
            int(np.bitwise_count(self.live.volume).sum())
            * (BLOCK * self.spec.resolution_m) ** 2
            * BIN_M
        )

    def _mark(self, pose_id: int, patch: Patch) -> Patch:
        """Add cells explored from a pose ID to its submap, or to the base where the pose is frozen,
        and to the map; return the latter."""
        now = self._pose_ids[pose_id]
        if pose_id >= self._pose_ids.frozen:
            marked = self.submaps.add(pose_id, now, patch, self.spec)
        elif (marked := placed(now, patch, now, self.spec)).planes.size:
            marked.mark_on(self.base.planes, self.base.volume)
            self._touched = joined([marked.box, self._touched or marked.box])
        marked.mark_on(self.live.planes, self.live.volume)
        return marked


def _floor_of(explored: Explored) -> CellMask:
    plane = explored.planes[MEASURED] | explored.planes[VISIBLE] | explored.planes[DRIVEN]
    return CellMask(plane, explored.spec.rows, explored.spec.cols)


@compiled
def _mark_measured(
    cells: Indices,
    heights: Words,
    cols: int,
    corner: Cell,
    floor_bins: np.uint64,
    planes: BitPlanes,
    volume: Words,
) -> None:
    for index in range(len(cells)):
        row, col = cells[index] // cols - corner[0], cells[index] % cols - corner[1]
        bit = ONE << np.uint64(col & 63)
        planes[MEASURED, row, col >> 6] |= bit
        if heights[index] & floor_bins != 0:
            planes[FLOOR, row, col >> 6] |= bit
        volume[row // BLOCK, col // BLOCK] |= heights[index]


@compiled
def _set_cells(plane: BitPlane, cells: Indices) -> None:
    for index in range(len(cells)):
        row, col = cells[index, 0], cells[index, 1]
        plane[row, col >> 6] |= ONE << np.uint64(col & 63)
