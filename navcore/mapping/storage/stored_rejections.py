"""Rejections as plain arrays of a map file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from navcore.mapping.points.rejections import MAX_POINTS, MAX_REJECTIONS, Rejection
from navcore.mapping.storage.map_rules import require, within
from navcore.mapping.storage.stored_submaps import Parts
from navcore.mission.beware_list import LARGEST_CLASS_ID

KINDS: Mapping[str, tuple[type[np.generic], int]] = {
    "rejected_class_ids": (np.uint8, 1),
    "rejected_confidence": (np.float32, 1),
    "rejected_pose_ids": (np.int32, 1),
    "rejected_sizes": (np.int32, 1),
    "rejected_points": (np.float32, 2),
}
"""Part → type and number of axes: the fields of each `Rejection`, the number of its positions, and
the (M, 2) positions of all, one rejection after the other."""
_FURTHEST_M = 1000.0
"""Largest distance in metres of a position from its pose."""


def rejection_parts(rejections: tuple[Rejection, ...]) -> Parts:
    """Return rejections as arrays by name."""
    points = [one.points_base for one in rejections]
    return {
        "rejected_class_ids": np.array([one.class_id for one in rejections], dtype=np.uint8),
        "rejected_confidence": np.array([one.confidence for one in rejections], dtype=np.float32),
        "rejected_pose_ids": np.array([one.pose_id for one in rejections], dtype=np.int32),
        "rejected_sizes": np.array([len(own) for own in points], dtype=np.int32),
        "rejected_points": np.concatenate([np.empty((0, 2), np.float32), *points]),
    }


def rejections_of(parts: Parts, poses: int, where: str) -> tuple[Rejection, ...]:
    """Return the rejections of arrays; raises `BadConfiguration` for values that none has.

    `poses`: number of pose IDs of the map. `where`: name of the file.
    """
    class_ids, confidence, pose_ids, sizes, points = (parts[name] for name in KINDS)
    require(
        {
            "rejected_class_ids": len(class_ids) <= MAX_REJECTIONS
            and within(class_ids, 1, LARGEST_CLASS_ID),
            "rejected_confidence": len(confidence) == len(class_ids) and within(confidence, 0, 1),
            "rejected_pose_ids": len(pose_ids) == len(class_ids) and within(pose_ids, 0, poses - 1),
            "rejected_sizes": len(sizes) == len(class_ids)
            and within(sizes, 1, MAX_POINTS)
            and int(sizes.sum(dtype=np.int64)) == len(points),
            "rejected_points": points.shape == (len(points), 2)
            and within(points, -_FURTHEST_M, _FURTHEST_M),
        },
        where,
    )
    own = np.split(points, np.cumsum(sizes)[:-1]) if len(sizes) else []
    return tuple(
        Rejection(
            id=i + 1,
            class_id=int(class_ids[i]),
            confidence=float(confidence[i]),
            pose_id=int(pose_ids[i]),
            points_base=own[i],
        )
        for i in range(len(class_ids))
    )
