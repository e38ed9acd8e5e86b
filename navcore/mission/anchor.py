"""An anchor: the poses beside which an operator has drawn something, and where that was."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navcore.geometry.arrays import Points
from navcore.geometry.polyline import Corners
from navcore.geometry.transform import IDENTITY, Pose2, wrap_angle
from navcore.mission.zone_shapes import Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberedPoses:
    """Poses of a map by their IDs."""

    numbering: str
    """Numbering in which they have their IDs; the same ID in another one is another pose. Empty for
    one without a name."""
    poses: tuple[Pose2, ...]
    """T_map_base by ID."""
    frozen: int = 0
    """Number of the first of them that are constants, those of a loaded map."""
    loaded_numbering: str = ""
    """Numbering in which the loaded map has its poses, with the same IDs; empty without one."""

    def of(self, numbering: str) -> Sequence[Pose2] | None:
        """Return the poses that had IDs in a numbering, by these; None for an unknown one, and for
        one without a name."""
        if numbering in ("", self.numbering):
            return self.poses if numbering else None
        return self.poses[: self.frozen] if numbering == self.loaded_numbering else None


NO_POSES = NumberedPoses(numbering="", poses=())
"""Those of no map."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where an item is."""

    outline: Corners
    """Corners (x, y) of a zone, or the one position of a goal, metres of the map frame."""
    shape: Shape | None = None
    """Shape that the outline was made from; None for one drawn corner by corner."""
    yaw_rad: float | None = None
    """Heading of a goal in radians of the map frame; None for any, and for zones."""

    @property
    def corners(self) -> Points:
        """(N, 2) corners in metres of the map frame."""
        return np.array(self.outline, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """Poses beside which an item was drawn."""

    numbering: str
    """Numbering of the poses."""
    poses: tuple[tuple[int, Pose2], ...]
    """Pose ID and T_map_base at that time, the nearest first; none for an item that stays."""
    drawn: Place
    """Where it was drawn."""
    place: Place
    """Where it is by its poses: the anchor of an item that is elsewhere, as an operator has put it
    there since, tells nothing."""

    def motion(self, poses: Sequence[Pose2]) -> Pose2:
        """Return the rigid motion of the map frame since the item was drawn, from the present poses
        by ID: the mean of the motions of the anchor's poses at the item's middle. Those that a
        map does not have yet are left out; without any there is no motion."""
        corners, is_still = self.drawn.corners, True
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        moved, turns = [], []
        for pose_id, then in self.poses:
            if pose_id >= len(poses):
                continue
            now = poses[pose_id]
            is_still = is_still and now == then
            moved.append((now @ then.inverse()).to_parent(middle))
            turns.append(wrap_angle(now.yaw_rad - then.yaw_rad))
        if is_still:
            return IDENTITY
        turn = math.atan2(sum(map(math.sin, turns)), sum(map(math.cos, turns)))
        rotation = Pose2(x_m=0.0, y_m=0.0, yaw_rad=turn)
        x, y = np.mean(moved, axis=0) - rotation.to_parent(middle)
        return Pose2(x_m=float(x), y_m=float(y), yaw_rad=turn)
