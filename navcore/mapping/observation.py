"""From depth to points: what stands in the way, what is to beware of, and what of the world has
been seen at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.config.perception import ObservationConfig
from navcore.geometry.camera import Intrinsics
from navcore.grid.grid import GridSpec
from navcore.mapping.voxels import Box, DepthView, depth_view, measured_voxels, voxels_of
from navcore.mission.beware_list import LARGEST_CLASS_ID, NOTHING, BewareList
from navcore.perception.ground import Image
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """What one frame adds to the map: one point per voxel (a grid cell × 5 cm of height) and class."""

    points_map: npt.NDArray[np.float32]
    """(N, 3) metres of the map frame."""
    class_ids: npt.NDArray[np.uint8]
    """(N,) class of the beware list; `NOTHING` for geometric points."""
    confidence: npt.NDArray[np.float32]
    """(N,) of the segmenter; 1 for geometric points."""
    rgb: npt.NDArray[np.uint8]
    """(N, 3) colour."""
    range_m: npt.NDArray[np.float32]
    """(N,) depth at which it was measured; the nearer, the better."""
    max_range_m: float
    """Depth beyond this was not looked at …"""
    box: Box
    """… and nothing outside of this part of the grid."""
    cells_seen: npt.NDArray[np.int64]
    """(K,) every cell, row · cols + col, in which anything was measured, floor and ceiling too …"""
    heights_seen: npt.NDArray[np.uint64]
    """… and (K,) a bit for each height bin in which it was."""


def back_project(
    depth_m: npt.NDArray[np.floating], intrinsics: Intrinsics
) -> npt.NDArray[np.float64]:
    """(N, 3) points of all measured pixels, row by row, in the optical frame (the paper's equations
    1 to 3).

    X = (j − cx)·Z/fx, Y = (i − cy)·Z/fy, Z = depth of row i, column j. Pixels without a finite
    positive depth are left out.
    """
    rows, cols = np.nonzero(np.isfinite(depth_m) & (depth_m > 0))
    z = depth_m[rows, cols].astype(np.float64)
    return np.column_stack(
        [(cols - intrinsics.cx) * z / intrinsics.fx, (rows - intrinsics.cy) * z / intrinsics.fy, z]
    )


def observe(
    frame: Frame,
    labels: Labels,
    beware: BewareList,
    spec: GridSpec,
    rules: ObservationConfig,
    ground_m: Image | None = None,
) -> Observation:
    """The frame's points on the map: geometric ones by height, beware ones by label at any height
    their rule allows.

    Heights are those above the ground, `ground_m` (H, W) as `terrain.ground_heights` makes it, by
    default the plane on which the robot stands; what goes onto the map keeps its place in space. A
    point of a beware class that is also higher than the obstacle height counts twice, as both: it
    stays an obstacle when its class is switched off.
    """
    for claim in labels.all_hypotheses:
        if claim.class_ids.shape != frame.depth_m.shape:
            raise ValueError(
                f"labels must be {frame.depth_m.shape} class ids, got {claim.class_ids.shape}"
            )
        if not np.isfinite(claim.confidence.sum()):
            raise ValueError("the labels' confidence is not finite, expected 0 to 1 in every pixel")
    camera, intrinsics = frame.T_map_camera, frame.intrinsics
    looked = depth_view(frame, spec, rules.max_range_m, ground_m)
    geometric, seen = measured_voxels(
        looked, (rules.obstacle_height_m, rules.ceiling_m, -rules.drop_m), rules.min_support
    )
    heights_m, named = _max_heights(beware), []
    for claim in labels.all_hypotheses:
        of_claim = _labelled(claim.class_ids, looked, heights_m, rules.min_support)
        named.append(
            (
                of_claim,
                claim.class_ids.reshape(-1)[of_claim],
                claim.confidence.reshape(-1)[of_claim],
            )
        )
    pixels = np.concatenate([geometric, *(of_claim for of_claim, _, _ in named)]).astype(np.int64)
    class_ids = np.concatenate(
        [np.full(len(geometric), NOTHING, dtype=np.uint8), *(kinds for _, kinds, _ in named)]
    )
    confidence = np.concatenate(
        [np.ones(len(geometric), dtype=np.float32), *(sure for _, _, sure in named)]
    )
    rows, cols = np.divmod(pixels, intrinsics.width)
    depth = frame.depth_m.reshape(-1)[pixels]
    optical = np.column_stack(
        [
            (cols - intrinsics.cx) * depth / intrinsics.fx,
            (rows - intrinsics.cy) * depth / intrinsics.fy,
            depth,
        ]
    )
    return Observation(
        points_map=(optical @ camera[:3, :3].T + camera[:3, 3]).astype(np.float32),
        class_ids=class_ids,
        confidence=confidence,
        rgb=frame.rgb.reshape(-1, 3)[pixels],
        range_m=depth,
        max_range_m=rules.max_range_m,
        box=looked.box,
        cells_seen=_on_the_grid(np.flatnonzero(seen), looked, spec),
        heights_seen=seen[seen != 0],
    )


def _labelled(
    class_ids: npt.NDArray[np.uint8],
    looked: DepthView,
    heights_m: npt.NDArray[np.float64],
    min_support: int,
) -> npt.NDArray[np.int32]:
    """For each class in the picture one pixel of each of its voxels, up to the class's height."""
    flat = class_ids.reshape(-1)
    named = np.flatnonzero(flat != NOTHING)
    kinds = flat[named]
    if len(kinds) and kinds.max() > LARGEST_CLASS_ID:
        raise ValueError(f"labels must be class ids of 0 to {LARGEST_CLASS_ID}, got {kinds.max()}")
    found = [
        voxels_of(looked, named[kinds == kind], heights_m[kind], min_support)
        for kind in np.flatnonzero(np.bincount(kinds, minlength=64))
    ]
    return np.concatenate([np.empty(0, dtype=np.int32), *found])


def _on_the_grid(
    cells: npt.NDArray[np.int64], looked: DepthView, spec: GridSpec
) -> npt.NDArray[np.int64]:
    """Cells of the box as cells of the grid."""
    rows, cols = np.divmod(cells, max(looked.shape[1], 1))
    return np.asarray((rows + looked.box[0]) * spec.cols + (cols + looked.box[1]))


def _max_heights(beware: BewareList) -> npt.NDArray[np.float64]:
    """(64,) up to which height each class counts; those that a network may find at every height."""
    heights = np.full(64, np.inf)
    for entry in beware.classes:
        if entry.colour is not None and not entry.colour.fallback:
            heights[entry.class_id] = entry.colour.max_height_m
    return heights
