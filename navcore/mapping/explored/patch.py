"""Patches: explored cells of a part of a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navcore.compiled import compiled
from navcore.geometry.arrays import Floats, Indices, Words
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import ONE, PAD, BitPlanes, cells_of, empty_plane
from navcore.grid.grid import Box, GridSpec
from navcore.grid.growth import Growth
from navcore.mapping.explored.raycast import BLOCK

MEASURED, VISIBLE, DRIVEN, FLOOR = range(4)
"""Planes of explored cells: a surface was measured; a line of sight passed; the robot stood there;
the floor was measured since a prior map was loaded."""
PLANES = 4
WORD = 64
"""Columns of a word; the left border of a patch is a multiple of it, the lower one of `BLOCK`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Patch:
    """Explored cells of a part of a grid; the part may reach beyond the grid."""

    top: int
    """First row, a multiple of `BLOCK`."""
    left: int
    """First column, a multiple of `WORD`."""
    planes: BitPlanes
    """(`PLANES`, rows, words) cells, without padding."""
    volume: Words
    """(rows / 4, 16 · words) blocks, one bit for each height bin."""

    @property
    def box(self) -> Box:
        """Part of the grid that the patch covers."""
        _, rows, words = self.planes.shape
        return self.top, self.left, self.top + rows, self.left + WORD * words

    def covering(self, box: Box) -> Patch:
        """Return this patch, or a copy of it that is large enough for `box`."""
        held = self.box
        if held[0] <= box[0] and held[1] <= box[1] and held[2] >= box[2] and held[3] >= box[3]:
            return self
        larger = empty_patch(
            (min(held[0], box[0]), min(held[1], box[1]), max(held[2], box[2]), max(held[3], box[3]))
        )
        larger.add(self)
        return larger

    def add(self, other: Patch) -> None:
        """Mark the cells of a patch within this one."""
        row, word = other.top - self.top, (other.left - self.left) // WORD
        _, rows, words = other.planes.shape
        self.planes[:, row : row + rows, word : word + words] |= other.planes
        row, col = row // BLOCK, word * (WORD // BLOCK)
        rows, cols = other.volume.shape
        self.volume[row : row + rows, col : col + cols] |= other.volume

    def mark_on(self, planes: BitPlanes, volume: Words) -> None:
        """Mark the cells on the padded planes and the volume of a grid that contains them."""
        _, rows, words = self.planes.shape
        line, word = self.top + PAD, self.left // WORD + 1
        planes[:, line : line + rows, word : word + words] |= self.planes
        row, col = self.top // BLOCK, self.left // BLOCK
        part = volume[row : row + self.volume.shape[0], col : col + self.volume.shape[1]]
        part |= self.volume[: part.shape[0], : part.shape[1]]

    def cells(self, plane: int, cols: int) -> Indices:
        """Return the (N,) cells of a plane, row · cols + col of a grid with `cols` columns."""
        corner = np.array([PAD + self.top, PAD + self.left])
        cells = cells_of(self.planes[plane]) + corner
        return np.asarray(cells[:, 0] * cols + cells[:, 1])

    def sampled(self, motion: Pose2, spec: GridSpec, limits: Box) -> Patch:
        """Return the patch moved by a rigid `motion` of the map frame, and cut at `limits`."""
        top, left, bottom, right = self.box
        corners = np.array([[left, top], [left, bottom], [right, top], [right, bottom]])
        origin = np.array([spec.origin_x_m, spec.origin_y_m])
        moved = (motion.to_parent(corners * spec.resolution_m + origin) - origin) / (
            spec.resolution_m
        )
        (low_x, low_y), (high_x, high_y) = np.floor(moved.min(axis=0)), np.ceil(moved.max(axis=0))
        box = (
            max(int(low_y), limits[0]),
            max(int(low_x), limits[1]),
            min(int(high_y), limits[2]),
            min(int(high_x), limits[3]),
        )
        target = empty_patch(box)
        back = motion.inverse()
        cos, sin = math.cos(back.yaw_rad), math.sin(back.yaw_rad)
        x, y = (back.to_parent(origin) - origin) / spec.resolution_m
        steps = np.array([cos, sin, x, y])
        if target.planes.size:
            _sample_cells(
                self.planes, self.top, self.left, target.planes, target.top, target.left, box, steps
            )
            steps[2:] /= BLOCK
            blocks = (box[0] // BLOCK, box[1] // BLOCK, -(-box[2] // BLOCK), -(-box[3] // BLOCK))
            _sample_blocks(
                self.volume,
                self.top // BLOCK,
                self.left // BLOCK,
                target.volume,
                target.top // BLOCK,
                target.left // BLOCK,
                blocks,
                steps,
            )
        return target


def empty_patch(box: Box) -> Patch:
    """Return a patch without cells that covers a box; its borders are rounded outwards."""
    top, left = box[0] // BLOCK * BLOCK, box[1] // WORD * WORD
    rows = max(-(-(box[2] - top) // BLOCK) * BLOCK, 0)
    words = max(-(-(box[3] - left) // WORD), 0)
    return Patch(
        top=top,
        left=left,
        planes=np.zeros((PLANES, rows, words), dtype=np.uint64),
        volume=np.zeros((rows // BLOCK, words * (WORD // BLOCK)), dtype=np.uint64),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explored:
    """Explored cells of a whole grid."""

    spec: GridSpec
    """The grid."""
    planes: BitPlanes
    """(`PLANES`, lines, words) padded planes of cells."""
    volume: Words
    """(⌈rows / 4⌉, ⌈cols / 4⌉) blocks, one bit for each height bin in which a surface was measured
    or through which a line of sight passed."""

    @staticmethod
    def empty(spec: GridSpec) -> Explored:
        """Return no cells."""
        # Pages that are never written to cost no memory.
        plane = empty_plane(spec.rows, spec.cols)
        return Explored(
            spec=spec,
            planes=np.zeros((PLANES, *plane.shape), dtype=np.uint64),
            volume=np.zeros((-(-spec.rows // BLOCK), -(-spec.cols // BLOCK)), dtype=np.uint64),
        )

    def copied(self) -> Explored:
        """Return a copy."""
        return Explored(spec=self.spec, planes=self.planes.copy(), volume=self.volume.copy())

    def part(self, box: Box) -> Patch:
        """Return the present cells of a part of the grid, with the borders of a patch."""
        top, left, bottom, right = box
        rows, words = slice(PAD + top, PAD + bottom), slice(1 + left // WORD, 1 + right // WORD)
        blocks = slice(top // BLOCK, bottom // BLOCK), slice(left // BLOCK, right // BLOCK)
        planes, volume = self.planes[:, rows, words].copy(), self.volume[blocks].copy()
        return Patch(top=top, left=left, planes=planes, volume=volume)

    def grown(self, growth: Growth) -> Explored:
        """Return the cells on a larger grid."""
        grown = Explored.empty(growth.new)
        for plane in range(PLANES):
            grown.planes[plane] = growth.plane(self.planes[plane])
        grown.volume[:] = grown_volume(self.volume, growth)
        return grown


def grown_volume(volume: Words, growth: Growth) -> Words:
    """Return (⌈rows / 4⌉, ⌈cols / 4⌉) blocks of the old grid as those of the new one."""
    grown: Words = np.zeros(
        (-(-growth.new.rows // BLOCK), -(-growth.new.cols // BLOCK)), dtype=np.uint64
    )
    top, left = growth.rows // BLOCK, growth.cols // BLOCK
    grown[top : top + volume.shape[0], left : left + volume.shape[1]] = volume
    return grown


@compiled
def _sample_cells(
    source: BitPlanes,
    source_top: int,
    source_left: int,
    target: BitPlanes,
    top: int,
    left: int,
    box: Box,
    steps: Floats,
) -> None:
    """Set the cells of the target within `box` whose centre lies in a set cell of the source.

    `steps`: cosine and sine of the rotation from target to source, and the shift in cells.
    """
    cos, sin, x0, y0 = steps[0], steps[1], steps[2], steps[3]
    rows, cols = source.shape[1], WORD * source.shape[2]
    union = source[0] | source[1] | source[2] | source[3]  # most cells are in no plane
    for row in range(box[0], box[2]):
        y = row + 0.5
        for col in range(box[1], box[3]):
            x = col + 0.5
            i = math.floor(sin * x + cos * y + y0) - source_top
            j = math.floor(cos * x - sin * y + x0) - source_left
            if i < 0 or j < 0 or i >= rows or j >= cols:
                continue
            bit = np.uint64(j & 63)
            if union[i, j >> 6] >> bit & ONE == 0:
                continue
            to, at = (col - left) >> 6, np.uint64((col - left) & 63)
            for plane in range(PLANES):
                target[plane, row - top, to] |= (source[plane, i, j >> 6] >> bit & ONE) << at


@compiled
def _sample_blocks(
    source: Words,
    source_top: int,
    source_left: int,
    target: Words,
    top: int,
    left: int,
    box: Box,
    steps: Floats,
) -> None:
    """Set the blocks of the target within `box` to those of the source in which their centre
    lies."""
    cos, sin, x0, y0 = steps[0], steps[1], steps[2], steps[3]
    rows, cols = source.shape
    for row in range(box[0], box[2]):
        y = row + 0.5
        for col in range(box[1], box[3]):
            x = col + 0.5
            i = math.floor(sin * x + cos * y + y0) - source_top
            j = math.floor(cos * x - sin * y + x0) - source_left
            if i >= 0 and j >= 0 and i < rows and j < cols:
                target[row - top, col - left] |= source[i, j]
