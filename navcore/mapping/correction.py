"""Correction of past poses: the whole map is computed again from each pose's own points and cells.

The long part, `prepare`, takes and gives values, so it may run in another thread while frames enter
the map. What they changed meanwhile is brought up to date when the result is taken over
(`PointMap.apply`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from navcore.compiled import compiled
from navcore.geometry.arrays import Bools, Floats, Indices
from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import BitPlanes, unpack
from navcore.grid.grid import GridSpec
from navcore.mapping.explored.patch import FLOOR, Explored
from navcore.mapping.explored.submap import PackedSubmap, mark_submaps
from navcore.mapping.layers import LayerRules, layer_planes
from navcore.mapping.points.placing import place, pose_rows
from navcore.mapping.points.point_links import Cells, Records, link_points, unlink_one
from navcore.mapping.points.point_table import POINT, PointTable
from navcore.mapping.points.pose_ids import PoseIds, check_movable


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapSnapshot:
    """What a correction is computed from."""

    number: int
    """Number of the snapshot; a correction of an older one cannot be applied."""
    spec: GridSpec
    """Size and position of the grid."""
    records: Records
    """Copy of the points, with some spare capacity."""
    count: int
    """Number of points."""
    poses: tuple[Pose2, ...]
    """T_map_base of every pose ID."""
    frozen: int
    """Number of the first pose IDs whose poses are constants."""
    spacing: tuple[float, float]
    """Limits of distance in metres and turn in degrees within which a pose is a known one."""
    rules: LayerRules
    """Which points count, and the prior map."""
    base: Explored
    """Copy of the explored cells that never move."""
    submaps: Mapping[int, PackedSubmap]
    """Explored cells by pose ID."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedCorrection:
    """Map at corrected poses, to be taken over once by `PointMap.apply`."""

    number: int
    """Number of the snapshot."""
    poses: Mapping[int, Pose2]
    """Corrected T_map_base by pose ID."""
    pose_ids: PoseIds
    """All pose IDs of the snapshot at the corrected poses."""
    rows: Floats
    """(P, 4) `pose_rows` of these."""
    points: PointTable
    """Points at the corrected poses, in the order of the snapshot."""
    rules: LayerRules
    """Which points count in the planes."""
    planes: BitPlanes
    """Plane of each class."""
    prior: Bools
    """(rows · cols,) cells of the prior map that are not disproved."""
    explored: Explored
    """Explored cells."""

    @property
    def known(self) -> int:
        """Number of pose IDs in the snapshot."""
        return len(self.rows)


def prepare(snapshot: MapSnapshot, poses: Mapping[int, Pose2]) -> PreparedCorrection:
    """Return the map of a snapshot at corrected poses (pose ID → T_map_base); a snapshot serves
    once, because its points and cells are taken over.

    Raises `BadConfiguration` for an unknown or frozen pose ID.
    """
    check_movable(poses, len(snapshot.poses), snapshot.frozen)
    spec, corrected = snapshot.spec, list(snapshot.poses)
    for pose_id, pose in poses.items():
        corrected[pose_id] = pose
    pose_ids, rows = PoseIds(*snapshot.spacing), pose_rows(corrected)
    pose_ids.extend(corrected)
    live = snapshot.records[: snapshot.count]
    place(live, live["pose_id"], rows, spec)
    points = PointTable(spec.rows * spec.cols)
    points.load(snapshot.records, snapshot.count)
    explored = snapshot.base
    mark_submaps(explored, snapshot.submaps, corrected, spec)
    loaded = snapshot.rules.loaded_prior
    prior = (
        np.zeros(spec.rows * spec.cols, dtype=np.bool_)
        if loaded is None
        else (loaded.bools & ~unpack(explored.planes[FLOOR], spec.rows, spec.cols)).reshape(-1)
    )
    return PreparedCorrection(
        number=snapshot.number,
        poses=dict(poses),
        pose_ids=pose_ids,
        rows=rows,
        points=points,
        rules=snapshot.rules,
        planes=layer_planes(snapshot.rules, points, prior, spec),
        prior=prior,
        explored=explored,
    )


def catch_up(points: PointTable, live: PointTable, rows: Floats, spec: GridSpec) -> Indices:
    """Bring prepared points up to date with the live ones, which have changed since the snapshot;
    return the cells concerned, some of them several times.

    `rows`: (P, 4) `pose_rows` of all pose IDs at their new poses.
    """
    changed = np.flatnonzero(live.changed[: live.count])
    stale = np.concatenate(
        [changed[changed < points.count], np.arange(live.count, points.count, dtype=np.int64)]
    )
    before = points.records["cell"][stale].astype(np.int64)
    _unlink(points.records, points.first, stale)
    points.resize(live.count)
    # As rows of plain words: records are copied one by one.
    rows_of_words = (-1, POINT.itemsize // 8)
    taken = live.records.view(np.uint64).reshape(rows_of_words)[changed]
    renewed = taken.view(POINT).reshape(-1)
    place(renewed, renewed["pose_id"], rows, spec)
    points.records.view(np.uint64).reshape(rows_of_words)[changed] = taken
    link_points(points.records, points.first, changed)
    cells = np.concatenate([before, renewed["cell"].astype(np.int64)])
    return np.asarray(cells[cells >= 0])


def replace_points(points: PointTable, indices: Indices, rows: Floats, spec: GridSpec) -> Indices:
    """Compute the places of (N,) points on a grid; return the cells concerned.

    `rows`: (P, 4) `pose_rows` of all pose IDs.
    """
    renewed = points.records[indices]
    before = renewed["cell"].astype(np.int64)
    _unlink(points.records, points.first, indices)
    place(renewed, renewed["pose_id"], rows, spec)
    points.records[indices] = renewed
    link_points(points.records, points.first, indices)
    cells = np.concatenate([before, renewed["cell"].astype(np.int64)])
    return np.unique(cells[cells >= 0])


@compiled
def _unlink(records: Records, first: Cells, indices: Indices) -> None:
    for index in indices:
        unlink_one(records, first, index)
