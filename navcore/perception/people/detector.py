"""What of a picture could be a person: upright clusters of a person's size in plan, and whether
they stand where floor was.

The picture is put on a coarse grid about the camera, in the map frame. The grid remembers for some
seconds where the floor was seen and since when a cell has held something: what has been there for
long is a wall or a chair and belongs to no cluster, and what holds floor that was seen a moment ago
has come there by itself.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.perception.ground import Image, flat
from navcore.robot.frame import Frame

CELL_M = 0.1
"""Side of a cell; cells are counted from the map's origin."""
SIDE = 128
"""The grid has so many cells to a side; beyond, it repeats itself."""
RANGE_M = 5.5
"""Depth beyond this is too coarse."""
FLOOR_RANGE_M = 4.5
"""And floor farther away is seen at too small an angle."""
LOW_M, HIGH_M = 0.10, 1.90
"""Of somebody's body."""
FLOOR_M = 0.06
"""What is measured within this height shows the floor."""
HELD = 4
"""Pixels above the floor that make a cell held."""
FIXED_S = 2.0
"""What a cell has held for so long stands there for good: nobody who walks covers one for as long.
"""
FRESH_S = 4.0
"""A cell is fresh where floor was seen so shortly before it was held."""
FILL_M = 0.6
"""Between two neighbouring pixels of floor nearer to each other than this there is floor."""
LARGEST_M = 1.2
"""Nobody is wider, nor is what else moves about in a crowd."""
RADIUS_M = 0.3
"""Of the disc that somebody takes up, feet and arms included."""
UPRIGHT_M = 0.5
"""Nobody is lower."""
FACE_M, ROUND_FACE = 0.1, 0.785
"""The side of somebody that is seen is so far before his middle; that of something round, by so
much of its radius."""
EDGE = 0.7
"""Of a cell: what lies in two cells so and so far apart is this much wider, in the mean."""
NEARLY = 0.85
"""Of a disc; single cells are missed by the rows of pixels, and hidden by noise."""
SHARE = 0.04
"""Of the pixels that 1 m × 1 m would take up at the same distance, at least; a person seen whole
has some ten times as many."""

Cells = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cluster:
    """Something of a person's size."""

    x_m: float
    """Where its middle may be, map frame."""
    y_m: float
    """The same."""
    range_m: float
    """From the camera, in plan."""
    fresh: float
    """Share of its cells that showed floor a moment before."""
    labelled: float
    """Share of its pixels that the segmenter calls a person."""
    radius_m: float
    """Of the disc that it takes up, by its width as it is seen; a person's at least."""
    cells: Cells
    """(K, 2) row and column of its cells, of `CELL_M` and counted from the map's origin."""
    cut: bool = False
    """Whether it reaches the border of the picture, so that a part of it may be beyond."""


