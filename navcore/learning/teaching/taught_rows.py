"""The loss of the rows of taught classes, a convex function of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from navcore.learning.data.images import LabelArray
from navcore.perception.esanet.network.decoder import Decoder

IMAGES_AT_ONCE = 16
"""Number of images that the loss looks at together."""
_LEAST_DEVIATION = 1e-3
"""Smallest standard deviation that a feature is divided by."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Encoded:
    """What of an image does not depend on the taught rows."""

    features: Tensor
    """(C, h/4, w/4) half-precision input of the classifier."""
    others: Tensor
    """(h, w) half-precision log Σ exp of the logits of all classes that are not taught."""
    labels: LabelArray
    """(h, w) targets: 0 = void, else class + 1."""


class TaughtRows:
    """Rows of the classifier's convolution that are learned: those of the start plus a change, in
    units of the deviation of each feature, so that all features weigh alike."""

    def __init__(self, decoder: Decoder, taught: Sequence[int]) -> None:
        """`taught` are the numbers 0 … C−1 of the classes."""
        self.taught = list(taught)
        self._output = decoder.conv_out
        self._kernels = [
            [one.detach()[self.taught] for one in upsampling.conv.parameters()]
            for upsampling in (decoder.upsample1, decoder.upsample2)
        ]
        self._start = [one.detach()[self.taught].clone() for one in self._output.parameters()]
        self.moved = [torch.zeros_like(one, requires_grad=True) for one in self._start]
        """Change of weight (K, C, 3, 3) and bias (K)."""
        self._deviation = torch.ones(1, 1, 1, 1)

    def measure(self, images: Sequence[Encoded]) -> None:
        """Take the deviation of each feature from some images."""
        self._deviation = _deviation(images).view(1, -1, 1, 1)

    def values(self) -> tuple[Tensor, Tensor]:
        """Return weight and bias as they are now."""
        (weight, bias), moved = self._start, self.moved
        return weight + moved[0] / self._deviation, bias + moved[1]

    def write(self) -> None:
        """Put the rows into the network."""
        with torch.no_grad():
            for tensor, value in zip(self._output.parameters(), self.values(), strict=True):
                tensor[self.taught] = value

    def loss(self, images: Sequence[Encoded], l2_penalty: float) -> float:
        """Return the mean cross entropy of all labelled pixels plus `l2_penalty` · |change of the
        weights|², and add its gradient to that of `moved`."""
        total = sum(int((image.labels > 0).sum()) for image in images)
        penalty = l2_penalty * self.moved[0].square().sum()
        torch.autograd.backward(penalty)
        value = float(penalty.detach())
        for features, others, targets in _chunks(images, self.taught):
            loss = self._cross_entropy(features, others, targets) / max(1, total)
            torch.autograd.backward(loss)
            value += float(loss.detach())
        return value

    def _cross_entropy(self, features: Tensor, others: Tensor, targets: Tensor) -> Tensor:
        """Return the sum over all pixels. Which of the other classes is the target changes the loss
        by a constant: all of them are one here, the last."""
        weight, bias = self.values()
        logits = self._upsampled(functional.conv2d(features, weight, bias, padding=1))
        if logits.shape[1] == 1:
            # The same for one class, at a third of the time.
            gap = logits[:, 0] - others
            against = torch.where(targets == 0, -gap, gap)
            return (functional.softplus(against) * (targets >= 0)).sum()
        every = torch.cat([logits, others[:, None]], dim=1)
        return functional.cross_entropy(every, targets, ignore_index=-1, reduction="sum")

    def _upsampled(self, logits: Tensor) -> Tensor:
        """Map (B, K, h/4, w/4) to (B, K, h, w) as the network does, with images and classes as the
        channels of one image: a depthwise convolution is fast with many."""
        images, rows = logits.shape[:2]
        x = logits.reshape(1, images * rows, *logits.shape[2:])
        for kernel, bias in self._kernels:
            x = functional.interpolate(x, scale_factor=2.0, mode="nearest")
            x = functional.conv2d(
                x,
                kernel.repeat(images, 1, 1, 1),
                bias.repeat(images),
                padding=1,
                groups=images * rows,
            )
        return x.reshape(images, rows, *x.shape[2:])


def _chunks(
    images: Sequence[Encoded], taught: Sequence[int]
) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    """Yield features, others and targets of some images at a time. Targets are −1 = void, the place
    of the class in `taught`, or their number for any other class."""
    numbers = np.full(256, len(taught), dtype=np.int64)
    numbers[0] = -1
    for place, number in enumerate(taught):
        numbers[number + 1] = place
    for at in range(0, len(images), IMAGES_AT_ONCE):
        some = images[at : at + IMAGES_AT_ONCE]
        yield (
            torch.stack([image.features for image in some]).float(),
            torch.stack([image.others for image in some]).float(),
            torch.from_numpy(numbers[np.stack([image.labels for image in some])]),
        )


def _deviation(images: Sequence[Encoded]) -> Tensor:
    """Return the standard deviation (C,) of each feature over some images."""
    squares = torch.stack([image.features.float().square().mean(dim=(1, 2)) for image in images])
    means = torch.stack([image.features.float().mean(dim=(1, 2)) for image in images])
    variance = squares.mean(dim=0) - means.mean(dim=0).square()
    return variance.clamp(min=_LEAST_DEVIATION**2).sqrt()
