"""Batches of tensors out of a data set: which pictures, in which order, and each of them decoded
only once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from navcore.errors import BadConfiguration
from navcore.learning.data.card import Sample, Split
from navcore.learning.data.dataset import Dataset
from navcore.learning.training.augmentation import augmented, resized
from navcore.learning.training.recipe import Augmentation
from navcore.perception.esanet.network.preprocess import (
    DepthStatistics,
    Size,
    normalise_depth,
    normalise_rgb,
)

_MEGABYTE = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """Pictures ready for the network."""

    rgb: Tensor
    """(B, 3, h, w) float32, normalised, channels last in memory."""
    depth: Tensor
    """(B, 1, h, w) float32, normalised."""
    labels: Tensor
    """(B, h, w) uint8, 0 = void, else class + 1."""


class Pictures:
    """The pictures of one split; as many as fit in `cache_mb` megabytes are kept decoded. Threads
    may share it."""

    def __init__(self, dataset: Dataset, split: Split, *, cache_mb: int) -> None:
        self.dataset, self.split = dataset, split
        self._room_bytes = cache_mb * _MEGABYTE
        self._kept: dict[int, Sample] = {}

    def __len__(self) -> int:
        """Pictures of the split."""
        return self.dataset.count(self.split)

    def __getitem__(self, index: int) -> Sample:
        """The picture as it is on the disk."""
        sample = self._kept.get(index)
        if sample is None:
            sample = self.dataset.read(self.split, index)
            size_bytes = sample.rgb.nbytes + sample.depth.nbytes + sample.labels.nbytes
            if (
                size_bytes <= self._room_bytes
            ):  # two threads may both find room for a last one; that is no harm
                self._room_bytes -= size_bytes
                self._kept[index] = sample
        return sample


def epoch_batches(
    count: int, batch: int, *, seed: int, epoch: int, rank: int = 0, ranks: int = 1
) -> list[npt.NDArray[np.int64]]:
    """The indexes of each step's pictures: a fresh order every epoch, without the rest that fills
    no batch.

    Each rank gets its own part of every batch, so that all of them together take the steps that one
    would take alone.
    """
    if batch % ranks:
        raise BadConfiguration(
            f"training: a batch of {batch} cannot be split among {ranks} processes"
        )
    if batch // ranks < 2:
        raise BadConfiguration(
            f"training: a batch of {batch} leaves {ranks} processes one picture each; batch norm needs two"
        )
    if count < batch:
        raise BadConfiguration(f"training: {count} pictures do not fill one batch of {batch}")
    order = np.random.default_rng([seed, epoch]).permutation(count).astype(np.int64)
    steps = count // batch
    return list(order[: steps * batch].reshape(steps, ranks, batch // ranks)[:, rank])


def training_batch(
    pictures: Pictures,
    indexes: Sequence[int] | npt.NDArray[np.int64],
    size: Size,
    changes: Augmentation,
    *,
    seed: int,
    epoch: int,
    crop: Size | None = None,
) -> Batch:
    """Random variations of these pictures, which depend on nothing but seed, epoch and index."""
    samples = [
        augmented(
            pictures[int(index)],
            size,
            changes,
            np.random.default_rng([seed, epoch, int(index)]),
            crop=crop,
        )
        for index in indexes
    ]
    return as_batch(samples, pictures.dataset.card.depth)


def plain_batch(samples: Sequence[Sample], size: Size, statistics: DepthStatistics) -> Batch:
    """The samples resized to the working size, nothing else."""
    return as_batch([resized(sample, size) for sample in samples], statistics)


def as_batch(samples: Sequence[Sample], statistics: DepthStatistics) -> Batch:
    """Samples of one size, normalised and stacked."""
    rgb = np.stack([normalise_rgb(sample.rgb) for sample in samples])
    depth = np.stack(
        [normalise_depth(sample.depth.astype(np.float32), statistics) for sample in samples]
    )
    labels = np.stack([sample.labels for sample in samples])
    return Batch(
        rgb=torch.from_numpy(rgb).permute(0, 3, 1, 2),
        depth=torch.from_numpy(depth)[:, None],
        labels=torch.from_numpy(labels),
    )