class PersonDetector:
    """Remembers, cell by cell about the camera, when floor was seen and since when something has
    been there."""

    def __init__(self) -> None:
        self._owner: Cells = np.full((SIDE, SIDE), -1, dtype=np.int64)
        self._free_s: Floats = np.full((SIDE, SIDE), -np.inf)
        self._held_s: Floats = np.full((SIDE, SIDE), np.inf)
        self._now_s = np.nan  # equal to no time at which floor was seen, nor to none

    def look(
        self, frame: Frame, named: npt.NDArray[np.bool_], ground_m: Image | None = None
    ) -> list[Cluster]:
        """The clusters of a frame; `named` (H, W) are the pixels that the segmenter calls a person.

        `ground_m` (H, W) is the height of the ground, 0 by default.
        """
        ground_m = flat(frame.depth_m.shape) if ground_m is None else ground_m
        t, lens, now_s = frame.T_map_camera, frame.intrinsics, frame.stamp_ns / 1e9
        origin = np.floor(t[:2, 3] / CELL_M).astype(np.int64) - SIDE // 2  # column, row
        counts, sums = np.zeros((SIDE, SIDE, 3), dtype=np.int32), np.zeros((SIDE, SIDE, 3))
        _bin(
            frame.depth_m,
            ground_m,
            named,
            t,
            np.array([lens.fx, lens.fy, lens.cx, lens.cy]),
            origin,
            counts,
            sums,
        )
        kinds = np.zeros((SIDE, SIDE), dtype=np.uint8)
        # Floor beside something may be its foot, scattered: only what lies amid floor is surely
        # free.
        floor = ((counts[..., 2] > 0) & (counts[..., 0] == 0)).view(np.uint8)
        amid = np.asarray(cv2.erode(floor, np.ones((3, 3), dtype=np.uint8)), dtype=np.uint8)
        self._now_s = now_s
        _recall(counts, floor, amid, origin, now_s, self._owner, self._free_s, self._held_s, kinds)
        loose = ((kinds == _LOOSE) | (kinds == _FRESH)).view(np.uint8)
        eye, focal = t[:2, 3], lens.fx * lens.fy / 2
        found, crowded = _clusters(loose, kinds, counts, sums, origin, eye, focal)
        parts, _ = _clusters(
            (crowded & (kinds == _FRESH)).view(np.uint8), kinds, counts, sums, origin, eye, focal
        )
        return [
            dataclasses.replace(one, cut=not looks_at(frame, one.x_m, one.y_m, _half_width_m(one)))
            for one in found + parts
        ]

    def keep_loose(self, cells: Cells, now_s: float) -> None:
        """What these cells (K, 2) hold does not stand there for good, however long it has."""
        slots = cells[:, 0] % SIDE, cells[:, 1] % SIDE
        self._held_s[slots] = np.where(np.isinf(self._held_s[slots]), np.inf, now_s)

    def newly_occupied(self, cells: Cells, now_s: float) -> Cells:
        """(N, 2) those of the cells (K, 2) that hold something, and have not for long."""
        since_s = now_s - self._held_s[cells[:, 0] % SIDE, cells[:, 1] % SIDE]
        return cells[(since_s >= 0) & (since_s < FIXED_S)]

    def loose_about(self, cells: Cells, now_s: float) -> Cells:
        """(N, 2) the cells (K, 2) and those beside them, without what stands there for good."""
        beside = np.argwhere(np.ones((3, 3))) - 1
        wide = np.unique((cells[:, None] + beside[None]).reshape(-1, 2), axis=0)
        return np.asarray(
            wide[now_s - self._held_s[wide[:, 0] % SIDE, wide[:, 1] % SIDE] < FIXED_S]
        )

    def is_free_floor(self, places: Floats) -> npt.NDArray[np.bool_]:
        """(N,) at which of (N, 2) places of the map frame the newest frame shows floor amid floor,
        and nothing above it.

        They lie no farther from the camera than the grid reaches.
        """
        rows, cols = np.floor(places[:, ::-1] / CELL_M).astype(np.int64).T
        return np.asarray(self._free_s[rows % SIDE, cols % SIDE] == self._now_s)

    def is_floor(self, x_m: float, y_m: float, radius_m: float, now_s: float) -> bool:
        """Whether the newest frame shows floor (nearly) everywhere within a disc of the map frame."""
        rows, cols = cells_within(x_m, y_m, radius_m).T
        return float((self._free_s[rows % SIDE, cols % SIDE] == now_s).mean()) >= NEARLY


_FIXED, _LOOSE, _FRESH = range(1, 4)


def cells_within(x_m: float, y_m: float, radius_m: float) -> Cells:
    """(K, 2) row and column of the cells whose centre lies within a disc of the map frame."""
    reach = math.ceil(radius_m / CELL_M)
    row, col = math.floor(y_m / CELL_M), math.floor(x_m / CELL_M)
    rows, cols = np.mgrid[row - reach : row + reach + 1, col - reach : col + reach + 1]
    within = np.hypot((rows + 0.5) * CELL_M - y_m, (cols + 0.5) * CELL_M - x_m) < radius_m
    return np.column_stack([rows[within], cols[within]])


def looks_at(frame: Frame, x_m: float, y_m: float, half_width_m: float) -> bool:
    """Whether somebody who stood at a place would be before the camera and in its range, with all
    his width."""
    x, _, depth = frame.T_map_camera[:3, :3].T @ (
        np.array([x_m, y_m, 0.5]) - frame.T_map_camera[:3, 3]
    )
    lens = frame.intrinsics
    left, right = (
        (x + aside) * lens.fx + lens.cx * depth for aside in (-half_width_m, half_width_m)
    )
    return bool(0 < depth <= RANGE_M and left >= 0 and right < lens.width * depth)


def _half_width_m(cluster: Cluster) -> float:
    """Half of the longer side of the box about its cells, and half a cell for the border's sake."""
    return float(np.ptp(cluster.cells, axis=0).max() + 2) * CELL_M / 2


def _clusters(
    mask: npt.NDArray[np.uint8],
    kinds: npt.NDArray[np.uint8],
    counts: npt.NDArray[np.int32],
    sums: Floats,
    origin: Cells,
    eye: Floats,
    focal: float,
) -> tuple[list[Cluster], npt.NDArray[np.bool_]]:
    """The person-sized components of a mask, and the cells of those that are too large; `focal` is
    pixels per steradian."""
    total, names, boxes, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    found, crowded = [], np.zeros(mask.shape, dtype=np.bool_)
    for name in range(1, total):
        left, top, wide, high, size = boxes[name]
        if size < 3:
            continue
        part = names[top : top + high, left : left + wide] == name
        if max(wide, high) * CELL_M > LARGEST_M + CELL_M:
            crowded[top : top + high, left : left + wide] |= part
            continue
        window = np.s_[top : top + high, left : left + wide]
        pixels, labelled, _ = counts[window][part].sum(axis=0)
        x_m, y_m = sums[window][part][:, :2].sum(axis=0) / pixels
        range_m = max(math.hypot(x_m - eye[0], y_m - eye[1]), 0.2)
        if sums[window][part][:, 2].max() < UPRIGHT_M or pixels * range_m**2 < SHARE * focal:
            continue
        cells = np.argwhere(part) + np.array([top + origin[1], left + origin[0]])
        radius_m = _radius_m(cells, (x_m - eye[0]) / range_m, (y_m - eye[1]) / range_m)
        # Who is no wider than a person is as deep as one; what is wider is taken to be round.
        away = (
            FACE_M
            + (radius_m - RADIUS_M)
            * (ROUND_FACE * LARGEST_M / 2 - FACE_M)
            / (LARGEST_M / 2 - RADIUS_M)
        ) / range_m
        found.append(
            Cluster(
                x_m=float(x_m + away * (x_m - eye[0])),
                y_m=float(y_m + away * (y_m - eye[1])),
                range_m=range_m,
                fresh=float((kinds[window][part] == _FRESH).mean()),
                labelled=float(labelled / pixels),
                radius_m=radius_m,
                cells=cells,
            )
        )
    return found, crowded


