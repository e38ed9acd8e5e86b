"""Submaps: the cells that were explored from each pose ID whose pose may be corrected, so that they
move with it.

A submap keeps its cells on the grid of the map as it lay when the pose ID was first seen, with the
pose at that time. At any other pose its cells are sampled from these: a cell of the map is explored
if its centre lies in an explored cell of the submap. So corrections to and fro lose nothing, and
without a correction the map has exactly the cells that were marked.
"""

from __future__ import annotations

import zlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mapping.explored.patch import FLOOR, PLANES, WORD, Explored, Patch, empty_patch
from navcore.mapping.explored.raycast import BLOCK

OPEN = 4
"""Number of submaps that are kept unpacked: those in use while the robot turns to and fro."""
_FASTEST = 1
"""Level of compression: a submap shrinks to a fifth in a fraction of a millisecond."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PackedSubmap:
    """Submap as a value: compressed and immutable."""

    pose: Pose2
    """T_map_base at which the cells lie where they are."""
    top: int
    """First row of the patch."""
    left: int
    """First column of the patch."""
    rows: int
    """Number of rows of the patch."""
    words: int
    """Number of words in a row of the patch."""
    data: bytes
    """Compressed planes and volume of the patch, in this order."""

    @property
    def size(self) -> int:
        """Number of bytes of the unpacked planes and volume."""
        words = PLANES * self.rows * self.words
        return 8 * (words + self.rows // BLOCK * self.words * (WORD // BLOCK))

    def patch(self) -> Patch:
        """Return the cells; raises `ValueError` for data of another size or damaged data."""
        unpacker = zlib.decompressobj()
        try:
            data = unpacker.decompress(self.data, self.size + 1)
        except zlib.error as error:
            raise ValueError(f"damaged submap: {error}") from None
        if len(data) != self.size or not unpacker.eof:
            raise ValueError(f"damaged submap: expected {self.size} bytes of cells")
        words = np.frombuffer(bytearray(data), dtype=np.uint64)
        split = PLANES * self.rows * self.words
        return Patch(
            top=self.top,
            left=self.left,
            planes=words[:split].reshape(PLANES, self.rows, self.words),
            volume=words[split:].reshape(self.rows // BLOCK, self.words * (WORD // BLOCK)),
        )


def packed(pose: Pose2, patch: Patch) -> PackedSubmap:
    """Return a submap with the cells of a patch."""
    _, rows, words = patch.planes.shape
    data = zlib.compress(patch.planes.tobytes() + patch.volume.tobytes(), _FASTEST)
    return PackedSubmap(
        pose=pose, top=patch.top, left=patch.left, rows=rows, words=words, data=data
    )


def placed(pose: Pose2, patch: Patch, now: Pose2, spec: GridSpec) -> Patch:
    """Return the cells of a submap on the grid when its pose is `now`."""
    grid = (0, 0, spec.rows, spec.cols)
    within = patch.top >= 0 and patch.left >= 0 and patch.box[2] <= -(-spec.rows // BLOCK) * BLOCK
    if now == pose and within and patch.box[3] <= -(-spec.cols // WORD) * WORD:
        return patch
    return patch.sampled(now @ pose.inverse(), spec, grid)


def shifted(submaps: Mapping[int, PackedSubmap], rows: int, cols: int) -> dict[int, PackedSubmap]:
    """Return submaps on a grid that has grown by rows before its first row and columns before its
    first column, both multiples of 64."""
    return {
        pose_id: replace(held, top=held.top + rows, left=held.left + cols)
        for pose_id, held in submaps.items()
    }


def mark_submaps(
    explored: Explored,
    submaps: Mapping[int, PackedSubmap],
    poses: Sequence[Pose2],
    spec: GridSpec,
) -> None:
    """Add the cells of submaps by pose ID, at the present poses of all IDs, to those of a grid."""
    for pose_id, submap in submaps.items():
        placed(submap.pose, submap.patch(), poses[pose_id], spec).mark_on(
            explored.planes, explored.volume
        )


def reaching_beyond(
    part: GridSpec, submaps: Mapping[int, PackedSubmap], poses: Sequence[Pose2], spec: GridSpec
) -> dict[int, PackedSubmap]:
    """Return the submaps that may have cells beyond a part of the map at the present poses of all
    IDs: only a correction brings any there. `spec`: grid on which the submaps lie."""
    moved = {
        pose_id: held
        for pose_id, held in submaps.items()
        if held.pose is not poses[pose_id] and held.pose != poses[pose_id]
    }
    if not moved:
        return moved
    # All at once: a map may have some ten thousand of them, and is stored every few seconds.
    then, now = (
        np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in some])
        for some in ([held.pose for held in moved.values()], [poses[k] for k in moved])
    )
    boxes = np.array(
        [(held.left, held.top, WORD * held.words, held.rows) for held in moved.values()]
    )
    corners = boxes[:, None, :2] + boxes[:, None, 2:] * [(0, 0), (0, 1), (1, 0), (1, 1)]
    arms = corners * spec.resolution_m + (spec.origin_x_m, spec.origin_y_m) - then[:, None, :2]
    turn = now[:, 2:] - then[:, 2:]
    x = now[:, :1] + np.cos(turn) * arms[..., 0] - np.sin(turn) * arms[..., 1]
    y = now[:, 1:2] + np.sin(turn) * arms[..., 0] + np.cos(turn) * arms[..., 1]
    cols, rows = (
        (x - part.origin_x_m) / part.resolution_m,
        (y - part.origin_y_m) / part.resolution_m,
    )
    # One cell less on each side: two ways of rounding may differ by one.
    inside = (cols >= 1) & (cols <= part.cols - 1) & (rows >= 1) & (rows <= part.rows - 1)
    return {
        pose_id: held
        for (pose_id, held), is_within in zip(moved.items(), inside.all(axis=1), strict=True)
        if not is_within
    }


class Submaps:
    """Submap of each pose ID that may be corrected and from which anything was explored."""

    def __init__(self) -> None:
        self._packed: dict[int, PackedSubmap] = {}
        self._open: OrderedDict[int, tuple[Pose2, Patch]] = OrderedDict()
        self.touched: set[int] = set()
        """Pose IDs whose submaps have grown since the last `snapshot`."""

    def add(self, pose_id: int, now: Pose2, patch: Patch, spec: GridSpec) -> Patch:
        """Add the cells of a patch of the map's grid that were explored from a pose ID, whose pose
        is `now`; return the cells that the map has thereby.

        Those are the given ones, unless the pose was corrected since its submap was begun.
        """
        if not patch.planes.size:
            return patch
        self.touched.add(pose_id)
        pose, held = self._opened(pose_id, now, patch)
        if pose != now:
            unlimited = 2**30
            patch = patch.sampled(
                pose @ now.inverse(), spec, (-unlimited, -unlimited, unlimited, unlimited)
            )
        held = held.covering(patch.box)
        held.add(patch)
        self._open[pose_id] = (pose, held)
        return placed(pose, patch, now, spec)

    def placed(self, pose_id: int, now: Pose2, spec: GridSpec) -> Patch:
        """Return the cells explored from a pose ID on the grid when its pose is `now`."""
        pose, patch = self._opened(pose_id, now, None)
        return placed(pose, patch, now, spec)

    def snapshot(self) -> Mapping[int, PackedSubmap]:
        """Return the `values`, and begin to note what is touched after them."""
        self.touched.clear()
        return self.values()

    def values(self) -> Mapping[int, PackedSubmap]:
        """Return all submaps as values by pose ID, in the order of the IDs."""
        for pose_id, (pose, patch) in self._open.items():
            self._packed[pose_id] = packed(pose, patch)
        return dict(sorted(self._packed.items()))

    def restore(self, submaps: Mapping[int, PackedSubmap]) -> None:
        """Replace all submaps by those of a snapshot."""
        self._packed = dict(submaps)
        self._open.clear()
        self.touched.clear()

    def shift(self, rows: int, cols: int) -> None:
        """Follow a grid that has grown by rows before its first row and columns before its first
        column, both multiples of 64."""
        self.restore(shifted(self.values(), rows, cols))

    def forget_floor(self) -> None:
        """Remove the cells in which the floor was measured."""
        for pose_id, held in self.values().items():
            patch = held.patch()
            if patch.planes[FLOOR].any():
                patch.planes[FLOOR] = 0
                self._packed[pose_id] = packed(held.pose, patch)
        self.restore(self._packed)

    @property
    def bytes_used(self) -> int:
        """Memory of the submaps in bytes."""
        closed = sum(
            len(held.data) for pose_id, held in self._packed.items() if pose_id not in self._open
        )
        return closed + sum(
            patch.planes.nbytes + patch.volume.nbytes for _, patch in self._open.values()
        )

    def _opened(self, pose_id: int, now: Pose2, like: Patch | None) -> tuple[Pose2, Patch]:
        if pose_id in self._open:
            self._open.move_to_end(pose_id)
            return self._open[pose_id]
        if pose_id in self._packed:
            held = self._packed[pose_id]
            self._open[pose_id] = (held.pose, held.patch())
        else:
            self._open[pose_id] = (now, empty_patch(like.box if like else (0, 0, 0, 0)))
        if len(self._open) > OPEN:
            oldest, (pose, patch) = self._open.popitem(last=False)
            self._packed[oldest] = packed(pose, patch)
        return self._open[pose_id]
