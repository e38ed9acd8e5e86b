"""Pose IDs: the poses from which the map was measured, found again by position and heading.

A robot that comes back to a known pose gets the ID of that pose again, so the number of IDs is
bounded by the space that the robot can stand in and not by the distance it drives.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.mission.anchor import NumberedPoses

Bucket = tuple[int, int, int]
"""Cell of the lookup grid: x and y in steps of the spacing, and the sector of the heading."""


def check_movable(pose_ids: Iterable[int], known: int, frozen: int) -> None:
    """Raise `BadConfiguration` unless each ID is one of the `known` and not of the first `frozen`
    ones."""
    for pose_id in pose_ids:
        if not 0 <= pose_id < known:
            raise BadConfiguration(f"pose ID {pose_id} is not on the map, which has {known}")
        if pose_id < frozen:
            raise BadConfiguration(
                f"pose ID {pose_id} belongs to the loaded map, whose first {frozen} poses are "
                "constants"
            )


class PoseIds:
    """T_map_base of each pose ID, numbered from 0 in the order in which they were first seen."""

    def __init__(self, spacing_m: float, spacing_deg: float) -> None:
        """Two poses are the same one if both their distance and the angle between their headings
        are below these limits."""
        self.spacing_m, self.spacing_deg = spacing_m, spacing_deg
        self._spacing_rad = math.radians(spacing_deg)
        self._sectors = max(int(2 * math.pi / self._spacing_rad), 1)
        self._poses: list[Pose2] = []
        self._buckets: defaultdict[Bucket, list[int]] = defaultdict(list)
        self._last: tuple[Pose2, int] | None = None
        self.frozen = 0
        """Number of the first IDs whose poses are constants, those of a loaded map."""
        self._named: Callable[[], str] = str
        self.numbering = self._named()
        """Name of this numbering, under which no ID is given to another place; corrections keep
        it. Empty until numberings are named."""
        self.loaded_numbering = ""
        """Numbering in which the poses that were restored had their IDs; empty before."""

    def id_of(self, pose: Pose2) -> int:
        """Return the ID of the nearest known pose, or a new one if no known pose is near enough.

        Nearest is by distance and turn in units of the two limits; of two equally near ones the
        newer is returned.
        """
        if self._last is None or self._last[0] != pose:  # every stage of a frame asks for its pose
            known = self.known(pose)
            self._last = pose, self._append(pose) if known is None else known
        return self._last[1]

    def known(self, pose: Pose2) -> int | None:
        """Return the ID that `id_of` would find for a pose; None if it would append one."""
        best, nearest = None, math.inf
        for pose_id in self._near(pose):
            other = self._poses[pose_id]
            away = other.distance_to(pose.x_m, pose.y_m) / self.spacing_m
            turn = abs(wrap_angle(pose.yaw_rad - other.yaw_rad)) / self._spacing_rad
            if away >= 1 or turn >= 1:
                continue
            cost = away * away + turn * turn
            if cost < nearest or (cost == nearest and best is not None and pose_id > best):
                best, nearest = pose_id, cost
        return best

    def extend(self, poses: Iterable[Pose2]) -> None:
        """Append poses under new IDs, near known ones or not."""
        for pose in poses:
            self._append(pose)

    def adopt(self, moved: PoseIds, later: Mapping[int, Pose2]) -> None:
        """Take over the poses of the first IDs from `moved`, which serves no more, and for the IDs
        after them those of `later`; the rest stays."""
        known = len(moved)
        newer = [later.get(known + k, pose) for k, pose in enumerate(self._poses[known:])]
        self._poses, self._buckets, self._last = moved._poses, moved._buckets, None
        self.extend(newer)

    def freeze(self) -> None:
        """Make all present poses constants."""
        self.frozen = len(self._poses)

    def array(self) -> npt.NDArray[np.float64]:
        """Return (P, 3) x and y in metres of the map frame and yaw in radians, by ID."""
        return np.array(
            [[pose.x_m, pose.y_m, pose.yaw_rad] for pose in self._poses], dtype=np.float64
        ).reshape(-1, 3)

    def name_numberings(self, named: Callable[[], str]) -> None:
        """Name this numbering and later ones, each by what `named` returns, which is never the same
        twice. Where none is named, equal drives give equal maps."""
        self._named = named
        self.numbering = named()

    def restore(self, poses: npt.NDArray[np.float64], numbering: str) -> None:
        """Replace all poses by those of an `array`, which had their IDs in another `numbering`, and
        freeze them. The IDs after them are given to other places than there: a numbering begins."""
        self.numbering, self.loaded_numbering = self._named(), numbering
        self._poses.clear()
        self._buckets.clear()
        self._last = None
        self.extend(Pose2(x_m=x, y_m=y, yaw_rad=yaw) for x, y, yaw in poses.tolist())
        self.freeze()

    @property
    def numbered(self) -> NumberedPoses:
        """All poses with their numbering; for the thread that changes them."""
        return NumberedPoses(
            numbering=self.numbering,
            poses=self.poses,
            frozen=self.frozen,
            loaded_numbering=self.loaded_numbering,
        )

    @property
    def poses(self) -> tuple[Pose2, ...]:
        """T_map_base of every ID, in order."""
        return tuple(self._poses)

    def __len__(self) -> int:
        return len(self._poses)

    def __getitem__(self, pose_id: int) -> Pose2:
        return self._poses[pose_id]

    def _append(self, pose: Pose2) -> int:
        self._poses.append(pose)
        self._buckets[self._bucket(pose)].append(len(self._poses) - 1)
        return len(self._poses) - 1

    def _bucket(self, pose: Pose2) -> Bucket:
        sector = math.floor(pose.yaw_rad % (2 * math.pi) / (2 * math.pi) * self._sectors)
        return (
            math.floor(pose.x_m / self.spacing_m),
            math.floor(pose.y_m / self.spacing_m),
            sector % self._sectors,
        )

    def _near(self, pose: Pose2) -> Iterator[int]:
        """Yield the IDs in the bucket of a pose and in those around it."""
        x, y, sector = self._bucket(pose)
        sectors = {(sector + turn) % self._sectors for turn in (-1, 0, 1)}
        for col in (x - 1, x, x + 1):
            for row in (y - 1, y, y + 1):
                for around in sectors:
                    # `get`: looking for a pose must not make a bucket.
                    yield from self._buckets.get((col, row, around), ())