def _radius_m(cells: Cells, ahead_x: float, ahead_y: float) -> float:
    """Half of how far the cells (K, 2) reach across the line of sight, whose direction is given."""
    aside = cells[:, 0] * ahead_x - cells[:, 1] * ahead_y
    return min(max((float(np.ptp(aside)) + EDGE) * CELL_M / 2, RADIUS_M), LARGEST_M / 2)


@compiled
def _bin(
    depth_m: npt.NDArray[np.float32],
    ground_m: npt.NDArray[np.float32],
    named: npt.NDArray[np.bool_],
    t: Floats,
    lens: Floats,
    origin: Cells,
    counts: npt.NDArray[np.int32],
    sums: Floats,
) -> None:
    """Count, in each cell, pixels of bodies, of people and of floor; add up x and y and find the
    top. Every other column."""
    height, width = depth_m.shape
    for j in range(0, width, 2):
        a, floor_before, before_x, before_y = (j - lens[2]) / lens[0], False, 0.0, 0.0
        for i in range(height - 1, -1, -1):
            depth = depth_m[i, j]
            if not 0 < depth <= RANGE_M:
                floor_before = False
                continue
            b = (i - lens[3]) / lens[1]
            x = (t[0, 0] * a + t[0, 1] * b + t[0, 2]) * depth + t[0, 3]
            y = (t[1, 0] * a + t[1, 1] * b + t[1, 2]) * depth + t[1, 3]
            z = (t[2, 0] * a + t[2, 1] * b + t[2, 2]) * depth + t[2, 3] - ground_m[i, j]
            if abs(z) < FLOOR_M and depth <= FLOOR_RANGE_M:
                steps = 1
                if floor_before:
                    gap = math.hypot(x - before_x, y - before_y)
                    steps = max(math.ceil(2 * gap / CELL_M), 1) if gap < FILL_M else 1
                for step in range(steps):
                    share = step / steps
                    col = math.floor((x + share * (before_x - x)) / CELL_M) - origin[0]
                    row = math.floor((y + share * (before_y - y)) / CELL_M) - origin[1]
                    if 0 <= row < SIDE and 0 <= col < SIDE:
                        counts[row, col, 2] += 1
                floor_before, before_x, before_y = True, x, y
                continue
            floor_before = False
            col, row = math.floor(x / CELL_M) - origin[0], math.floor(y / CELL_M) - origin[1]
            if LOW_M < z < HIGH_M and 0 <= row < SIDE and 0 <= col < SIDE:
                counts[row, col, 0] += 1
                counts[row, col, 1] += named[i, j]
                sums[row, col, 0] += x
                sums[row, col, 1] += y
                sums[row, col, 2] = max(sums[row, col, 2], z)


@compiled
def _recall(
    counts: npt.NDArray[np.int32],
    floor: npt.NDArray[np.uint8],
    amid: npt.NDArray[np.uint8],
    origin: Cells,
    now_s: float,
    owner: Cells,
    free_s: Floats,
    held_s: Floats,
    kinds: npt.NDArray[np.uint8],
) -> None:
    """Remember what each cell shows now, and tell what it is."""
    for r in range(SIDE):
        for c in range(SIDE):
            row, col = r + origin[1], c + origin[0]
            at, on, place = row % SIDE, col % SIDE, row * 1_000_003 + col
            if owner[at, on] != place:
                owner[at, on], free_s[at, on], held_s[at, on] = place, -np.inf, np.inf
            if counts[r, c, 0] >= HELD:
                held_s[at, on] = min(held_s[at, on], now_s)
                if now_s - held_s[at, on] >= FIXED_S:
                    kinds[r, c] = _FIXED
                else:
                    kinds[r, c] = _FRESH if held_s[at, on] - free_s[at, on] < FRESH_S else _LOOSE
            elif floor[r, c]:
                held_s[at, on] = np.inf
                if amid[r, c]:
                    free_s[at, on] = now_s
