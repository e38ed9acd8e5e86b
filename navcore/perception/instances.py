"""Instances of the beware list: connected regions of the labels, and where on the map they lie."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from navcore.config.perception.perception import DEFAULT_PERCEPTION, InstancesConfig
from navcore.geometry.arrays import Bools
from navcore.geometry.camera import pixel_rays
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

_DEFAULT = DEFAULT_PERCEPTION.instances
CELL_M = 0.2
"""Side in metres of the cells in which positions are compared: two objects of a class that are
nearer to each other count as one."""

Cells = frozenset[tuple[int, int]]
"""Cells (row, col) of `CELL_M`, counted from the origin of the map."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Detection:
    """A connected region of one class in one image."""

    class_id: int
    """Class id of the beware list."""
    mask: Bools
    """(H, W) pixels of the region."""
    box: tuple[int, int, int, int]
    """Bounding box (left, top, right, bottom) in pixels, right and bottom excluded."""
    confidence: float
    """Mean confidence of its pixels, 0 to 1."""
    position: tuple[float, float]
    """(x, y) in metres of the map frame: the median of its measured pixels."""
    cells: Cells
    """Cells (row, col) of `CELL_M` that it lies on, counted from the origin of the map."""


def detect_instances(
    frame: Frame, labels: Labels, beware: BewareList, config: InstancesConfig = _DEFAULT
) -> tuple[Detection, ...]:
    """Return the regions that bind the robot, the largest first, without people and without regions
    of too few measured pixels."""
    binding, min_pixels = labels.mask(beware), frame.intrinsics.area_px(config.min_pixels)
    found: list[tuple[int, int, Bools]] = []
    for class_id in np.unique(labels.class_ids[binding]):
        if class_id in (NOTHING, *beware.people_ids):
            continue
        mask = (binding & (labels.class_ids == class_id)).view(np.uint8)
        count, names, boxes, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        sizes = boxes[:, cv2.CC_STAT_AREA]
        found += [
            (int(sizes[name]), int(class_id), names == name)
            for name in range(1, count)
            if sizes[name] >= min_pixels
        ]
    found.sort(key=lambda region: -region[0])
    regions = (
        _detection(frame, labels, class_id, mask, config)
        for _, class_id, mask in found[: config.max_regions]
    )
    return tuple(region for region in regions if region is not None)


def _detection(
    frame: Frame, labels: Labels, class_id: int, mask: Bools, config: InstancesConfig
) -> Detection | None:
    """Return a region with its position; None when too few of its pixels are measured."""
    measured = mask & (frame.depth_m > 0) & (frame.depth_m <= config.max_range_m)
    rows, cols = np.nonzero(measured)
    lens = frame.intrinsics
    if len(rows) < lens.area_px(config.min_pixels) // 2:
        return None
    depth = frame.depth_m[rows, cols].astype(np.float64)
    points = pixel_rays(rows, cols, lens) * depth[:, None]
    xy = points @ frame.T_map_camera[:2, :3].T + frame.T_map_camera[:2, 3]
    cells, counts = np.unique(
        np.floor(xy / CELL_M).astype(np.int64)[:, ::-1], axis=0, return_counts=True
    )
    # The rim of an object mixes its depth with the background: cells with few pixels do not belong
    # to it.
    least = lens.area_px(config.min_cell_pixels)
    kept = cells[counts >= max(least, config.min_cell_share * len(rows))]
    x_m, y_m = np.median(xy, axis=0)
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    return Detection(
        class_id=class_id,
        mask=mask,
        box=(left, top, left + width, top + height),
        confidence=float(labels.confidence[mask].mean(dtype=np.float64)),
        position=(float(x_m), float(y_m)),
        cells=frozenset((int(row), int(col)) for row, col in kept),
    )
