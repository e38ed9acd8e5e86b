"""The scan map: the surfaces that the scans of all keyframes show, for matching.

Each keyframe keeps its scan in the frame of its pose, and the surfaces are sums over the points of
all scans. So whatever the poses were corrected to, the map is the one that the scans would have
made at their present poses.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from navcore.config.localisation.localisation import MatchConfig
from navcore.geometry.arrays import Floats, Indices, sorted_distinct
from navcore.geometry.transform import Matrix, Pose2
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.surface_grid import (
    ERRORS,
    FACING_X,
    FACING_Y,
    HITS,
    LINES,
    SECTORS,
    SUMS,
    TILE,
    WEIGHT,
    SurfaceGrid,
    X,
    Y,
    add_points,
    mean_error,
)

_DEFAULT = MatchConfig()
_UNSURE = 0.05
"""Weight of the direction to the camera, where a point has no normal, against a normal."""


class ScanMap:
    """Keyframes by pose ID, and their surfaces in cells.

    Memory: 104 bytes for each surface, 4 KB for each tile of 16 × 16 cells that holds one, and 40
    bytes for each point of a keyframe's scan. A pose ID has one scan at most, so the map is bounded
    by the world and not by the driving.
    """

    def __init__(self, config: MatchConfig = _DEFAULT) -> None:
        self._cell_m = config.cell_m
        self._keyframes: dict[int, Keyframe] = {}
        self.version = 0
        """Number that grows with every change."""
        self._clear()

    def _clear(self) -> None:
        self._origin = (0, 0)
        self._directory = np.full((0, 0), -1, dtype=np.int32)
        self._heads = np.full((64, TILE, TILE, SECTORS), -1, dtype=np.int32)
        self._sums = np.zeros((4096, SUMS))
        self._errors = np.zeros((4096, ERRORS))
        self._used = np.zeros(2, dtype=np.int64)

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """All keyframes, by pose ID."""
        held = dict(self._keyframes)  # another thread may put one meanwhile
        return tuple(held[pose_id] for pose_id in sorted(held))

    def keyframe(self, pose_id: int) -> Keyframe | None:
        """Return the keyframe of a pose ID, or None."""
        return self._keyframes.get(pose_id)

    def __len__(self) -> int:
        """Return the number of keyframes."""
        return len(self._keyframes)

    def __contains__(self, pose_id: int) -> bool:
        """Return whether a pose ID has a scan."""
        return pose_id in self._keyframes

    @property
    def grid(self) -> SurfaceGrid:
        """The surfaces for compiled kernels; valid until the next change."""
        return SurfaceGrid(
            self._cell_m, *self._origin, self._directory, self._heads, self._sums, self._errors
        )

    @property
    def surfaces(self) -> Floats:
        """(S, 6) surfaces: x, y in map metres, facing direction, number of points, and 1 where they
        form a line."""
        sums = self._sums[: self._used[1]]
        sums = sums[sums[:, HITS] > 0]
        facing = sums[:, [FACING_X, FACING_Y]]
        facing = facing / np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-12)
        return np.column_stack(
            [
                sums[:, X] / sums[:, WEIGHT],
                sums[:, Y] / sums[:, WEIGHT],
                facing,
                sums[:, HITS],
                4 * sums[:, LINES] >= sums[:, HITS],
            ]
        )

    @property
    def held(self) -> int:
        """Number of surfaces that take memory: those of scans that were removed are among them
        until all keyframes are replaced."""
        return int(self._used[1])

    def covariance_at(self, pose: Pose2, scan: Scan, radius_m: float) -> Matrix | None:
        """Return how uncertain the surfaces are that a scan shows at a T_map_base, within
        `radius_m` of its points: the (3, 3) covariance of x, y and yaw that a pose has which they
        give, besides that of the match; None where it shows none."""
        at = (pose.x_m, pose.y_m, pose.yaw_rad)
        errors, weight = mean_error(
            self.grid, at, scan.points_base, scan.normals, scan.variance_m2, scan.origin,
            radius_m, 1,
        )  # fmt: skip
        if weight == 0.0:
            return None
        xx, xy, yy, xt, yt, tt = errors
        about_origin = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
        carried = _carried(pose)
        return np.asarray(carried @ about_origin @ carried.T)

    def put(self, keyframe: Keyframe) -> None:
        """Set the scan of a pose ID, in place of the one it had."""
        self.remove(keyframe.pose_id)
        self._keyframes[keyframe.pose_id] = keyframe
        self._sum(keyframe, 1.0)

    def remove(self, pose_id: int) -> None:
        """Remove the scan of a pose ID, if it has one."""
        old = self._keyframes.pop(pose_id, None)
        if old is not None:
            self._sum(old, -1.0)

    def correct(self, poses: Mapping[int, Pose2]) -> None:
        """Move keyframes to corrected poses, by pose ID; IDs without a scan are ignored."""
        moved = [
            replace(old, T_map_base=pose)
            for pose_id, pose in poses.items()
            if (old := self._keyframes.get(pose_id)) is not None and old.T_map_base != pose
        ]
        if 2 * len(moved) < len(self._keyframes):
            for keyframe in moved:
                self.put(keyframe)
        elif moved:
            self.replace({**self._keyframes, **{k.pose_id: k for k in moved}}.values())

    def replace(self, keyframes: Iterable[Keyframe]) -> None:
        """Replace all keyframes."""
        self._keyframes = {keyframe.pose_id: keyframe for keyframe in keyframes}
        self.version += 1
        self._clear()
        for keyframe in self.keyframes:
            self._sum(keyframe, 1.0)

    def _sum(self, keyframe: Keyframe, sign: float) -> None:
        self.version += 1
        if len(keyframe.scan) == 0:
            return
        points, facings, lines = placed(keyframe.scan, keyframe.T_map_base)
        if sign > 0:
            self._reserve(points)
        add_points(
            self.grid, points, facings, lines, 1.0 / keyframe.scan.variance_m2,
            _about_origin(keyframe), self._used, sign,
        )  # fmt: skip

    def _reserve(self, points: Floats) -> None:
        """Make capacity for points, whatever cells they fall into."""
        tiles = np.floor(points[:, ::-1] / (self._cell_m * TILE)).astype(np.int64)
        low, high = tiles.min(axis=0), tiles.max(axis=0) + 1
        rows, cols = self._directory.shape
        if self._directory.size:
            old = np.array(self._origin)
            low, high = np.minimum(low, old), np.maximum(high, old + np.array([rows, cols]))
        if tuple(high - low) != (rows, cols):
            # A margin, so that the directory is not copied for each new tile.
            low, high = low - 4, high + 4
            larger = np.full(tuple(high - low), -1, dtype=np.int32)
            i, j = np.array(self._origin) - low if self._directory.size else (0, 0)
            larger[i : i + rows, j : j + cols] = self._directory
            self._directory, self._origin = larger, (int(low[0]), int(low[1]))
        new_tiles = len(sorted_distinct(tiles @ (self._directory.shape[1], 1)))
        while self._used[0] + new_tiles > len(self._heads):
            self._heads = np.concatenate([self._heads, np.full_like(self._heads, -1)])
        while self._used[1] + len(points) > len(self._sums):
            self._sums = np.concatenate([self._sums, np.zeros_like(self._sums)])
            self._errors = np.concatenate([self._errors, np.zeros_like(self._errors)])


def _carried(pose: Pose2) -> Matrix:
    """Return the (3, 3) matrix that takes an error of the whole map about its origin to the error
    of a pose: a turn moves what is far away."""
    return np.array([[1.0, 0.0, -pose.y_m], [0.0, 1.0, pose.x_m], [0.0, 0.0, 1.0]])


def _about_origin(keyframe: Keyframe) -> Floats:
    """Return the (ERRORS,) covariance of the error that moves a keyframe, about the map's
    origin."""
    back = np.linalg.inv(_carried(keyframe.T_map_base))
    covariance = back @ keyframe.covariance @ back.T
    return np.ascontiguousarray(covariance[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]])


def placed(scan: Scan, T_map_base: Pose2) -> tuple[Floats, Floats, Indices]:
    """Return (N, 2) points and facing directions of a scan in the map frame, and (N,) 1 where the
    direction is a normal; where there is none, the surface faces the camera."""
    lines = np.any(scan.normals != 0.0, axis=1)
    to_camera = scan.origin - scan.points_base
    to_camera = to_camera / np.maximum(np.linalg.norm(to_camera, axis=1, keepdims=True), 1e-9)
    facings = np.where(lines[:, None], scan.normals, _UNSURE * to_camera)
    turn = Pose2(x_m=0.0, y_m=0.0, yaw_rad=T_map_base.yaw_rad)
    return (
        np.ascontiguousarray(T_map_base.to_parent(scan.points_base)),
        np.ascontiguousarray(turn.to_parent(facings)),
        lines.astype(np.int64),
    )
