"""What it takes, and what it costs, to run a trained network in eight bits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navcore.learning.training.batches import Pictures, plain_batch
from navcore.learning.training.evaluation import Looking, evaluate
from navcore.learning.training.metrics import mean_iou
from navcore.perception.esanet.network.model import EsaNet
from navcore.perception.esanet.network.quantisation import measured_ranges, quantised

MEASURED_ON = 32
"""Pictures that the ranges are taken from, spread over the split: the largest of each lie close to
one another."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantisation:
    """Ranges, and how well the network does with them and without."""

    ranges: tuple[float, ...]
    """As the card of weights keeps them."""
    mean_iou_in_bytes: float
    """Over the split, computed in torch as if in eight bits."""
    mean_iou: float
    """Over the split, in f32."""


def quantise(network: EsaNet, pictures: Pictures, looking: Looking) -> Quantisation:
    """Measure the ranges on some pictures, and the mean IoU on all of them. The network is left as
    it is."""
    statistics = pictures.dataset.card.depth
    chosen = np.unique(np.linspace(0, len(pictures) - 1, MEASURED_ON).astype(int))
    batches = (plain_batch([pictures[int(index)]], looking.size, statistics) for index in chosen)
    ranges = measured_ranges(network, ((batch.rgb, batch.depth) for batch in batches))
    return Quantisation(
        ranges=ranges,
        mean_iou_in_bytes=mean_iou(evaluate(quantised(network, ranges), pictures, looking)),
        mean_iou=mean_iou(evaluate(network, pictures, looking)),
    )
