"""How sure the map is of what a network has seen: every look at a place speaks for or against it.

A network errs now and then, and a place that it took for a thing once must not bind the robot for
ever; a thing that it found in many pictures must not be lost when it misses one. So each point's
confidence is a probability that looks add to in log-odds (Thrun, Burgard, Fox: Probabilistic
Robotics, 4.2): half of what the network claims, for pictures that follow one another err alike.
What is certain (confidence 1: the rules of colour) is never weighed.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.mapping.clearing import pixel_of
from navcore.mapping.point_table import Cells, Records
from navcore.mapping.voxels import Box
from navcore.mission.beware_list import NOTHING
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

PRIOR = -1.0
"""Log-odds of a thing in a place that was never seen before."""
OVERLOOKED = -2.0
"""Log-odds in a place that earlier pictures have shown, and in which nothing was found: one look is
not enough there."""
CLAIM = 0.5
"""Share of the network's log-odds that one look is worth."""
MISS = 0.25
"""What a look that shows the place and finds nothing takes away."""
LEAST, MOST = -2.5, 3.0
"""Beyond these no look goes; a point as unsure as the least is forgotten."""
CERTAIN = 0.95
"""As sure as the map can be of what a network saw (the logistic of `MOST`, rounded down): more
cannot be asked of it."""
TRUSTED_M = 4.0
"""Further away a network may well overlook a small thing."""
BORDER_PX = 8
"""Nor does it see much of a thing at the border of the picture."""
Confidence = npt.NDArray[np.float32]


def initial_confidence(confidence: Confidence, shown_before: npt.NDArray[np.bool_]) -> Confidence:
    """(N,) how sure to be of points that the network is so sure of and that were never found
    before; 1 stays 1.

    `shown_before`: (N,) whether earlier pictures have shown the place.
    """
    claimed = np.clip(confidence.astype(np.float64), 0.01, 0.99)
    odds = np.where(shown_before, OVERLOOKED, PRIOR) + CLAIM * np.log(claimed / (1 - claimed))
    return np.where(confidence >= 1, np.float32(1), 1 / (1 + np.exp(-odds))).astype(np.float32)


def update_confidence(
    records: Records,
    first: Cells,
    cols: int,
    box: Box,
    frame: Frame,
    T_camera_map: npt.NDArray[np.float64],
    labels: Labels,
    clearing: npt.NDArray[np.float64],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Let one picture speak for or against the points of beware classes it shows; changes their
    confidence.

    Returns the indices of the points to forget, and the cells in which a confidence has changed.
    `clearing` is constant and factor of the depth's tolerance, `T_camera_map` (4, 4). `labels` are
    the network's own claims.
    """
    lens = frame.intrinsics
    return _weigh(
        records,
        first,
        cols,
        box,
        frame.depth_m,
        T_camera_map,
        np.array([lens.fx, lens.fy, lens.cx, lens.cy]),
        labels.class_ids,
        labels.confidence,
        clearing,
    )


@compiled
def _weighed(confidence: float, claim: float) -> float:
    """Log-odds after one more look, in which the network is so sure of the thing; 0 when it finds
    nothing."""
    odds = math.log(max(confidence, 0.01) / max(1 - confidence, 0.01))
    if claim == 0.0:
        return max(odds - MISS, LEAST)
    claim = min(max(claim, 0.01), 0.99)
    return min(odds + CLAIM * math.log(claim / (1 - claim)), MOST)


@compiled
def _weigh(
    records: Records,
    first: Cells,
    cols: int,
    box: Box,
    depth_m: npt.NDArray[np.float32],
    t: npt.NDArray[np.float64],
    lens: npt.NDArray[np.float64],
    class_ids: npt.NDArray[np.uint8],
    confidence: Confidence,
    clearing: npt.NDArray[np.float64],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    height, width = depth_m.shape
    forget, cells = [np.int64(0) for _ in range(0)], [np.int64(0) for _ in range(0)]
    for row in range(box[0], box[2]):
        for col in range(box[1], box[3]):
            at = first[row * cols + col]
            while at > 0:
                index = at - 1
                at = records[index].next
                if records[index].class_id == NOTHING or records[index].confidence >= 1:
                    continue
                i, j, depth = pixel_of(records[index], t, lens)
                if depth > TRUSTED_M:
                    continue
                if (
                    i < BORDER_PX
                    or i >= height - BORDER_PX
                    or j < BORDER_PX
                    or j >= width - BORDER_PX
                ):
                    continue
                if (
                    depth_m[i, j] <= 0
                    or abs(depth_m[i, j] - depth) > clearing[0] + clearing[1] * depth * depth
                ):
                    continue
                claim = 0.0
                for r in range(i - 1, i + 2):
                    for c in range(j - 1, j + 2):
                        if class_ids[r, c] == records[index].class_id:
                            claim = max(claim, float(confidence[r, c]))
                odds = _weighed(float(records[index].confidence), claim)
                records[index].confidence = 1 / (1 + math.exp(-odds))
                cells.append(np.int64(row * cols + col))
                if odds <= LEAST:
                    forget.append(np.int64(index))
    return np.array(forget, dtype=np.int64), np.array(cells, dtype=np.int64)
