"""Observation: the geometric and beware points of one frame, and the space that it measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.arrays import FloatImage
from navcore.geometry.camera import back_project_pixels
from navcore.grid.grid import Box, GridSpec
from navcore.mapping.views.drop_edges import drop_edges
from navcore.mapping.views.voxels import DepthView, depth_view, measured_voxels, voxels_of
from navcore.mission.beware_list import LARGEST_CLASS_ID, NOTHING, BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """Points that one frame adds to the map, one per voxel (a grid cell × 5 cm) and class."""

    points_map: npt.NDArray[np.float32]
    """(N, 3) positions in metres of the map frame."""
    class_ids: npt.NDArray[np.uint8]
    """(N,) classes of the beware list; `NOTHING` for geometric points."""
    confidence: npt.NDArray[np.float32]
    """(N,) confidence of the segmenter, 0 to 1; 1 for geometric points."""
    rgb: npt.NDArray[np.uint8]
    """(N, 3) colours."""
    range_m: npt.NDArray[np.float32]
    """(N,) depth in metres at which each point was measured."""
    max_range_m: float
    """Largest depth in metres that was used."""
    ground_m: FloatImage
    """(H, W), or (1, W) for all rows alike: height in metres of the ground below each pixel."""
    spec: GridSpec
    """Grid of the box and of the cells."""
    box: Box
    """Part of the grid that the camera can measure."""
    cells_seen: npt.NDArray[np.int64]
    """(K,) all cells, row · cols + col, in which a surface was measured, floor and ceiling too."""
    heights_seen: npt.NDArray[np.uint64]
    """(K,) one bit for each height bin in which a surface was measured, for each of these cells."""


def observe(
    frame: Frame,
    labels: Labels,
    beware: BewareList,
    spec: GridSpec,
    rules: ObservationConfig,
    ground_m: FloatImage | None = None,
) -> Observation:
    """Return the frame's points: geometric ones by height, beware ones by label at any height that
    their rule allows.

    Heights are above the ground, `ground_m` of `ground.ground_heights`, by default the plane
    on which the robot stands; the points keep their position in space. A point of a beware class
    that is higher than the obstacle height counts as both: it stays an obstacle when its class is
    disabled. Raises `ValueError` for labels of a wrong shape or class, or a confidence that is not
    finite.
    """
    for hypothesis in labels.all_hypotheses:
        if hypothesis.class_ids.shape != frame.depth_m.shape:
            raise ValueError(
                f"labels must be {frame.depth_m.shape} class ids, got {hypothesis.class_ids.shape}"
            )
        if not np.isfinite(hypothesis.confidence.sum()):
            raise ValueError(
                "confidence of the labels is not finite, expected 0 to 1 in every pixel"
            )
    camera, intrinsics = frame.T_map_camera, frame.intrinsics
    view = depth_view(frame, spec, rules.max_range_m, ground_m)
    edges = drop_edges(view, spec.resolution_m, rules)
    geometric, seen = measured_voxels(
        view,
        (rules.obstacle_height_m, rules.ceiling_m, -rules.drop_m),
        rules.min_support,
        edges.lower_level,
    )
    measured = np.flatnonzero(seen != 0)  # of truth values: those of words take five times as long
    geometric = np.concatenate([geometric, edges.pixels])
    heights_m, named = _max_heights(beware), []
    for hypothesis in labels.all_hypotheses:
        of_source = _labelled(hypothesis.class_ids, view, heights_m, rules.min_support)
        named.append(
            (
                of_source,
                hypothesis.class_ids.reshape(-1)[of_source],
                hypothesis.confidence.reshape(-1)[of_source],
            )
        )
    pixels = np.concatenate([geometric, *(of_source for of_source, _, _ in named)]).astype(np.int64)
    class_ids = np.concatenate(
        [np.full(len(geometric), NOTHING, dtype=np.uint8), *(kinds for _, kinds, _ in named)]
    )
    confidence = np.concatenate(
        [np.ones(len(geometric), dtype=np.float32), *(sure for _, _, sure in named)]
    )
    rows, cols = np.divmod(pixels, intrinsics.width)
    depth = frame.depth_m.reshape(-1)[pixels]
    optical = back_project_pixels(rows, cols, depth, intrinsics)
    return Observation(
        points_map=(optical @ camera[:3, :3].T + camera[:3, 3]).astype(np.float32),
        class_ids=class_ids,
        confidence=confidence,
        rgb=frame.rgb.reshape(-1, 3).take(pixels, axis=0),
        range_m=depth,
        max_range_m=rules.max_range_m,
        ground_m=view.ground_m,
        spec=spec,
        box=view.box,
        cells_seen=_grid_cells(measured, view, spec),
        heights_seen=seen[measured],
    )


def _labelled(
    class_ids: npt.NDArray[np.uint8],
    view: DepthView,
    heights_m: npt.NDArray[np.float64],
    min_support: int,
) -> npt.NDArray[np.int32]:
    """Return for each class in the image one pixel of each of its voxels up to the class's
    height."""
    flat = class_ids.reshape(-1)
    named = np.flatnonzero(flat != NOTHING)
    kinds = flat[named]
    if len(kinds) and kinds.max() > LARGEST_CLASS_ID:
        raise ValueError(f"labels must be class ids of 0 to {LARGEST_CLASS_ID}, got {kinds.max()}")
    found = [
        voxels_of(view, named[kinds == kind], heights_m[kind], min_support)
        for kind in np.flatnonzero(np.bincount(kinds, minlength=64))
    ]
    return np.concatenate([np.empty(0, dtype=np.int32), *found])


def _grid_cells(
    cells: npt.NDArray[np.int64], view: DepthView, spec: GridSpec
) -> npt.NDArray[np.int64]:
    """Return cells of the box as cells of the grid."""
    rows, cols = np.divmod(cells, max(view.shape[1], 1))
    return np.asarray((rows + view.box[0]) * spec.cols + (cols + view.box[1]))


def _max_heights(beware: BewareList) -> npt.NDArray[np.float64]:
    """Return (64,) the height in metres up to which each class counts; infinite where a network may
    detect the class."""
    heights = np.full(64, np.inf)
    for entry in beware.classes:
        if entry.colour is not None and not entry.colour.fallback:
            heights[entry.class_id] = entry.colour.max_height_m
    return heights
