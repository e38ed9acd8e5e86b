"""Fading: flat points of the colour rules go as surely as they came once they are no longer there.

Depth cannot disprove a floor marking, and a colour rule is certain whenever it speaks. So a certain
flat point carries evidence as a number of looks, which is log-odds in equal steps: a near look that
shows its class adds one, and one that measures the same floor in another colour takes one; at none
the point is forgotten. Silence alone is no evidence: what is covered, far off, at the border of the
image, too dark, or of the same colour in another light without its label stays as it is.

A bright line is told from the floor by its brightness alone, which is that of the floor in another
light. What speaks against it is a look at it and at the floor around that shows no difference.

The second colour of a pattern may be black, or the bare floor, whose pixels tell nothing when the
marking is gone. It goes with the first colour: where that has faded, points of the second are
forgotten that none of the first is left for within the largest gap of the pattern.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from navcore.compiled import compiled, nested
from navcore.config.mapping import ClearingRules, FadingConfig, FadingRules
from navcore.geometry.arrays import FloatImage, Floats, Indices, Points
from navcore.geometry.camera import Pinhole
from navcore.geometry.transform import Matrix, invert
from navcore.mapping.points.near_look import near_pixel
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_table import PointTable
from navcore.mission.beware_list import NOTHING, BewareList, ColourRule
from navcore.perception.colour_segmenter import matches_colour
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

_REACH_WIDTHS = 2.0
"""How far around a line the brightness of the floor is looked at, in widths of the line."""
_LINE_CONTRAST = 0.25
"""Share of the least contrast of a line below which a pixel is none: the line itself is part of
what is around it."""
UNKNOWN_LOOKS = 255
"""Looks of a point from a map file that does not say them: as many as there can be."""


def faded(
    points: PointTable,
    held: Indices,
    frame: Frame,
    labels: Labels,
    lines: FloatImage,
    config: FadingConfig,
    clearing: ClearingRules,
) -> Indices:
    """Count one more look at the certain flat ones of (N,) `held` points; return those to forget.

    A point is shown if any source of the labels shows its class at its pixel or beside. `lines` is
    that of `line_limits`.
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
        lines,
        clearing,
        config.rules,
    )


def line_limits(beware: BewareList) -> FloatImage:
    """Return (256, 2) least contrast and largest width in metres by the id of classes that are
    bright lines and no pattern, 0 for all others."""
    limits = np.zeros((256, 2), dtype=np.float32)
    for entry in beware.classes:
        rule = entry.colour
        if entry.enabled and rule is not None and rule.pattern is None and rule.line is not None:
            limits[entry.class_id] = rule.line.min_contrast, rule.line.max_width_m
    return limits


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
    lines: FloatImage,
    clearing: ClearingRules,
    fading: FadingRules,
) -> Indices:
    height, width = depth_m.shape
    camera_z_m = -(t[0, 2] * t[0, 3] + t[1, 2] * t[1, 3] + t[2, 2] * t[2, 3])
    forget = [np.int64(0) for _ in range(0)]
    for index in held:
        point = records[index]
        if point.class_id == NOTHING or point.confidence < 1 or point.z >= clearing.flat_m:
            continue
        i, j, depth = near_pixel(point, depth_m, t, lens, clearing, fading)
        if i < 1 or i > height - 2 or j < 1 or j > width - 2:
            continue
        looks = min(int(point.looks), fading.most)
        if _is_shown(class_ids, i, j, point.class_id):
            looks = min(looks + 1, fading.most)
        elif lines[point.class_id, 0] > 0:
            contrast, width_m = lines[point.class_id]
            # The floor is seen at an angle: what is around reaches over fewer rows than columns.
            reach_px = _REACH_WIDTHS * width_m * lens.fx / depth
            rows = math.ceil(reach_px * min((camera_z_m - point.z) / depth, 1.0))
            if _is_no_brighter(rgb, i, j, (rows, math.ceil(reach_px)), contrast, fading):
                looks -= 1
        elif _is_another_colour(rgb, i, j, point, fading):
            looks -= 1
        if looks != point.looks:
            records[index].looks = looks
            changed[index] = True
        if looks <= 0:
            forget.append(index)
    return np.array(forget, dtype=np.int64)


@nested
def _is_shown(class_ids: npt.NDArray[np.uint8], i: int, j: int, class_id: int) -> bool:
    for source in range(len(class_ids)):
        for r in range(i - 1, i + 2):
            for c in range(j - 1, j + 2):
                if class_ids[source, r, c] == class_id:
                    return True
    return False


@nested
def _is_no_brighter(
    rgb: npt.NDArray[np.uint8],
    i: int,
    j: int,
    reach: tuple[int, int],
    contrast: float,
    fading: FadingRules,
) -> bool:
    """Return whether a pixel and those beside it are not brighter than what is around, within a
    reach of rows and columns that the image must hold, by a part of a contrast."""
    rows, cols = reach
    if i < rows or i >= rgb.shape[0] - rows or j < cols or j >= rgb.shape[1] - cols:
        return False
    own = 0
    for r in range(i - 1, i + 2):
        for c in range(j - 1, j + 2):
            own = max(own, max(rgb[r, c, 0], rgb[r, c, 1], rgb[r, c, 2]))
    if 3 * own < fading.dark:
        return False
    total, count = 0, 0
    step = max(rows // 4, 1), max(cols // 4, 1)
    for r in range(i - rows, i + rows + 1, step[0]):
        for c in range(j - cols, j + cols + 1, step[1]):
            total += max(rgb[r, c, 0], rgb[r, c, 1], rgb[r, c, 2])
            count += 1
    return own * count < (1.0 + _LINE_CONTRAST * contrast) * total


@nested
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
