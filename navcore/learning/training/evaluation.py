"""Evaluation of a network on a split of a data set, as in the official code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from navcore.learning.data.card import Sample
from navcore.learning.training.batches import Batch, CachedSplit, plain_batch
from navcore.learning.training.distributed import Ranks
from navcore.learning.training.metrics import confusion_matrix
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size


@dataclass(frozen=True, slots=True, kw_only=True)
class InferenceSettings:
    """How the network is run on images."""

    size: Size
    """Working size that images are resized to."""
    batch: int = 8
    """Number of images per batch."""
    bfloat16: bool = False
    """Whether to compute in bfloat16."""
    mirrored_too: bool = False
    """Whether to average with the logits of the mirrored image, at twice the time."""


def evaluate(
    network: nn.Module,
    images: CachedSplit,
    inference: InferenceSettings,
    *,
    ranks: Ranks | None = None,
    on_progress: Callable[[int], None] = lambda count: None,
) -> npt.NDArray[np.int64]:
    """Return the confusion matrix (C, C) over the split, row = true class; void is left out.

    The logits are resized to the labels, not the labels to the logits. Each rank evaluates its
    share and all ranks return the sum. `on_progress` is called with the number of images of each
    batch.
    """
    ranks = ranks or Ranks()
    num_classes = len(images.dataset.card.class_names)
    total = np.zeros((num_classes, num_classes), dtype=np.int64)
    mine = range(ranks.rank, len(images), ranks.count)
    for start in range(0, len(mine), inference.batch):
        samples = [images[index] for index in mine[start : start + inference.batch]]
        predicted = predict(network, samples, inference, images.dataset.card.depth)
        for sample, classes in zip(samples, predicted, strict=True):
            total += confusion_matrix(sample.labels, classes, num_classes)
        on_progress(len(samples))
    return ranks.summed(total, device_of(network))


def predict(
    network: nn.Module,
    samples: Sequence[Sample],
    inference: InferenceSettings,
    statistics: DepthStatistics,
) -> list[npt.NDArray[np.uint8]]:
    """Return the most likely class 0 … C−1 of every pixel, (H, W) at each sample's own size."""
    logits = logits_of(network, plain_batch(samples, inference.size, statistics), inference)
    return [_classes(one, sample.labels.shape) for one, sample in zip(logits, samples, strict=True)]


def device_of(network: nn.Module) -> torch.device:
    """Return the device of the network's weights."""
    return next(network.parameters()).device


def _classes(logits: Tensor, shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """Return the classes (H, W) of logits (C, h, w)."""
    if logits.shape[1:] != shape:
        logits = functional.interpolate(
            logits[None], size=shape, mode="bilinear", align_corners=False
        )[0]
    return logits.argmax(dim=0).to(torch.uint8).cpu().numpy()


def logits_of(network: nn.Module, batch: Batch, inference: InferenceSettings) -> Tensor:
    """Return the network's logits (B, C, h, w) in float32 for a batch."""
    device = device_of(network)
    rgb, depth = batch.rgb.to(device), batch.depth.to(device)
    network.eval()
    with (
        torch.inference_mode(),
        torch.autocast(device.type, torch.bfloat16, enabled=inference.bfloat16),
    ):
        logits: Tensor = network(rgb, depth).float().contiguous()
        if inference.mirrored_too:
            logits = logits + network(rgb.flip(3), depth.flip(3)).float().flip(3)
    return logits
