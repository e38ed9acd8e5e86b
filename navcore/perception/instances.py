"""What of a labelled picture is one thing of the beware list, and where on the map it lies."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.mission.beware_list import NOTHING, BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

RANGE_M = 5.0
"""Depth beyond this is too coarse to say where something lies."""
MIN_PIXELS = 40
"""A smaller region is no sighting."""
MAX_REGIONS = 24
"""In one picture; the largest are taken."""
CELL_M = 0.2
"""Places are compared in squares of this side: two things of a class that are nearer to each other
count as one."""

Cells = frozenset[tuple[int, int]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Detection:
    """A connected region of one class in one picture."""

    class_id: int
    """Of the beware list."""
    mask: npt.NDArray[np.bool_]
    """(H, W) its pixels."""
    box: tuple[int, int, int, int]
    """(left, top, right, bottom) pixels, right and bottom excluded."""
    confidence: float
    """Mean over its pixels."""
    place: tuple[float, float]
    """(x, y) in metres of the map frame: the median of its measured pixels."""
    cells: Cells
    """Squares (row, col) of `CELL_M`, counted from the map's origin, that it lies on."""


def recognised(frame: Frame, labels: Labels, beware: BewareList) -> tuple[Detection, ...]:
    """The regions that bind the robot, the largest first; without those of too little measured
    depth, and without people."""
    binding = labels.mask(beware)
    found: list[tuple[int, int, npt.NDArray[np.bool_]]] = []
    for class_id in np.unique(labels.class_ids[binding]):
        if class_id in (NOTHING, *beware.people_ids):
            continue
        mask = (binding & (labels.class_ids == class_id)).view(np.uint8)
        count, names, boxes, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        sizes = boxes[:, cv2.CC_STAT_AREA]
        found += [
            (int(sizes[name]), int(class_id), names == name)
            for name in range(1, count)
            if sizes[name] >= MIN_PIXELS
        ]
    found.sort(key=lambda region: -region[0])
    regions = (_placed(frame, labels, class_id, mask) for _, class_id, mask in found[:MAX_REGIONS])
    return tuple(region for region in regions if region is not None)


def _placed(
    frame: Frame, labels: Labels, class_id: int, mask: npt.NDArray[np.bool_]
) -> Detection | None:
    rows, cols = np.nonzero(mask & (frame.depth_m > 0) & (frame.depth_m <= RANGE_M))
    if len(rows) < MIN_PIXELS // 2:
        return None
    depth, lens = frame.depth_m[rows, cols].astype(np.float64), frame.intrinsics
    points = np.column_stack(
        [(cols - lens.cx) / lens.fx * depth, (rows - lens.cy) / lens.fy * depth, depth]
    )
    xy = points @ frame.T_map_camera[:2, :3].T + frame.T_map_camera[:2, 3]
    squares, counts = np.unique(
        np.floor(xy / CELL_M).astype(np.int64)[:, ::-1], axis=0, return_counts=True
    )
    # The rim of a thing mixes its depth with what is behind: squares that few pixels fall into are
    # no place of it.
    kept = squares[counts >= max(3, 0.02 * len(rows))]
    x_m, y_m = np.median(xy, axis=0)
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    return Detection(
        class_id=class_id,
        mask=mask,
        box=(left, top, left + width, top + height),
        confidence=float(labels.confidence[mask].mean()),
        place=(float(x_m), float(y_m)),
        cells=frozenset((int(row), int(col)) for row, col in kept),
    )
