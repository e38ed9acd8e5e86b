"""Rejections: where an operator said that a detection is not one of its class.

A rejection holds for the positions that the detection covered, in the base frame of the pose from
which they were seen, so that it moves with the map. Labels of its class there count only with
better evidence: the log-odds of their region's mean confidence must exceed those of the rejected
looks by `RejectionConfig.margin`. Nothing exceeds certainty, so that a colour rule stays silent
there until the rejection is taken back.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.config.mapping import RejectionConfig
from navcore.geometry.arrays import Bools, Floats, Indices, Points
from navcore.geometry.camera import back_project_pixels
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import NOTHING
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

MAX_REJECTIONS = 500
"""Largest number of rejections on a map."""
MAX_POINTS = 10_000
"""Largest number of positions of a rejection."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rejection:
    """One detection that was rejected."""

    id: int
    """Number of the rejection, on this map alone; 0 for one that has none yet."""
    class_id: int
    """Class that is not there."""
    confidence: float
    """Highest confidence of the looks that were rejected, 0 to 1."""
    pose_id: int
    """Pose ID with which the positions move."""
    points_base: npt.NDArray[np.float32]
    """(N, 2) positions in metres of the base frame at that pose."""


_Bars = dict[int, tuple[Indices, Floats]]


class Rejections:
    """All rejections of a map. One thread changes them; any may read `all` and `places`."""

    def __init__(self, config: RejectionConfig) -> None:
        self._config = config
        self.all: tuple[Rejection, ...] = ()
        """The rejections, oldest first."""
        self.places: dict[int, tuple[float, float]] = {}
        """Middle of each rejection in metres of the map frame, by id."""
        # Together, since threads read them that change nothing.
        self._placed: tuple[GridSpec | None, _Bars] = None, {}
        self._next_id = 1

    def cells_around(self, points: Points, spec: GridSpec) -> Indices:
        """Return the (K,) cells, row · cols + col, of a grid within `around_m` of (N, 2) positions
        in metres."""
        reach = math.ceil(self._config.around_m / spec.resolution_m)
        steps = np.arange(-reach, reach + 1)
        rows, cols = (steps.reshape(shape) for shape in ((-1, 1), (1, -1)))
        near = rows**2 + cols**2 <= reach**2
        offsets = np.argwhere(near) - reach
        origin = np.array([spec.origin_y_m, spec.origin_x_m])
        own = np.floor((points[:, ::-1] - origin) / spec.resolution_m).astype(np.int64)
        cells = (np.unique(own, axis=0)[:, None] + offsets).reshape(-1, 2)
        on_grid = ((cells >= 0) & (cells < (spec.rows, spec.cols))).all(axis=1)
        return np.unique(cells[on_grid] @ np.array([spec.cols, 1]))

    def check_room(self, positions: int) -> None:
        """Raise `ValueError` where no rejection of so many positions can be added."""
        if len(self.all) >= MAX_REJECTIONS or positions > MAX_POINTS:
            raise ValueError(f"at most {MAX_REJECTIONS} rejections of {MAX_POINTS} positions")

    def add(self, rejection: Rejection, rows: Floats, spec: GridSpec) -> Rejection:
        """Add a rejection and return it, with a new number unless it has one; `rows` and `spec` as
        for `place`. Raises `ValueError` when there are too many, and for an unknown pose ID."""
        self.check_room(len(rejection.points_base))
        if not 0 <= rejection.pose_id < len(rows):
            raise ValueError(
                f"pose ID {rejection.pose_id} is not on the map, which has {len(rows)}"
            )
        added = rejection
        if not rejection.id:
            added = dataclasses.replace(rejection, id=self._next_id)
            self._next_id += 1
        self.all = (*self.all, added)
        self.place(rows, spec)
        return added

    def remove(self, rejection_id: int, rows: Floats, spec: GridSpec) -> Rejection | None:
        """Remove a rejection and return it; None for an unknown number."""
        removed = next((one for one in self.all if one.id == rejection_id), None)
        self.all = tuple(one for one in self.all if one.id != rejection_id)
        self.place(rows, spec)
        return removed

    def load(self, stored: tuple[Rejection, ...], rows: Floats, spec: GridSpec) -> None:
        """Replace all rejections; those without a number get one."""
        self.all = tuple(
            dataclasses.replace(one, id=one.id or i) for i, one in enumerate(stored, 1)
        )
        self._next_id = max([self._next_id, *(one.id + 1 for one in self.all)])
        self.place(rows, spec)

    def place(self, rows: Floats, spec: GridSpec) -> None:
        """Compute the cells of all rejections on a grid; `rows`: (P, 4) `pose_rows` of all pose
        IDs."""
        places = {}
        found: dict[int, list[tuple[Indices, float]]] = {}
        for one in self.all:
            x_m, y_m, cos, sin = rows[one.pose_id]
            turn = np.array([[cos, sin], [-sin, cos]])
            points = one.points_base.astype(np.float64) @ turn + (x_m, y_m)
            places[one.id] = (float(points[:, 0].mean()), float(points[:, 1].mean()))
            bar = _log_odds(np.array([one.confidence]))[0] + self._config.margin
            found.setdefault(one.class_id, []).append((self.cells_around(points, spec), bar))
        self.places = places
        self._placed = spec, {class_id: _highest(parts) for class_id, parts in found.items()}

    def without(self, frame: Frame, labels: Labels) -> Labels:
        """Return the labels of a frame, which is placed in the map, without those that were
        rejected."""
        spec, bars = self._placed
        if spec is None or not bars:
            return labels
        struck = tuple(_struck(frame, one, spec, bars) for one in labels.hypotheses)
        fused = _struck(frame, labels, spec, bars)
        if struck and fused is not labels:
            # What the rejected label had covered is seen again.
            class_ids, confidence = fused.class_ids.copy(), fused.confidence.copy()
            for one in struck:
                bare = (labels.class_ids != NOTHING) & (class_ids == NOTHING)
                class_ids[bare], confidence[bare] = one.class_ids[bare], one.confidence[bare]
            fused = dataclasses.replace(fused, class_ids=class_ids, confidence=confidence)
        return dataclasses.replace(fused, hypotheses=struck)


