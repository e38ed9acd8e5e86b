"""What an operator erases from the map, as a value that can be put back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from navcore.geometry.arrays import Bools, FloatImage, Indices, Points
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_queries import points_in
from navcore.mapping.points.point_table import PointTable
from navcore.mission.beware_list import NOTHING


class Erasable(StrEnum):
    """What is erased from an area of the map."""

    GEOMETRY = "geometry"
    """Obstacles by height, and those of the prior map."""
    BEWARE = "beware"
    """Points of the classes of the beware list."""
    BOTH = "both"
    """All points, and the obstacles of the prior map."""

    @property
    def class_ids(self) -> npt.NDArray[np.uint8]:
        """(K,) classes of the points that are erased."""
        first = NOTHING if self is not Erasable.BEWARE else NOTHING + 1
        last = 255 if self is not Erasable.GEOMETRY else NOTHING
        return np.arange(first, last + 1, dtype=np.uint8)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErasedArea:
    """Cells in which points of some classes were erased: what frames before have seen there does
    not come back with another colour rule. They are kept for as long as those frames, for minutes,
    and a correction does not move them."""

    number: int
    """Number of the erasure."""
    cells: Indices
    """(N,) cells, row · cols + col."""
    kinds: npt.NDArray[np.bool_]
    """(256,) erased classes."""

    def holds(self, points: Records) -> Bools:
        """Return (N,) whether points lie in the area and are of its classes."""
        return np.asarray(self.kinds[points["class_id"]] & np.isin(points["cell"], self.cells))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErasedGround:
    """Ground that was erased; it belongs to one map."""

    records: Indices
    """(N,) records that held it."""
    sums: FloatImage
    """(N, V) their sums of V values."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Erased:
    """Points and cells of the prior map that were erased; they belong to one map."""

    records: Records
    """(N,) points, each in the base frame of its pose ID, so that they come back where corrections
    of the map have moved this pose."""
    prior_xy: Points
    """(K, 2) middles of the erased cells of the prior map in metres of the map frame."""
    cells: int
    """Number of cells that held any of this."""
    number: int = 0
    """Number of the newest erasure of beware points then."""
    is_area: bool = False
    """Whether that is this one."""
    ground: ErasedGround | None = None
    """Ground that was forgotten; None where none was asked for."""

    @property
    def bytes_used(self) -> int:
        """Memory in bytes."""
        ground = 0 if self.ground is None else self.ground.sums.nbytes + self.ground.records.nbytes
        return self.records.nbytes + self.prior_xy.nbytes + ground


def take(points: PointTable, indices: Indices) -> Records:
    """Remove points by index and return them."""
    taken: Records = points.live[indices]
    points.remove(indices)
    return taken


def put_back(points: PointTable, taken: Records) -> None:
    """Add points that were taken and placed again, but none to a voxel that has a point of its
    class by now; points of one voxel that were taken together all come back."""
    cells = np.unique(taken["cell"][taken["cell"] >= 0]).astype(np.int64)
    every_class = np.ones(256, dtype=np.bool_)
    held = points.live[points_in(points.first, points.records, cells, every_class)]
    beside = taken["cell"] < 0
    points.append(taken[beside | ~np.isin(voxels(taken), voxels(held))])


def voxels(points: Records) -> npt.NDArray[np.int64]:
    """Return (N,) numbers that are equal for points of one class in one voxel."""
    cells, levels = points["cell"].astype(np.int64), points["level"].astype(np.int64)
    return np.asarray((cells * 256 + levels) * 256 + points["class_id"])
