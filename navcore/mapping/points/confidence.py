"""Confidence of beware points: every image of a position speaks for or against them.

A network errs now and then. One false detection must not bind the robot for ever, and an object
found in many images must not be lost when one misses it. So a point's confidence is a probability
that images add to in log-odds (Thrun, Burgard, Fox: Probabilistic Robotics, 4.2), with a share of
what the network claims, because consecutive images err alike. Certain points (confidence 1: the
colour rules) keep their confidence; flat ones fade instead (`fading.py`). Silence speaks against a
point only where its class could have been shown: not while nothing recognises the class, and not
at a pixel without a colour.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, nested
from navcore.config.mapping import ClearingRules, ConfidenceConfig
from navcore.geometry.arrays import Bools, FloatImage, Indices
from navcore.geometry.camera import Pinhole
from navcore.geometry.transform import Matrix, invert
from navcore.mapping.points.clearing import pixel_of
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_table import PointTable
from navcore.mission.beware_list import NOTHING
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

Confidence = npt.NDArray[np.float32]
ALL_RECOGNISED = np.ones(256, dtype=np.bool_)
"""All classes are recognised."""
_NONE = np.zeros((0, 0), dtype=np.bool_)


class _LogOdds(NamedTuple):
    """Steps and limits of an update in log-odds, as compiled kernels take them."""

    claim_share: float
    miss: float
    least: float
    most: float


def initial_confidence(
    confidence: Confidence, shown_before: Bools, config: ConfidenceConfig
) -> Confidence:
    """Return the (N,) confidence of points detected for the first time; certain ones stay at 1.

    `confidence`: (N,) of the network, 0 to 1. `shown_before`: (N,) whether earlier images have
    shown the position.
    """
    claimed = np.clip(confidence.astype(np.float64), 0.01, 0.99)
    odds = np.where(shown_before, config.overlooked, config.prior) + config.claim_share * np.log(
        claimed / (1 - claimed)
    )
    return np.where(confidence >= 1, np.float32(1), 1 / (1 + np.exp(-odds))).astype(np.float32)


def update_confidence(
    points: PointTable,
    held: Indices,
    frame: Frame,
    labels: Labels,
    recognised: Bools,
    config: ConfidenceConfig,
    clearing: ClearingRules,
) -> tuple[Indices, Indices]:
    """Update the confidence of the beware points among (N,) ones that an image shows.

    An image shows a point if any source of its labels shows the point's class at its pixel or
    beside: what one source cannot know, another may. `recognised`: (256,) whether a network or an
    example can show a class, by its id; points of all others stay as they are. Returns the indices
    of the points to forget, and the cells (row · cols + col) with a changed confidence. `clearing`
    gives the tolerance of depth.
    """
    return _update(
        points.records,
        points.changed,
        held,
        frame.depth_m,
        invert(frame.T_map_camera),
        frame.intrinsics.pinhole,
        np.stack([one.class_ids for one in labels.all_hypotheses]),
        np.stack([one.confidence for one in labels.all_hypotheses]),
        recognised,
        _NONE if frame.uncoloured is None else frame.uncoloured,
        clearing,
        _LogOdds(config.claim_share, config.miss, config.least, config.most),
        config.trusted_m,
        frame.intrinsics.length_px(config.border_px),
    )


@nested
def _updated_log_odds(confidence: float, claim: float, steps: _LogOdds) -> float:
    """Return the log-odds after one image in which the network claims the object with a confidence;
    a claim of 0 is a miss."""
    odds = math.log(max(confidence, 0.01) / max(1 - confidence, 0.01))
    if claim == 0.0:
        return max(odds - steps.miss, steps.least)
    claim = min(max(claim, 0.01), 0.99)
    return min(odds + steps.claim_share * math.log(claim / (1 - claim)), steps.most)


@compiled
def _update(
    records: Records,
    changed: npt.NDArray[np.bool_],
    held: Indices,
    depth_m: FloatImage,
    t: Matrix,
    lens: Pinhole,
    class_ids: npt.NDArray[np.uint8],
    confidence: FloatImage,
    recognised: Bools,
    uncoloured: Bools,
    clearing: ClearingRules,
    steps: _LogOdds,
    trusted_m: float,
    border_px: int,
) -> tuple[Indices, Indices]:
    height, width = depth_m.shape
    forget, cells = [np.int64(0) for _ in range(0)], [np.int64(0) for _ in range(0)]
    for index in held:
        if records[index].class_id == NOTHING or records[index].confidence >= 1:
            continue
        if not recognised[records[index].class_id]:
            continue
        i, j, depth = pixel_of(records[index], t, lens, clearing.nearest_m)
        if depth > trusted_m:
            continue
        if i < border_px or i >= height - border_px:
            continue
        if j < border_px or j >= width - border_px:
            continue
        tolerance = clearing.constant_m + clearing.per_m2 * depth * depth
        if depth_m[i, j] <= 0 or abs(depth_m[i, j] - depth) > tolerance:
            continue
        claim = 0.0
        for source in range(len(class_ids)):
            for r in range(i - 1, i + 2):
                for c in range(j - 1, j + 2):
                    if class_ids[source, r, c] == records[index].class_id:
                        claim = max(claim, float(confidence[source, r, c]))
        if claim == 0.0 and uncoloured.size > 0 and uncoloured[i, j]:
            continue
        odds = _updated_log_odds(float(records[index].confidence), claim, steps)
        records[index].confidence = 1 / (1 + math.exp(-odds))
        changed[index] = True
        cells.append(np.int64(records[index].cell))
        if odds <= steps.least:
            forget.append(index)
    return np.array(forget, dtype=np.int64), np.array(cells, dtype=np.int64)
