"""Submaps as plain arrays of a map file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.mapping.explored.patch import WORD
from navcore.mapping.explored.raycast import BLOCK
from navcore.mapping.explored.submap import PackedSubmap
from navcore.mapping.storage.map_rules import require, within

Parts = dict[str, npt.NDArray[Any]]
"""Arrays of a map file by name."""
KINDS: Mapping[str, tuple[type[np.generic], int]] = {
    "submap_pose_ids": (np.int32, 1),
    "submap_poses": (np.float64, 2),
    "submap_boxes": (np.int32, 2),
    "submap_sizes": (np.int64, 1),
    "submap_data": (np.uint8, 1),
}
"""Part → type and number of axes: for each of S submaps its pose ID; x, y in metres and yaw in
radians of its pose; first row, first column, rows and words of a row; number of compressed bytes;
and the bytes of all submaps one after the other."""
_FURTHEST = 1 << 24
"""Largest distance in cells of a submap from the grid's first cell."""
_LARGEST = 1 << 14
"""Largest side of a submap in cells."""


def submap_parts(submaps: Mapping[int, PackedSubmap]) -> Parts:
    """Return submaps by pose ID as arrays."""
    held = [submaps[pose_id] for pose_id in sorted(submaps)]
    poses = [(submap.pose.x_m, submap.pose.y_m, submap.pose.yaw_rad) for submap in held]
    boxes = [(submap.top, submap.left, submap.rows, submap.words) for submap in held]
    return {
        "submap_pose_ids": np.array(sorted(submaps), dtype=np.int32),
        "submap_poses": np.array(poses, dtype=np.float64).reshape(-1, 3),
        "submap_boxes": np.array(boxes, dtype=np.int32).reshape(-1, 4),
        "submap_sizes": np.array([len(submap.data) for submap in held], dtype=np.int64),
        "submap_data": np.frombuffer(b"".join(s.data for s in held), dtype=np.uint8),
    }


def submaps_of(parts: Parts, poses: int, most_bytes: int, where: str) -> dict[int, PackedSubmap]:
    """Return the submaps of arrays; raises `BadConfiguration` for values that no map has.

    `poses`: number of pose IDs of the map. `most_bytes`: largest total of the unpacked cells.
    `where`: name of the file.
    """
    require(_rules(parts, poses), where)
    ends, data = np.cumsum(parts["submap_sizes"]).tolist(), parts["submap_data"].tobytes()
    submaps = {}
    for pose_id, (x, y, yaw), (top, left, rows, words), first, end in zip(
        parts["submap_pose_ids"].tolist(),
        parts["submap_poses"].tolist(),
        parts["submap_boxes"].tolist(),
        [0, *ends],
        ends,
        strict=False,
    ):
        pose = Pose2(x_m=x, y_m=y, yaw_rad=yaw)
        submap = PackedSubmap(
            pose=pose, top=top, left=left, rows=rows, words=words, data=data[first:end]
        )
        most_bytes -= submap.size
        if most_bytes < 0:
            raise BadConfiguration(f"{where}: submap_data: unpacks to more than is read")
        try:
            submap.patch()
        except ValueError as error:
            raise BadConfiguration(f"{where}: submap_data: {error!s:.200}") from None
        submaps[pose_id] = submap
    return submaps


def _rules(parts: Parts, poses: int) -> dict[str, bool]:
    """Return for each part whether its values are possible."""
    ids, boxes, sizes = parts["submap_pose_ids"], parts["submap_boxes"], parts["submap_sizes"]
    count = len(ids)
    rules = {
        "submap_pose_ids": within(ids, 0, poses - 1) and bool((ids[1:] > ids[:-1]).all()),
        "submap_poses": parts["submap_poses"].shape == (count, 3)
        and within(parts["submap_poses"], -1e7, 1e7),
        "submap_boxes": boxes.shape == (count, 4),
        "submap_sizes": len(sizes) == count
        and within(sizes, 0, len(parts["submap_data"]))
        and int(sizes.sum()) == len(parts["submap_data"]),
    }
    if rules["submap_boxes"]:
        top, left, rows, words = boxes.astype(np.int64).T
        near = (np.abs(top) <= _FURTHEST) & (np.abs(left) <= _FURTHEST)
        small = (rows >= 0) & (words >= 0) & (rows <= _LARGEST) & (words * WORD <= _LARGEST)
        aligned = (top % BLOCK == 0) & (left % WORD == 0) & (rows % BLOCK == 0)
        rules["submap_boxes"] = bool((near & small & aligned).all())
    return rules
