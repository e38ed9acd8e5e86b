"""Calibration of a trained network: an offset per class and one temperature for its logits.

Trained with class weights, a network predicts a rare class when in doubt. One constant per class,
added to its logits, compensates for this so that the mean IoU of a split that was not used for
training is largest (cf. logit adjustment, Menon et al., ICLR 2021). The constants are added to the
bias of the last layer: the network's shape and time stay the same.

Then all logits are divided by one temperature (Guo et al., ICML 2017), which changes no class but
the confidence. An IoU loss makes the network overconfident whether it is right or wrong, so that
repeated observations could not correct it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from scipy.optimize import minimize_scalar
from torch.nn import functional

from navcore.errors import BadConfiguration
from navcore.learning.training.batches import CachedSplit, plain_batch
from navcore.learning.training.evaluation import InferenceSettings, logits_of
from navcore.perception.esanet.network.model import EsaNet

CANDIDATES = np.linspace(-6.0, 6.0, 97)
"""Offsets that are tried for each class."""
ROUNDS = 4
"""Largest number of passes over the classes."""
RIGHT_STRIDE = 16
"""Subsampling of correctly labelled pixels: one in this many of a class counts, for them all."""
MEMORY_BYTES = 1 << 30
"""Memory for logits, of which each class has the same shares for the pixels that are labelled
correctly and those that are not; a random choice stands for more of them."""
Logits = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """What the logits of a network were changed by."""

    offsets: npt.NDArray[np.float64]
    """(C,) offsets, 0 for class 0 and for a class that no image shows."""
    shown: npt.NDArray[np.bool_]
    """(C,) whether an image shows the class."""
    temperature: float
    """Temperature that the shifted logits were divided by."""


def calibrate(
    network: EsaNet,
    images: CachedSplit,
    inference: InferenceSettings,
    *,
    on_progress: Callable[[int], None] = lambda count: None,
) -> Calibration:
    """Shift and scale the network's logits in place so that they fit the images best; raises
    `BadConfiguration`, and changes nothing, where no pixel is labelled."""
    logits, classes, weights = _collected(network, images, inference, on_progress)
    if not len(classes):
        raise BadConfiguration(
            f"calibration: nothing is labelled in the {images.split} images; choose another split"
        )
    offsets = best_offsets(logits, classes, weights)
    logits += offsets.astype(np.float32)
    temperature = best_temperature(logits, classes, weights)
    last = network.decoder.upsample2.conv
    assert last.bias is not None
    with torch.no_grad():
        last.bias += torch.from_numpy(offsets).to(last.bias)
        for parameter in (last.weight, last.bias):
            parameter /= temperature
    shown = np.bincount(classes, minlength=logits.shape[1]) > 0
    return Calibration(offsets=offsets, shown=shown, temperature=temperature)


def best_temperature(
    logits: Logits, classes: npt.NDArray[np.int64], weights: npt.NDArray[np.float64]
) -> float:
    """Return the temperature that minimises the mean cross entropy of the true classes.

    All classes count the same, because nearly all pixels are floor and wall, where the network is
    certain. The arguments are those of `best_offsets`.
    """
    of_class = np.bincount(classes, weights, minlength=logits.shape[1])
    share = torch.from_numpy(weights / of_class[classes] / np.count_nonzero(of_class))
    true, scores = torch.from_numpy(classes), torch.from_numpy(logits)

    def cross_entropy(logarithm: float) -> float:
        lost = functional.cross_entropy(scores / math.exp(logarithm), true, reduction="none")
        return float((lost.double() * share).sum())

    found = minimize_scalar(
        cross_entropy,
        bounds=(math.log(0.2), math.log(20.0)),
        method="bounded",
        options={"xatol": 1e-3},
    )
    return math.exp(float(found.x))


def best_offsets(
    logits: Logits, classes: npt.NDArray[np.int64], weights: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return the offsets (C,) that maximise the mean IoU of argmax(logits + offsets), class by
    class.

    `logits` is (N, C), `classes` (N,) the true classes 0 … C−1, `weights` (N,) the number of pixels
    that each one stands for. The first class keeps 0, and so does a class without true pixels: of
    that one only false detections are seen here, which any suppression makes fewer.
    """
    offsets = np.zeros(logits.shape[1])
    shown = np.unique(classes[classes > 0])
    for _ in range(ROUNDS):
        before = offsets.copy()
        for number in shown:
            scores = _scores(logits, classes, weights, offsets, number)
            # Of equally good offsets take the one nearest to the present one.
            good = np.flatnonzero(scores >= scores.max() - 1e-12)
            offsets[number] = CANDIDATES[
                good[np.argmin(np.abs(CANDIDATES[good] - offsets[number]))]
            ]
        if np.array_equal(before, offsets):
            break
    return offsets


