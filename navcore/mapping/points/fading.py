"""Fading: flat points of the colour rules go as surely as they came once they are no longer there.

Depth cannot disprove a floor marking, and a colour rule is certain whenever it speaks. So a certain
flat point carries evidence as a number of looks, which is log-odds in equal steps: a near look that
shows its class adds one, and one that measures the same floor in another colour takes one; at none
the point is forgotten. Silence alone is no evidence: what is covered, far off, at the border of the
image, too dark, or of the same colour in another light without its label stays as it is.

The second colour of a pattern may be black, or the bare floor, whose pixels tell nothing when the
marking is gone. It goes with the first colour: where that has faded, points of the second are
forgotten that none of the first is left for within the largest gap of the pattern.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from navcore.compiled import compiled
from navcore.config.mapping import ClearingRules, FadingConfig, FadingRules
from navcore.geometry.arrays import FloatImage, Floats, Indices, Points
from navcore.geometry.camera import Pinhole
from navcore.geometry.transform import Matrix, invert
from navcore.mapping.points.clearing import pixel_of
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_table import PointTable
from navcore.mission.beware_list import NOTHING, ColourRule
from navcore.perception.colour_segmenter import matches_colour
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

UNKNOWN_LOOKS = 255
"""Looks of a point from a map file that does not say them: as many as there can be."""


def faded(
    points: PointTable,
    held: Indices,
    frame: Frame,
    labels: Labels,
    config: FadingConfig,
    clearing: ClearingRules,
) -> Indices:
    """Count one more look at the certain flat ones of (N,) `held` points; return those to forget.

    A point is shown if any source of the labels shows its class at its pixel or beside.
    """
    return _faded(
        points.records,
        points.changed,
        held,
        np.ascontiguousarray(frame.rgb),
        frame.depth_m,
        invert(frame.T_map_camera),
        frame.intrinsics.pinhole,
        np.stack([one.class_ids for one in labels.all_hypotheses]),
        clearing,
        config.rules,
    )


def left_alone(
    points: PointTable, gone: Indices, patterns: Mapping[int, ColourRule], flat_m: float
) -> Indices:
    """Return the certain flat points of the second colour of a pattern that none of the first is
    left for, once the (N,) points `gone` are forgotten. `patterns` are the rules by class id."""
    live, found = points.live, [gone[:0]]
    for class_id in np.unique(live["class_id"][gone]).tolist():
        rule = patterns.get(class_id)
        if rule is None or rule.pattern is None:
            continue
        certain = (live["confidence"] >= 1) & (live["z"] < flat_m)
        own = np.setdiff1d(np.flatnonzero((live["class_id"] == class_id) & certain), gone)
        rgb = np.column_stack([live[channel][own] for channel in "rgb"])
        is_first = matches_colour(rgb[None], dataclasses.replace(rule, pattern=None))[0]
        first, second = own[is_first], own[~is_first]
        reach_m = rule.pattern.max_gap_m
        near = second[_distances(live, second, gone) <= reach_m]
        found.append(near[_distances(live, near, first) > reach_m])
    return np.concatenate(found)


def _distances(records: Records, of: Indices, to: Indices) -> Floats:
    """Return (N,) the distance of points from the nearest of others along the floor, metres."""
    if not len(of) or not len(to):
        return np.full(len(of), np.inf)
    return np.asarray(cKDTree(_places(records, to)).query(_places(records, of))[0])


def _places(records: Records, which: Indices) -> Points:
    return np.column_stack([records["x"][which], records["y"][which]])


@compiled
def _faded(
    records: Records,
    changed: npt.NDArray[np.bool_],
    held: Indices,
    rgb: npt.NDArray[np.uint8],
    depth_m: FloatImage,
    t: Matrix,
    lens: Pinhole,
    class_ids: npt.NDArray[np.uint8],
    clearing: ClearingRules,
    fading: FadingRules,
) -> Indices:
    height, width = depth_m.shape
    forget = [np.int64(0) for _ in range(0)]
    for index in held:
        point = records[index]
        if point.class_id == NOTHING or point.confidence < 1 or point.z >= clearing.flat_m:
            continue
        i, j, depth = pixel_of(point, t, lens, clearing.nearest_m)
        if depth > fading.near_m or i < 1 or i > height - 2 or j < 1 or j > width - 2:
            continue
        tolerance = fading.tolerance_m + clearing.per_m2 * depth * depth
        if depth_m[i, j] <= 0 or abs(depth_m[i, j] - depth) > tolerance:
            continue
        looks = min(int(point.looks), fading.most)
        if _is_shown(class_ids, i, j, point.class_id):
            looks = min(looks + 1, fading.most)
        elif _is_another_colour(rgb, i, j, point, fading):
            looks -= 1
        if looks != point.looks:
            records[index].looks = looks
            changed[index] = True
        if looks <= 0:
            forget.append(index)
    return np.array(forget, dtype=np.int64)


@compiled
def _is_shown(class_ids: npt.NDArray[np.uint8], i: int, j: int, class_id: int) -> bool:
    for source in range(len(class_ids)):
        for r in range(i - 1, i + 2):
            for c in range(j - 1, j + 2):
                if class_ids[source, r, c] == class_id:
                    return True
    return False


@compiled
def _is_another_colour(
    rgb: npt.NDArray[np.uint8], i: int, j: int, point: np.void, fading: FadingRules
) -> bool:
    """Return whether a pixel and all beside it differ in the shares of red, green and blue from the
    colour with which a point was seen."""
    own = float(point.r) + float(point.g) + float(point.b)  # type: ignore[attr-defined]
    if own < fading.dark:
        return False
    for r in range(i - 1, i + 2):
        for c in range(j - 1, j + 2):
            red, green, blue = float(rgb[r, c, 0]), float(rgb[r, c, 1]), float(rgb[r, c, 2])
            total = red + green + blue
            if total < max(fading.dark, 1):
                return False
            difference = max(
                abs(red / total - point.r / own),  # type: ignore[attr-defined]
                abs(green / total - point.g / own),  # type: ignore[attr-defined]
                abs(blue / total - point.b / own),  # type: ignore[attr-defined]
            )
            if difference < fading.colour:
                return False
    return True
