"""Classes by example: a prototype from a few clicks, and what a frame shows of it.

A cell is described by the features of the network before its classifier and by its colour. It
belongs to a prototype where it lies near the centre of the clicked cells (J. Snell, K. Swersky,
R. Zemel, "Prototypical Networks for Few-shot Learning", NeurIPS 2017) and a linear score tells it
from the background: w = (Σ + λI)⁻¹ (μ_object − μ_background), which needs few examples because the
background gives most of the covariance (B. Hariharan, J. Malik, D. Ramanan, "Discriminative
Decorrelation for Clustering and Classification", ECCV 2012). It is fitted again to the background
that scores highest. The threshold is the score that only a small share of the background reaches.
A connected region of such pixels counts where it has the size and the height of the object.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import DEFAULT_PERCEPTION
from navcore.config.perception.prototype import PrototypeConfig
from navcore.errors import Refused
from navcore.geometry.arrays import Bools, FloatImage, Floats
from navcore.geometry.camera import back_project_pixels
from navcore.mission.beware_list import NOTHING, BewareClass
from navcore.mission.prototype import Prototype
from navcore.perception.depth_filter import heights_above_floor
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

_DEFAULT = DEFAULT_PERCEPTION.prototype
_MIN_STD = 1e-3
"""Least standard deviation that a channel is divided by."""
_ROUNDS, _MIN_HARD = 3, 500
"""Number of times that the weights are fitted to the highest background, and its least number of
cells."""
_DISTANCE_SHARE = 0.98
"""Share of the clicked cells whose distance from the centre the radius is fitted to."""
_TWIN_SHARE = 0.9
"""Share of the clicked cells that others of the same kind are as near to the centre as."""
_MAX_CELLS = 2000
"""Largest number of cells of the background that a frame gives, of either kind."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Example:
    """What one click has taken of an object."""

    cells: Floats
    """(N, D) descriptors of its cells."""
    position: tuple[float, float]
    """(x, y) in metres of the map frame."""
    size_m: float
    """Extent across the line of sight in metres."""
    height_m: float
    """Height of its top above the floor in metres."""


def describe(frame: Frame, features: FloatImage) -> FloatImage:
    """Return the (h, w, D) descriptors of a frame: the features (1, C, h, w), then L*, a*, b*."""
    height, width = features.shape[2:]
    colour = cv2.resize(lab_image(frame.rgb), (width, height), interpolation=cv2.INTER_AREA)
    return np.concatenate([features[0].transpose(1, 2, 0), colour], axis=2, dtype=np.float32)


def lab_image(rgb: npt.NDArray[np.uint8]) -> FloatImage:
    """Return the (H, W, 3) colours of an image in CIE L*a*b*."""
    return np.asarray(cv2.cvtColor(rgb.astype(np.float32) / np.float32(255), cv2.COLOR_RGB2Lab))


def example_of(
    frame: Frame, described: FloatImage, pixels: Bools, config: PrototypeConfig = _DEFAULT
) -> Example:
    """Return the example of an object's (H, W) pixels; raises `Refused` if they are too few."""
    cells, measured = _cells_of(pixels, described), pixels & (frame.depth_m > 0)
    if cells.sum() < config.min_cells or not measured.any():
        raise Refused("what was clicked is too small or too far away; drive nearer and click again")
    x_m, y_m = np.median(_positions(frame)[measured], axis=0)
    return Example(
        cells=described[cells].astype(np.float64),
        position=(float(x_m), float(y_m)),
        size_m=extent_m(measured, frame),
        height_m=float(np.percentile(heights_above_floor(frame)[measured], 95)),
    )


def background_of(
    frame: Frame,
    described: FloatImage,
    examples: Sequence[Example],
    config: PrototypeConfig = _DEFAULT,
) -> Floats:
    """Return the (N, D) descriptors of what a frame shows that was not clicked: first of all that
    which stands on the floor, and some of the rest."""
    heights_m, away = heights_above_floor(frame), np.ones(frame.depth_m.shape, dtype=np.bool_)
    positions = _positions(frame)
    for example in examples:
        distance_m = np.hypot(*(positions - example.position).transpose(2, 0, 1))
        away &= ~(distance_m <= example.size_m / 2 + config.clear_m)
    stands = _is_near(frame, config) & (heights_m >= config.floor_m)
    stands &= heights_m <= config.max_height_m
    kinds = (_cells_of(away & stands, described), _cells_of(away & ~stands, described))
    return np.concatenate([_thinned(described[cells]) for cells in kinds]).astype(np.float64)


