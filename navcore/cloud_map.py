"""The global map: points keyed by the pose they were seen from, and the occupied cells they make, class by class.

A frame at a known pose ID replaces that pose's points, else its points are appended (the paper's section on global mapping).
Three rules make that safe for a camera that sees only a part of the world at a time:

* a point is replaced only where the camera looks at it again; what it does not look at stays;
* a point through which the camera now sees is removed, whichever pose it belongs to, because people walk on;
* a voxel belongs to the first pose that saw it, and to a later one that saw it from much nearer, so that the map is bounded by
  the world's surface, not by the time driven.

The points are the truth. The layers of bits (one 64-bit column of 5 cm heights per cell and class) are kept up to date with
every insertion and removal and always equal those rebuilt from the points.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numba
import numpy as np
import numpy.typing as npt

from navcore.beware import NOTHING, BewareList
from navcore.frame import Frame
from navcore.grid import BoolGrid, GridSpec, OccupancyGrid
from navcore.map_points import MapPoints, PointTable
from navcore.points import BIN_M, LOWEST_M, Observation
from navcore.settings import between
from navcore.transform import Pose2, invert, wrap_angle
from navcore.zones import Zone, rasterise

FLAT_M = 0.05
"""Beware points below this lie on the floor, as far as depth can tell."""
Bits = npt.NDArray[np.uint64]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapRules:
    """How poses are told apart and when a point is given up."""

    pose_spacing_m: float = between(0.01, 5.0, default=0.25)
    """A new pose ID begins after this distance …"""
    pose_spacing_deg: float = between(1.0, 180.0, default=10.0)
    """… or after this turn."""
    clearing_m: float = between(0.02, 1.0, default=0.10)
    """How far behind a point the camera must see, at no distance, before the point is taken for gone …"""
    clearing_per_m2: float = between(0.0, 0.2, default=0.012)
    """… and how much more per squared metre of distance, since stereo depth scatters with its square."""


class CloudMap:
    """Points by pose ID, and the layers of occupied cells they make."""

    def __init__(self, spec: GridSpec, rules: MapRules) -> None:
        self.spec = spec
        self._rules = rules
        self._points = PointTable()
        self._bits: dict[int, Bits] = {}
        self._seen: BoolGrid = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        self._zones: tuple[tuple[Zone, ...], tuple[BoolGrid, tuple[tuple[float, BoolGrid], ...]]] | None = None
        self._trodden: BoolGrid = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        self._seen_volume: Bits = np.zeros((-(-spec.rows // 4), -(-spec.cols // 4)), dtype=np.uint64)
        self._pose_id = -1
        self._keyframe: Pose2 | None = None
        self.version = 0
        """Grows whenever a cell of any layer becomes occupied or free, or the confidence of a beware point may have changed."""

    def insert(self, observation: Observation, frame: Frame) -> None:
        """Replace or append the points of the frame's pose ID, and clear what the frame sees through."""
        pose_id = self._pose_id_of(frame.pose)
        outdated = self._outdated(frame, observation, pose_id)
        leaving, coming = self._points.class_ids[outdated], observation.class_ids
        fresh, changed = [np.empty(0, dtype=np.int64)], False
        for class_id in np.union1d(leaving, coming):
            new = np.nonzero(coming == class_id)[0]
            kept, differs = self._update_layer(int(class_id), outdated[leaving == class_id], observation, new)
            fresh.append(new[kept])
            changed |= differs
        self._points.remove(outdated)
        self._points.append(observation, np.concatenate(fresh), pose_id)
        self._note_seen(observation.voxels_seen)
        self.version += changed

    def grid(self, beware: BewareList, zones: Iterable[Zone]) -> OccupancyGrid:
        """The layers under the given list and zones: whatever was ever seen counts, whenever the list was edited."""
        drawn, wide = self._drawn(tuple(zone for zone in zones if zone.enabled))
        return OccupancyGrid(
            spec=self.spec,
            geometric=self._layer(NOTHING, 0.0),
            beware={entry.class_id: self._layer(entry.class_id, entry.min_confidence) for entry in beware.enabled},
            margins_m={entry.class_id: entry.margin_m for entry in beware.enabled},
            zones=drawn,
            wide_zones=wide,
        )

    def _drawn(self, zones: tuple[Zone, ...]) -> tuple[BoolGrid, tuple[tuple[float, BoolGrid], ...]]:
        """The zones' cells: all without a margin in one mask, the others with theirs; made anew only when zones change."""
        if self._zones is None or self._zones[0] != zones:
            union = np.zeros((self.spec.rows, self.spec.cols), dtype=np.bool_)
            for zone in zones:
                if zone.margin_m == 0:
                    union |= rasterise(zone.polygon, self.spec)
            wide: dict[float, BoolGrid] = {}
            for zone in zones:
                if zone.margin_m > 0:
                    mask = rasterise(zone.polygon, self.spec)
                    wide[zone.margin_m] = wide[zone.margin_m] | mask if zone.margin_m in wide else mask
            self._zones = (zones, (union, tuple(wide.items())))
        return self._zones[1]

    @property
    def points(self) -> MapPoints:
        """A copy of all points."""
        return self._points.copied()

    @property
    def seen(self) -> BoolGrid:
        """(rows, cols) copy: cells in which the camera has measured anything, the floor included."""
        return self._seen.copy()

    def known(self) -> BoolGrid:
        """(rows, cols) cells that the camera has seen or the robot has stood on: nothing unseen can hide there."""
        # A pixel that measured nothing, or a gap between two rows of pixels, is no unseen place: single cells are closed.
        known = (self._seen | self._trodden).view(np.uint8)
        return cv2.morphologyEx(known, cv2.MORPH_CLOSE, np.ones((3, 3), dtype=np.uint8)).view(np.bool_)

    def tread(self, outline: npt.NDArray[np.float64]) -> None:
        """Note that the robot stands on, or is known to stand clear within, a convex outline (N, 2) of the map frame."""
        origin = np.array([self.spec.origin_x_m, self.spec.origin_y_m])
        corners = np.round(((outline - origin) / self.spec.resolution_m - 0.5) * 256).astype(np.int32)
        cv2.fillConvexPoly(self._trodden.view(np.uint8), corners, 1, shift=8)

    @property
    def explored_m2(self) -> float:
        """Area of the cells seen."""
        return float(np.count_nonzero(self._seen)) * self.spec.resolution_m**2

    @property
    def explored_m3(self) -> float:
        """Volume of the voxels of 4 cells × 4 cells × 5 cm in which anything was measured."""
        return float(np.bitwise_count(self._seen_volume).sum()) * (4 * self.spec.resolution_m) ** 2 * BIN_M

    def _pose_id_of(self, pose: Pose2) -> int:
        near = self._keyframe is not None and (
            self._keyframe.distance_to(pose.x_m, pose.y_m) < self._rules.pose_spacing_m
            and abs(wrap_angle(pose.yaw_rad - self._keyframe.yaw_rad)) < math.radians(self._rules.pose_spacing_deg)
        )
        if not near:
            self._keyframe = pose
            self._pose_id += 1
        return self._pose_id

    def _outdated(self, frame: Frame, observation: Observation, pose_id: int) -> npt.NDArray[np.int64]:
        intrinsics = frame.intrinsics
        return _find_outdated(
            self._points.xyz[: self._points.count],
            self._points.range_m[: self._points.count],
            self._points.class_ids[: self._points.count],
            self._points.pose_ids[: self._points.count],
            frame.depth_m,
            invert(frame.T_map_camera),
            np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy]),
            np.array([self._rules.clearing_m, self._rules.clearing_per_m2]),
            observation.max_range_m,
            pose_id,
        )

    def _update_layer(
        self, class_id: int, outdated: npt.NDArray[np.int64], observation: Observation, new: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.int64], bool]:
        """Take points out of a class's layer and put others in; which of the others are the first in their voxel, and whether
        anything has changed for the planners."""
        layer = self._bits.setdefault(class_id, np.zeros((self.spec.rows, self.spec.cols), dtype=np.uint64)).reshape(-1)
        old_cells, old_bits = self._places(self._points.xyz[outdated])
        new_cells, new_bits = self._places(observation.points_map[new])
        touched = np.concatenate([old_cells, new_cells])
        before = layer[touched] != 0
        _clear_bits(layer, old_cells, old_bits)
        fresh = _set_bits(layer, new_cells, new_bits)
        changed = bool(((layer[touched] != 0) != before).any())
        if class_id != NOTHING:
            # What is surer now than when it was first seen counts as the surer of the two.
            changed |= len(fresh) > 0 or len(outdated) > 0
            changed |= self._raise_confidence(class_id, new_cells, new_bits, observation.confidence[new])
        return fresh, changed

    def _raise_confidence(
        self, class_id: int, cells: npt.NDArray[np.int64], bits: Bits, confidence: npt.NDArray[np.float32]
    ) -> bool:
        """Let stored points of a class take over a higher confidence measured in their voxel; whether any did."""
        unsure = np.nonzero(self._points.of_class(class_id) & (self._points.confidence[: self._points.count] < 1.0))[0]
        if len(unsure) == 0 or len(cells) == 0:
            return False
        measured, stored = _voxel_keys(cells, bits), _voxel_keys(*self._places(self._points.xyz[unsure]))
        keys, index = np.unique(measured, return_inverse=True)
        best = np.zeros(len(keys), dtype=np.float32)
        np.maximum.at(best, index, confidence)
        at = np.minimum(np.searchsorted(keys, stored), len(keys) - 1)
        seen = np.where(keys[at] == stored, best[at], np.float32(0))
        surer = seen > self._points.confidence[unsure]
        self._points.confidence[unsure[surer]] = seen[surer]
        return bool(surer.any())

    def _places(self, points_map: npt.NDArray[np.float32]) -> tuple[npt.NDArray[np.int64], Bits]:
        """Flat cell index and height bit of points that are known to lie on the grid."""
        points = points_map.astype(np.float64)
        cols = np.floor((points[:, 0] - self.spec.origin_x_m) / self.spec.resolution_m).astype(np.int64)
        rows = np.floor((points[:, 1] - self.spec.origin_y_m) / self.spec.resolution_m).astype(np.int64)
        levels = np.floor((points[:, 2] - LOWEST_M) / BIN_M).astype(np.uint64)
        # A point measured a rounding error inside the border may be stored a rounding error outside.
        cells = np.clip(rows, 0, self.spec.rows - 1) * self.spec.cols + np.clip(cols, 0, self.spec.cols - 1)
        return cells, np.uint64(1) << np.minimum(levels, np.uint64(63))

    def _layer(self, class_id: int, min_confidence: float) -> BoolGrid:
        if class_id not in self._bits:
            return np.zeros((self.spec.rows, self.spec.cols), dtype=np.bool_)
        unsure = self._points.of_class(class_id) & (self._points.confidence[: self._points.count] < min_confidence)
        if not unsure.any():
            return np.not_equal(self._bits[class_id], 0)
        sure = self._points.of_class(class_id) & ~unsure
        mask = np.zeros(self.spec.rows * self.spec.cols, dtype=np.bool_)
        mask[self._places(self._points.xyz[: self._points.count][sure])[0]] = True
        return mask.reshape(self.spec.rows, self.spec.cols)

    def _note_seen(self, voxels: npt.NDArray[np.int64]) -> None:
        rows, cols = np.divmod(voxels >> 6, self.spec.cols)
        self._seen[rows, cols] = True
        bits = np.uint64(1) << (voxels & 63).astype(np.uint64)
        np.bitwise_or.at(self._seen_volume, (rows // 4, cols // 4), bits)


def _voxel_keys(cells: npt.NDArray[np.int64], bits: Bits) -> npt.NDArray[np.int64]:
    """One number for each voxel: cell · 64 + height bin."""
    return np.asarray(cells * 64 + np.bitwise_count(bits - np.uint64(1)), dtype=np.int64)


@numba.njit(cache=True, nogil=True)
def _find_outdated(
    xyz: npt.NDArray[np.float32],
    range_m: npt.NDArray[np.float32],
    class_ids: npt.NDArray[np.uint8],
    pose_ids: npt.NDArray[np.int32],
    depth_m: npt.NDArray[np.float32],
    T_camera_map: npt.NDArray[np.float64],
    lens: npt.NDArray[np.float64],
    clearing: npt.NDArray[np.float64],
    max_range_m: float,
    pose_id: int,
) -> npt.NDArray[np.int64]:
    """Indices of the points that the frame sees through, or measures again for the same pose or from much nearer.

    A point's pixel and its eight neighbours are looked at: one that measures something nearer hides the point, and the point is
    seen through only when all that measure anything measure beyond it. Points of a beware class are never "measured again"
    by depth alone, and flat ones never seen through: a floor marking has no depth of its own, and neither a label lost at a
    grazing angle nor a nod of the robot when it brakes must free it.
    """
    height, width = depth_m.shape
    found = np.empty(len(xyz), dtype=np.int64)
    count = 0
    t = T_camera_map
    for index in range(len(xyz)):
        x, y, z = float(xyz[index, 0]), float(xyz[index, 1]), float(xyz[index, 2])
        depth = t[2, 0] * x + t[2, 1] * y + t[2, 2] * z + t[2, 3]
        if depth < 0.2 or depth > max_range_m:
            continue
        j = round((t[0, 0] * x + t[0, 1] * y + t[0, 2] * z + t[0, 3]) / depth * lens[0] + lens[2])
        i = round((t[1, 0] * x + t[1, 1] * y + t[1, 2] * z + t[1, 3]) / depth * lens[1] + lens[3])
        if i < 1 or i >= height - 1 or j < 1 or j >= width - 1:
            continue
        tolerance = clearing[0] + clearing[1] * depth * depth
        nearest = np.inf
        for r in range(i - 1, i + 2):
            for c in range(j - 1, j + 2):
                if 0.0 < depth_m[r, c] < nearest:
                    nearest = depth_m[r, c]
        if nearest == np.inf or nearest < depth - tolerance or (class_ids[index] != 0 and z < FLAT_M):
            continue
        again = class_ids[index] == 0 and (pose_ids[index] == pose_id or depth < 0.7 * range_m[index])
        if nearest > depth + tolerance or again:
            found[count] = index
            count += 1
    return found[:count]


@numba.njit(cache=True, nogil=True)
def _set_bits(
    layer: npt.NDArray[np.uint64], cells: npt.NDArray[np.int64], bits: npt.NDArray[np.uint64]
) -> npt.NDArray[np.int64]:
    """Set each point's bit; returns which points were the first in their voxel."""
    fresh = np.empty(len(cells), dtype=np.int64)
    count = 0
    for k in range(len(cells)):
        if layer[cells[k]] & bits[k]:
            continue
        layer[cells[k]] |= bits[k]
        fresh[count] = k
        count += 1
    return fresh[:count]


@numba.njit(cache=True, nogil=True)
def _clear_bits(layer: npt.NDArray[np.uint64], cells: npt.NDArray[np.int64], bits: npt.NDArray[np.uint64]) -> None:
    """Clear each point's bit."""
    for k in range(len(cells)):
        layer[cells[k]] &= ~bits[k]