def _scores(
    logits: Logits,
    classes: npt.NDArray[np.int64],
    weights: npt.NDArray[np.float64],
    offsets: npt.NDArray[np.float64],
    number: int,
) -> npt.NDArray[np.float64]:
    """Return the mean IoU for every candidate offset of one class, which wins a pixel where its
    logit exceeds the largest other one."""
    count = logits.shape[1]
    others = logits + offsets.astype(np.float32)
    others[:, number] = -np.inf
    winners = others.argmax(axis=1)
    needed = others[np.arange(len(others)), winners] - logits[:, number]
    first = np.searchsorted(
        CANDIDATES, needed, side="right"
    )  # the first candidate with which the class wins the pixel
    steps = len(CANDIDATES) + 1

    def won(chosen: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
        return np.bincount(first[chosen], weights[chosen], minlength=steps).cumsum()[
            : len(CANDIDATES)
        ]

    truth = np.bincount(classes, weights, minlength=count)
    hits, called = np.zeros((count, len(CANDIDATES))), np.zeros((count, len(CANDIDATES)))
    for other in range(count):
        held = winners == other
        if other == number or not held.any():
            continue
        called[other] = weights[held].sum() - won(held)
        right = held & (classes == other)
        hits[other] = weights[right].sum() - won(right)
    called[number], hits[number] = (
        won(np.ones(len(classes), dtype=np.bool_)),
        won(classes == number),
    )
    present = truth > 0
    union = truth[:, None] + called - hits
    return np.asarray((hits[present] / np.maximum(union[present], 1e-9)).mean(axis=0))


def _collected(
    network: EsaNet,
    images: CachedSplit,
    inference: InferenceSettings,
    on_progress: Callable[[int], None],
) -> tuple[Logits, npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Return logits, true class and weight of the pixels, subsampled."""
    kept: _KeptPixels | None = None
    random = np.random.default_rng(0)
    for start in range(0, len(images), inference.batch):
        samples = [
            images[index] for index in range(start, min(start + inference.batch, len(images)))
        ]
        made = logits_of(
            network, plain_batch(samples, inference.size, images.dataset.card.depth), inference
        )
        for one, sample in zip(made, samples, strict=True):
            if one.shape[1:] != sample.labels.shape:
                one = functional.interpolate(
                    one[None], size=sample.labels.shape, mode="bilinear", align_corners=False
                )[0]
            flat, labels = one.flatten(1).T.numpy(), sample.labels.ravel().astype(np.int64) - 1
            is_right = flat.argmax(axis=1) == labels
            kept = kept or _KeptPixels(flat.shape[1])
            for number in np.unique(labels[labels >= 0]).tolist():
                for right in (False, True):
                    pixels = np.flatnonzero((labels == number) & (is_right == right))
                    kept.add(number, right, flat, random.permutation(pixels))
        on_progress(len(samples))
    if kept is None:
        return np.empty((0, 0), np.float32), np.empty(0, np.int64), np.empty(0)
    return kept.joined()


class _KeptPixels:
    """Logits of a random choice of the pixels of each class, of those that are labelled correctly
    and the others apart, in one array of `MEMORY_BYTES`."""

    def __init__(self, count: int) -> None:
        """`count`: number of classes."""
        size = MEMORY_BYTES // (2 * count * count * np.dtype(np.float32).itemsize)
        self._rows: Logits = np.empty((2 * count, size, count), np.float32)
        # The shares: for each class its wrong pixels, then its right ones.
        self._strides = [1, RIGHT_STRIDE] * count  # one pixel in so many is kept
        self._seen = [0] * (2 * count)

    def add(self, number: int, right: bool, logits: Logits, pixels: npt.NDArray[np.int64]) -> None:
        """Add pixels of a class in random order, whose logits are rows of (M, C); where that
        becomes too many, keep half as many of them from now on."""
        share = 2 * number + right
        # The stride goes on over the images: else those with few such pixels would count more.
        while self._kept(share) + len(chosen := self._chosen(share, pixels)) > self._rows.shape[1]:
            half = self._rows[share, : self._kept(share) : 2]
            self._rows[share, : len(half)] = half
            self._strides[share] *= 2
        begin = self._kept(share)
        self._rows[share, begin : begin + len(chosen)] = logits[chosen]
        self._seen[share] += len(pixels)

    def joined(self) -> tuple[Logits, npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Return logits, true class and weight of all kept pixels. The rows are moved together in
        place, so that they are in memory once; call it last."""
        kept = np.array([self._kept(share) for share in range(len(self._seen))])
        joined, begin = self._rows.reshape(-1, self._rows.shape[2]), 0
        for rows, length in zip(self._rows, kept, strict=True):
            joined[begin : begin + length] = rows[:length]
            begin += length
        weights = np.array(self._seen) / np.maximum(kept, 1)
        return (
            joined[:begin],
            np.repeat(np.arange(len(kept)) // 2, kept),
            np.repeat(weights, kept),
        )

    def _chosen(self, share: int, pixels: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        return pixels[-self._seen[share] % self._strides[share] :: self._strides[share]]

    def _kept(self, share: int) -> int:
        """Return the number of kept pixels: the first of each stride."""
        return -(-self._seen[share] // self._strides[share])
