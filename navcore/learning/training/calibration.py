"""What a trained network says is shifted and scaled until it says it as often, and as surely, as it
is right.

Weighted by rarity, a network learns to call a rare class when in doubt. One constant a class, added
to its logits, undoes as much of that as maximises the mean IoU of a split that was not trained on
(cf. logit adjustment, Menon et al., ICLR 2021). The constants go into the bias of the last layer:
the network's shape and time stay the same.

Then all logits are divided by one temperature (Guo et al., ICML 2017): it changes no class, but how
sure the network is of it. A loss that asks for IoU makes it as sure as can be whether it is right
or wrong, and then no second look can tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import torch
from scipy.optimize import minimize_scalar
from torch.nn import functional

from navcore.learning.training.batches import Pictures, plain_batch
from navcore.learning.training.evaluation import Looking, logits_of
from navcore.perception.esanet.network.model import EsaNet

CANDIDATES = np.linspace(-6.0, 6.0, 97)
"""Offsets that are tried for a class."""
ROUNDS = 4
"""Times that every class is gone through."""
BACKGROUND_STRIDE = 16
"""Of the pixels that are background, and taken for it, one in so many counts, for so many."""
Logits = npt.NDArray[np.float32]


def calibrate(
    network: EsaNet,
    pictures: Pictures,
    looking: Looking,
    *,
    seen: Callable[[int], None] = lambda count: None,
) -> tuple[npt.NDArray[np.float64], float]:
    """Shift and scale the network's class logits so that they fit the pictures best.

    Returns the (C,) constants, class 0 at 0, and the temperature that what is shifted is divided
    by.
    """
    logits, classes, weights = _collected(network, pictures, looking, seen)
    offsets = best_offsets(logits, classes, weights)
    temperature = best_temperature(logits + offsets.astype(np.float32), classes, weights)
    last = network.decoder.upsample2.conv
    assert last.bias is not None
    with torch.no_grad():
        last.bias += torch.from_numpy(offsets).to(last.bias)
        for parameter in (last.weight, last.bias):
            parameter /= temperature
    return offsets, temperature


def best_temperature(
    logits: Logits, classes: npt.NDArray[np.int64], weights: npt.NDArray[np.float64]
) -> float:
    """What the logits have to be divided by for the true classes to be likeliest: least mean cross
    entropy.

    Classes count alike: of the pixels nearly all are floor and wall, which anybody is sure of.
    Arguments as above.
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
    """(C,) constants that maximise the mean IoU of argmax(logits + constants), found class by
    class.

    `logits` (N, C), true `classes` (N,) 0 … C−1, `weights` (N,) how many pixels each stands for.
    The first class keeps 0.
    """
    offsets = np.zeros(logits.shape[1])
    for _ in range(ROUNDS):
        before = offsets.copy()
        for number in range(1, len(offsets)):
            scores = _scores(logits, classes, weights, offsets, number)
            # Of equally good constants the one nearest to the present.
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
    """Mean IoU for every candidate offset of one class: it wins a pixel where its lead over the
    best other is positive."""
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
    network: EsaNet, pictures: Pictures, looking: Looking, seen: Callable[[int], None]
) -> tuple[Logits, npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Logits, true class and weight of the pixels that matter: all but most of those that are
    clearly background."""
    logits, classes, weights = [], [], []
    for start in range(0, len(pictures), looking.batch):
        samples = [
            pictures[index] for index in range(start, min(start + looking.batch, len(pictures)))
        ]
        made = logits_of(
            network, plain_batch(samples, looking.size, pictures.dataset.card.depth), looking
        )
        for one, sample in zip(made, samples, strict=True):
            if one.shape[1:] != sample.labels.shape:
                one = functional.interpolate(
                    one[None], size=sample.labels.shape, mode="bilinear", align_corners=False
                )[0]
            flat, labels = one.flatten(1).T.numpy(), sample.labels.ravel().astype(np.int64) - 1
            known = np.flatnonzero(labels >= 0)
            plain = known[(labels[known] == 0) & (flat[known].argmax(axis=1) == 0)]
            rest = np.setdiff1d(known, plain, assume_unique=True)
            for chosen, weight in (
                (plain[::BACKGROUND_STRIDE], float(BACKGROUND_STRIDE)),
                (rest, 1.0),
            ):
                logits.append(flat[chosen].copy())
                classes.append(labels[chosen])
                weights.append(np.full(len(chosen), weight))
        seen(len(samples))
    return np.concatenate(logits), np.concatenate(classes), np.concatenate(weights)