def fitted(
    network: str,
    examples: Sequence[Example],
    background: Floats,
    config: PrototypeConfig = _DEFAULT,
    *,
    away: Sequence[Example] = (),
) -> Prototype:
    """Return the prototype of what was clicked, told from the (N, D) descriptors of the background
    and from what was taken away, which counts as a share of it.

    Cells of the background that are as near to the centre as most of the object are others of its
    kind, as long as they are few. Raises `Refused` where it cannot be told from the background.
    """
    clicked = np.concatenate([example.cells for example in examples])
    centre, own = clicked.mean(axis=0), config.own_share
    variance = own * clicked.var(axis=0) + (1 - own) * background.var(axis=0)
    spread = np.sqrt(variance) + _MIN_STD
    distances = np.square((clicked - centre) / spread).mean(axis=1)
    is_twin = np.square((background - centre) / spread).mean(axis=1) <= np.quantile(
        distances, _TWIN_SHARE
    )
    if is_twin.mean() <= config.twin_share:
        background = background[~is_twin]
    count = round(config.away_share * len(background))
    for example in away:
        times = -(-count // len(example.cells))
        background = np.concatenate([background, np.repeat(example.cells, times, axis=0)])
    weights = _weights(clicked, background, config)
    scores = clicked @ weights
    threshold = float(np.quantile(background @ weights, 1 - config.background_share))
    typical = float(np.median(scores))
    if (scores > threshold).mean() < config.min_separation or typical <= threshold:
        raise Refused(
            "it looks too much like what is around it to be told from that; click another part of "
            "it, take away what does not belong to it, or make a colour rule"
        )
    sizes_m = [example.size_m for example in examples]
    heights_m = [example.height_m for example in examples]
    return Prototype(
        network=network,
        centre=_rounded(centre),
        spread=_rounded(spread),
        radius=round(config.radius_slack * float(np.quantile(distances, _DISTANCE_SHARE)), 4),
        weights=_rounded(weights),
        threshold=_rounded([threshold])[0],
        typical=_rounded([typical])[0],
        max_size_m=round(config.size_slack * max(sizes_m), 3),
        min_height_m=round(min(heights_m) / config.size_slack, 3),
        max_height_m=round(config.size_slack * max(heights_m), 3),
        clicks=len(examples),
    )


def prototype_labels(
    frame: Frame,
    described: FloatImage,
    entries: Sequence[BewareClass],
    config: PrototypeConfig = _DEFAULT,
) -> Labels:
    """Return what a frame shows of entries with a prototype of this network; where several fit, the
    most confident."""
    class_ids = np.full(frame.depth_m.shape, NOTHING, dtype=np.uint8)
    confidence = np.ones(frame.depth_m.shape, dtype=np.float32)
    for entry in entries:
        prototype = entry.prototype
        if prototype is None or len(prototype.weights) != described.shape[2]:
            continue
        fits, own = prototype_pixels(frame, described, prototype, config)
        wins = fits & ((class_ids == NOTHING) | (own > confidence))
        class_ids[wins], confidence[wins] = entry.class_id, own[wins]
    return Labels(class_ids=class_ids, confidence=confidence)


def prototype_pixels(
    frame: Frame,
    described: FloatImage,
    prototype: Prototype,
    config: PrototypeConfig = _DEFAULT,
) -> tuple[Bools, FloatImage]:
    """Return the (H, W) pixels that belong to a prototype of as many channels, and the confidence
    of all pixels: a half at the threshold."""
    span = prototype.typical - prototype.threshold
    scores = described @ np.array(prototype.weights, dtype=np.float32)
    over = scores >= prototype.threshold
    centre, spread = (np.array(one, np.float32) for one in (prototype.centre, prototype.spread))
    deviations = (described[over] - centre) / spread
    is_far = np.square(deviations).mean(axis=1) > prototype.radius
    scores[over] = np.where(is_far, prototype.threshold - span, scores[over])
    height, width = frame.depth_m.shape
    scores = np.asarray(cv2.resize(scores, (width, height), interpolation=cv2.INTER_LINEAR))
    odds = np.clip((scores - prototype.threshold) / span, -1, 1) * np.float32(config.sureness)
    fits = _regions(scores >= prototype.threshold, frame, prototype, config)
    return fits, np.asarray(1 / (1 + np.exp(-odds)), dtype=np.float32)


def extent_m(pixels: Bools, frame: Frame) -> float:
    """Return the extent of measured (H, W) pixels across the line of sight in metres."""
    cols = np.flatnonzero(pixels.any(axis=0))
    depth_m = float(np.median(frame.depth_m[pixels]))
    return float(cols[-1] - cols[0] + 1) * depth_m / frame.intrinsics.fx


def _weights(clicked: Floats, background: Floats, config: PrototypeConfig) -> Floats:
    """Return the weight (D,) of each channel."""
    middle, spread = background.mean(axis=0), background.std(axis=0) + _MIN_STD
    near, far = (clicked - middle) / spread, (background - middle) / spread
    weights = _discriminant(near, far, config)
    count = min(max(_MIN_HARD, round(config.hard_share * len(far))), len(far))
    for _ in range(_ROUNDS):
        hard = far[np.argsort(far @ weights, kind="stable")[-count:]]
        weights = (weights + _discriminant(near, hard, config)) / 2
    return np.asarray(weights / spread)


def _discriminant(near: Floats, far: Floats, config: PrototypeConfig) -> Floats:
    """Return Fisher's discriminant (D,) of two sets, of length 1."""
    scatter = (np.cov(near.T) + np.cov(far.T)) / 2 + config.shrinkage * np.eye(near.shape[1])
    direction = np.linalg.solve(scatter, near.mean(axis=0) - far.mean(axis=0))
    return np.asarray(direction / np.linalg.norm(direction))


def _regions(fits: Bools, frame: Frame, prototype: Prototype, config: PrototypeConfig) -> Bools:
    """Return the (H, W) pixels of the regions that have the size and height of a prototype."""
    heights_m, min_px = heights_above_floor(frame), frame.intrinsics.area_px(config.min_region_px)
    kept = fits & _is_near(frame, config)
    kept &= (heights_m >= config.floor_m) & (heights_m <= prototype.max_height_m)
    count, names, boxes, _ = cv2.connectedComponentsWithStats(kept.view(np.uint8), connectivity=8)
    for name in range(1, count):
        left, top, width, height, area = (int(value) for value in boxes[name])
        window = slice(top, top + height), slice(left, left + width)
        region = names[window] == name
        size_m = width * float(np.median(frame.depth_m[window][region])) / frame.intrinsics.fx
        top_m = float(np.percentile(heights_m[window][region], 95))
        is_low = top > 0 and top_m < prototype.min_height_m
        if area < min_px or size_m > prototype.max_size_m or is_low:
            kept[window] &= ~region
    return np.asarray(kept)


def _is_near(frame: Frame, config: PrototypeConfig) -> Bools:
    return np.asarray((frame.depth_m > 0) & (frame.depth_m <= config.max_range_m))


def _positions(frame: Frame) -> Floats:
    """Return the (H, W, 2) x and y of a frame's pixels in metres of the map frame; NaN where no
    depth was measured."""
    rows, cols = np.mgrid[: frame.depth_m.shape[0], : frame.depth_m.shape[1]]
    depth_m = np.where(frame.depth_m > 0, frame.depth_m, np.nan)
    optical = back_project_pixels(rows, cols, depth_m, frame.intrinsics)
    return np.asarray(optical @ frame.T_map_camera[:2, :3].T + frame.T_map_camera[:2, 3])


def _cells_of(pixels: Bools, described: FloatImage) -> Bools:
    """Return the (h, w) cells that (H, W) pixels cover by half at least."""
    height, width = described.shape[:2]
    share = cv2.resize(pixels.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(share >= 0.5)


def _thinned(cells: FloatImage) -> FloatImage:
    return cells[:: max(1, -(-len(cells) // _MAX_CELLS))]


def _rounded(values: Floats | Sequence[float]) -> tuple[float, ...]:
    """Return numbers to six digits, which is more than an engine repeats."""
    return tuple(float(f"{value:.6g}") for value in values)
