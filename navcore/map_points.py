"""The points of the global map, as a table and as a value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.points import Observation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapPoints:
    """The points of the map at one moment."""

    points_map: npt.NDArray[np.float32]
    """(N, 3) metres of the map frame."""
    rgb: npt.NDArray[np.uint8]
    """(N, 3) colour."""
    class_ids: npt.NDArray[np.uint8]
    """(N,) class of the beware list; `NOTHING` for geometric points."""
    confidence: npt.NDArray[np.float32]
    """(N,) of the segmenter."""
    range_m: npt.NDArray[np.float32]
    """(N,) depth at which each was measured."""
    pose_ids: npt.NDArray[np.int32]
    """(N,) pose that each belongs to."""


class PointTable:
    """The live points of a map as parallel arrays, which grow by doubling; only the first `count` rows count."""

    def __init__(self) -> None:
        self.count = 0
        self.xyz = np.empty((0, 3), dtype=np.float32)
        self.rgb = np.empty((0, 3), dtype=np.uint8)
        self.class_ids = np.empty(0, dtype=np.uint8)
        self.confidence = np.empty(0, dtype=np.float32)
        self.range_m = np.empty(0, dtype=np.float32)
        self.pose_ids = np.empty(0, dtype=np.int32)

    _columns = ("xyz", "rgb", "class_ids", "confidence", "range_m", "pose_ids")

    def append(self, observation: Observation, chosen: npt.NDArray[np.int64], pose_id: int) -> None:
        """Add the chosen points of an observation under a pose ID."""
        start, self.count = self.count, self.count + len(chosen)
        if self.count > len(self.xyz):
            for name in self._columns:
                column = getattr(self, name)
                grown = np.empty((max(2 * self.count, 4096), *column.shape[1:]), dtype=column.dtype)
                grown[:start] = column[:start]
                setattr(self, name, grown)
        place = slice(start, self.count)
        self.xyz[place], self.rgb[place] = observation.points_map[chosen], observation.rgb[chosen]
        self.class_ids[place], self.confidence[place] = observation.class_ids[chosen], observation.confidence[chosen]
        self.range_m[place], self.pose_ids[place] = observation.range_m[chosen], pose_id

    def remove(self, indices: npt.NDArray[np.int64]) -> None:
        """Take points out; the order of the others stays."""
        if len(indices) == 0:
            return
        keep = np.ones(self.count, dtype=np.bool_)
        keep[indices] = False
        kept = int(keep.sum())
        for name in self._columns:
            column = getattr(self, name)
            column[:kept] = column[: self.count][keep]
        self.count = kept

    def of_class(self, class_id: int) -> npt.NDArray[np.bool_]:
        """(count,) which points belong to a class."""
        return np.equal(self.class_ids[: self.count], class_id)

    def copied(self) -> MapPoints:
        """All points, as a value."""
        xyz, *others = (getattr(self, name)[: self.count].copy() for name in self._columns)
        return MapPoints(points_map=xyz, **dict(zip(self._columns[1:], others, strict=True)))
