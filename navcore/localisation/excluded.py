"""Pixels of what does not stay where it is: people and beware objects, left out of scans."""

from __future__ import annotations

import math

import numpy as np

from navcore.compiled import compiled
from navcore.geometry.arrays import Bools, FloatImage
from navcore.geometry.transform import invert
from navcore.mission.beware_list import NOTHING
from navcore.perception.labels import Labels
from navcore.perception.people.track import Track
from navcore.robot.frame import Frame

_AROUND_M = 0.25
"""Distance in metres around a person's disc within which points may be theirs: arms, bags."""


def excluded_pixels(frame: Frame, labels: Labels, people: tuple[Track, ...]) -> Bools:
    """Return the (H, W) pixels that have a label or may show a tracked person.

    `people` are in the frame of the frame's pose.
    """
    first, *others = labels.all_hypotheses
    excluded = first.class_ids != NOTHING
    for other in others:
        excluded |= other.class_ids != NOTHING
    lens, to_camera = frame.intrinsics, invert(frame.T_map_camera)
    for person in people:
        x, _, depth = to_camera[:3, :3] @ (person.x_m, person.y_m, 0.9) + to_camera[:3, 3]
        reach = person.radius_m + _AROUND_M
        if depth <= -reach:
            continue
        near, far = max(depth - reach, 0.1), max(depth + reach, 0.1)
        # Beside the middle of the image, the far end of the disc is seen nearer to the middle.
        left = math.floor(min((x - reach) / near, (x - reach) / far) * lens.fx + lens.cx)
        right = math.ceil(max((x + reach) / near, (x + reach) / far) * lens.fx + lens.cx) + 1
        columns = max(left, 0), max(min(right, lens.width), 0)
        _exclude_depths(frame.depth_m, columns, (float(depth), reach), excluded)
    return np.asarray(excluded)


@compiled
def _exclude_depths(
    depth_m: FloatImage, columns: tuple[int, int], around_m: tuple[float, float], excluded: Bools
) -> None:
    """Mark the pixels of some columns whose depth differs from the first of `around_m` by less than
    the second."""
    middle, reach = around_m
    for i in range(depth_m.shape[0]):
        depths, marks = depth_m[i, columns[0] : columns[1]], excluded[i, columns[0] : columns[1]]
        for j in range(len(depths)):
            marks[j] |= abs(depths[j] - middle) < reach
