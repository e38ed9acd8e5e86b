"""Measurement of the ranges and the cost of running a trained network in eight bits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navcore.learning.training.batches import CachedSplit, plain_batch
from navcore.learning.training.evaluation import InferenceSettings, evaluate
from navcore.learning.training.metrics import mean_iou
from navcore.perception.esanet.network.model import EsaNet
from navcore.perception.esanet.network.quantisation import measured_ranges, quantised

MEASURED_ON = 32
"""Number of images that the ranges are measured on, spread over the split; their largest values are
close to each other."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantisation:
    """Ranges for eight bits, and the mean IoU with and without them."""

    ranges: tuple[float, ...]
    """Largest inputs of the convolutions, as in the card of the weights."""
    mean_iou_in_bytes: float
    """Mean IoU over the split, simulated in eight bits by torch."""
    mean_iou: float
    """Mean IoU over the split in f32."""


def quantise(network: EsaNet, images: CachedSplit, inference: InferenceSettings) -> Quantisation:
    """Measure the ranges on some images and the mean IoU on all of them; the network is not
    changed."""
    statistics = images.dataset.card.depth
    chosen = np.unique(np.linspace(0, len(images) - 1, MEASURED_ON).astype(int))
    batches = (plain_batch([images[int(index)]], inference.size, statistics) for index in chosen)
    ranges = measured_ranges(network, ((batch.rgb, batch.depth) for batch in batches))
    return Quantisation(
        ranges=ranges,
        mean_iou_in_bytes=mean_iou(evaluate(quantised(network, ranges), images, inference)),
        mean_iou=mean_iou(evaluate(network, images, inference)),
    )
