"""Losses: class-weighted cross entropy at four scales (Seichter et al. 2021, section IV), and an
optional soft Jaccard loss.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from navcore.errors import BadFrame

VOID = 0
"""Label of unlabelled pixels; class c of the network is label c + 1."""
_IGNORED = -1


def pyramid_losses(
    logits: Sequence[Tensor], labels: Tensor, class_weights: Tensor
) -> tuple[Tensor, ...]:
    """Return one loss per scale; the training loss is their sum.

    `logits` are (B, C, h, w) each, the first at the size of `labels`; `labels` are integers
    (B, H, W), 0 = void, else class + 1; `class_weights` is (C,). Coarser scales use the labels
    resized by nearest neighbour.
    """
    targets = _targets(labels, logits[0])
    return tuple(
        weighted_cross_entropy(at_scale, _resized(targets, at_scale), class_weights)
        for at_scale in logits
    )


def weighted_cross_entropy(logits: Tensor, targets: Tensor, class_weights: Tensor) -> Tensor:
    """Return L = Σ w(t)·CE / Σ w(t) over the labelled pixels; 0 without labelled pixels.

    `logits` (B, C, h, w), `targets` (B, h, w) int64 with −1 = void, `class_weights` (C,).
    """
    weights = class_weights.to(logits)
    total = functional.cross_entropy(
        logits, targets, weights, ignore_index=_IGNORED, reduction="sum"
    )
    labelled = targets != _IGNORED
    weight = weights[targets.clamp(min=0)][labelled].sum()
    # An image without labels would give 0 / 0, and one NaN would end the training.
    return total / weight.clamp(min=torch.finfo(weight.dtype).tiny)


def jaccard_loss(logits: Tensor, labels: Tensor) -> Tensor:
    """Return 1 − the mean soft IoU over the classes in these images (Rahman & Wang, ISVC 2016).

    All classes count the same, however few pixels they have, and a missed pixel costs as much as a
    false one; cross entropy alone leaves thin objects to the background. `logits` (B, C, H, W),
    `labels` (B, H, W) as above; 0 if nothing is labelled.
    """
    targets = _targets(labels, logits)
    known = targets != _IGNORED
    true = targets.clamp(min=0)
    probabilities = torch.softmax(logits, dim=1) * known[:, None]
    hit = probabilities.gather(1, true[:, None])[:, 0]
    num_classes = logits.shape[1]
    intersection = hit.new_zeros(num_classes).index_add(0, true.flatten(), hit.flatten())
    labelled = torch.bincount(true[known], minlength=num_classes).to(hit)
    union = labelled + probabilities.sum(dim=(0, 2, 3)) - intersection
    shown = labelled > 0
    if not shown.any():
        return intersection.sum()
    return 1 - (intersection[shown] / union[shown]).mean()


def _targets(labels: Tensor, logits: Tensor) -> Tensor:
    """Return the classes (B, H, W) as int64, −1 for void; raises `BadFrame` if the labels do not
    fit the logits."""
    if labels.shape != (logits.shape[0], *logits.shape[2:]):
        raise BadFrame(
            f"labels have shape {tuple(labels.shape)}, the logits {tuple(logits.shape)}: "
            "batch, height, width differ"
        )
    targets = labels.long() - 1
    if targets.numel() and not -1 <= int(targets.min()) <= int(targets.max()) < logits.shape[1]:
        raise BadFrame(
            f"labels reach from {int(labels.min())} to {int(labels.max())}, "
            f"expected 0 (void) to {logits.shape[1]}"
        )
    return targets


def _resized(targets: Tensor, logits: Tensor) -> Tensor:
    """Resize the targets to the size of `logits` by nearest neighbour; floats are exact for
    them."""
    small = functional.interpolate(targets[:, None].float(), size=logits.shape[2:], mode="nearest")
    return small[:, 0].long()