def _struck(frame: Frame, labels: Labels, spec: GridSpec, bars_of: _Bars) -> Labels:
    """Return the labels of one source without those that were rejected; the same ones where
    there are none."""
    class_ids = labels.class_ids
    for class_id, (cells, bars) in bars_of.items():
        mask = labels.class_ids == class_id
        rows, cols = np.nonzero(mask & (frame.depth_m > 0))
        if not len(cells) or not len(rows):
            continue
        at = np.minimum(
            np.searchsorted(cells, own := _cells(frame, rows, cols, spec)), len(cells) - 1
        )
        claims = _claims(mask, labels.confidence)[rows, cols]
        gone = (cells[at] == own) & (claims <= bars[at])
        if gone.any():
            class_ids = class_ids.copy() if class_ids is labels.class_ids else class_ids
            class_ids[rows[gone], cols[gone]] = NOTHING
    if class_ids is labels.class_ids:
        return labels
    return dataclasses.replace(labels, class_ids=class_ids)


def _cells(frame: Frame, rows: Indices, cols: Indices, spec: GridSpec) -> Indices:
    """Return the (N,) cells of measured pixels, row · cols + col; −1 beside the grid."""
    optical = back_project_pixels(rows, cols, frame.depth_m[rows, cols], frame.intrinsics)
    xy = optical @ frame.T_map_camera[:2, :3].T + frame.T_map_camera[:2, 3]
    row = np.floor((xy[:, 1] - spec.origin_y_m) / spec.resolution_m).astype(np.int64)
    col = np.floor((xy[:, 0] - spec.origin_x_m) / spec.resolution_m).astype(np.int64)
    on_grid = (row >= 0) & (row < spec.rows) & (col >= 0) & (col < spec.cols)
    return np.where(on_grid, row * spec.cols + col, -1)


def _claims(mask: Bools, confidence: npt.NDArray[np.float32]) -> Floats:
    """Return (H, W) the log-odds of the mean confidence of the region that each pixel is in."""
    count, regions = cv2.connectedComponents(mask.view(np.uint8), connectivity=8)
    of_region = regions[mask]
    sums = np.bincount(of_region, weights=confidence[mask], minlength=count)
    sizes = np.maximum(np.bincount(of_region, minlength=count), 1)
    return np.asarray(_log_odds(sums / sizes)[regions])


def _log_odds(confidence: Floats) -> Floats:
    """Return the log-odds of (N,) confidences; infinite for certainty."""
    certain = confidence >= 1
    within = np.clip(confidence, 0.01, 1 - 1e-6)
    return np.where(certain, np.inf, np.log(within / (1 - within)))


def _highest(parts: list[tuple[Indices, float]]) -> tuple[Indices, Floats]:
    """Return the (K,) cells of some areas, ascending, with the highest bar of each."""
    cells = np.concatenate([own for own, _ in parts])
    bars = np.concatenate([np.full(len(own), bar) for own, bar in parts])
    order = np.lexsort((-bars, cells))
    kept, first = np.unique(cells[order], return_index=True)
    return kept, bars[order][first]
