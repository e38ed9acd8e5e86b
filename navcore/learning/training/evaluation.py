"""How well a network labels a split of a data set, as the official code measures it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from navcore.learning.data.card import Sample
from navcore.learning.training.batches import Batch, Pictures, plain_batch
from navcore.learning.training.distributed import Ranks
from navcore.learning.training.metrics import confusion_matrix
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size


@dataclass(frozen=True, slots=True, kw_only=True)
class Looking:
    """How the network is shown a picture."""

    size: Size
    """Working size."""
    batch: int = 8
    """Pictures at a time."""
    bfloat16: bool = False
    """Whether to compute in bfloat16."""
    mirrored_too: bool = False
    """Whether to average with the mirrored picture's logits, at twice the time."""


def evaluate(
    network: nn.Module,
    pictures: Pictures,
    looking: Looking,
    *,
    ranks: Ranks | None = None,
    seen: Callable[[int], None] = lambda count: None,
) -> npt.NDArray[np.int64]:
    """(C, C) confusion matrix over the split, row = true class; void is left out.

    The logits are resized to the labels, not the labels to the logits. Each rank looks at its
    share; the sum is everybody's. `seen` hears how many pictures were looked at.
    """
    ranks = ranks or Ranks()
    num_classes = len(pictures.dataset.card.class_names)
    total = np.zeros((num_classes, num_classes), dtype=np.int64)
    mine = range(ranks.rank, len(pictures), ranks.count)
    for start in range(0, len(mine), looking.batch):
        samples = [pictures[index] for index in mine[start : start + looking.batch]]
        predicted = predict(network, samples, looking, pictures.dataset.card.depth)
        for sample, classes in zip(samples, predicted, strict=True):
            total += confusion_matrix(sample.labels, classes, num_classes)
        seen(len(samples))
    return ranks.summed(total, device_of(network))


def predict(
    network: nn.Module, samples: Sequence[Sample], looking: Looking, statistics: DepthStatistics
) -> list[npt.NDArray[np.uint8]]:
    """The most likely class 0 … C−1 of every pixel, (H, W) at each sample's own size."""
    logits = logits_of(network, plain_batch(samples, looking.size, statistics), looking)
    return [_classes(one, sample.labels.shape) for one, sample in zip(logits, samples, strict=True)]


def device_of(network: nn.Module) -> torch.device:
    """Where its weights are."""
    return next(network.parameters()).device


def _classes(logits: Tensor, shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """(C, h, w) → (H, W)."""
    if logits.shape[1:] != shape:
        logits = functional.interpolate(
            logits[None], size=shape, mode="bilinear", align_corners=False
        )[0]
    return logits.argmax(dim=0).to(torch.uint8).cpu().numpy()


def logits_of(network: nn.Module, batch: Batch, looking: Looking) -> Tensor:
    """The network's (B, C, h, w) float32 for a batch."""
    device = device_of(network)
    rgb, depth = batch.rgb.to(device), batch.depth.to(device)
    network.eval()
    with (
        torch.inference_mode(),
        torch.autocast(device.type, torch.bfloat16, enabled=looking.bfloat16),
    ):
        logits: Tensor = network(rgb, depth).float().contiguous()
        if looking.mirrored_too:
            logits = logits + network(rgb.flip(3), depth.flip(3)).float().flip(3)
    return logits
