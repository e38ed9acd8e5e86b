"""Batches of tensors from a data set: order of the images, decoding and caching."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from navcore.errors import BadConfiguration
from navcore.learning.data.card import Sample, Split
from navcore.learning.data.dataset import Dataset
from navcore.learning.training.augmentation import augmented, resized
from navcore.learning.training.distributed import Ranks
from navcore.learning.training.recipe import Augmentation, Recipe
from navcore.perception.esanet.network.preprocess import (
    DepthStatistics,
    Size,
    normalise_depth,
    normalise_rgb,
)

_MEGABYTE = 1 << 20
Indexes = npt.NDArray[np.int64]
MapBatches = Callable[[Callable[[Indexes], "Batch"], Iterable[Indexes]], Iterator["Batch"]]
"""A function like `map`; the application may prepare batches ahead of time in threads, which this
package does not start."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """Preprocessed images and their labels."""

    rgb: Tensor
    """(B, 3, h, w) float32 normalised colours, channels last in memory."""
    depth: Tensor
    """(B, 1, h, w) float32 normalised depth."""
    labels: Tensor
    """(B, h, w) uint8 labels, 0 = void, else class + 1."""


class BatchSource(Protocol):
    """What a training learns from."""

    @property
    def kind(self) -> str | None:
        """What the images are and how they are made, a part of the run's identity; None for the
        train split of the data set."""

    @property
    def steps(self) -> int:
        """Number of batches of an epoch."""

    def batches(self, epoch: int) -> Iterator[Batch]:
        """Return the batches of an epoch, numbered from 1."""


class CachedSplit:
    """The samples of one split; as many as fit in `cache_mb` megabytes stay decoded.
    Thread-safe."""

    def __init__(self, dataset: Dataset, split: Split, *, cache_mb: int) -> None:
        self.dataset, self.split = dataset, split
        self._free_bytes = cache_mb * _MEGABYTE
        self._cache: dict[int, Sample] = {}

    def __len__(self) -> int:
        """Return the number of samples of the split."""
        return self.dataset.count(self.split)

    def __getitem__(self, index: int) -> Sample:
        """Return a sample, from the cache or the disk."""
        sample = self._cache.get(index)
        if sample is None:
            sample = self.dataset.read(self.split, index)
            size_bytes = sample.rgb.nbytes + sample.depth.nbytes + sample.labels.nbytes
            if (
                size_bytes <= self._free_bytes
            ):  # two threads may both find room for a last one; that is no harm
                self._free_bytes -= size_bytes
                self._cache[index] = sample
        return sample


class DatasetBatches:
    """Random variations of all images of the train split, in a new order every epoch."""

    kind = None

    def __init__(
        self,
        dataset: Dataset,
        recipe: Recipe,
        *,
        ranks: Ranks,
        cache_mb: int,
        map_batches: MapBatches = map,
    ) -> None:
        """Keep up to `cache_mb` megabytes of decoded images; raises `BadConfiguration` if a batch
        cannot be filled or split among the processes."""
        self._images = CachedSplit(dataset, "train", cache_mb=cache_mb)
        self._recipe, self._ranks, self._map = recipe, ranks, map_batches
        self.steps = len(self._indexes(0))

    def batches(self, epoch: int) -> Iterator[Batch]:
        """Return the batches of an epoch, numbered from 1."""
        recipe = self._recipe
        return self._map(
            lambda indexes: training_batch(
                self._images,
                indexes,
                recipe.size,
                recipe.augmentation,
                seed=recipe.seed,
                epoch=epoch,
                crop=recipe.crop,
            ),
            self._indexes(epoch),
        )

    def _indexes(self, epoch: int) -> list[Indexes]:
        ranks, recipe = self._ranks, self._recipe
        return epoch_batches(
            len(self._images),
            recipe.batch,
            seed=recipe.seed,
            epoch=epoch,
            rank=ranks.rank,
            ranks=ranks.count,
        )


def epoch_batches(
    count: int, batch: int, *, seed: int, epoch: int, rank: int = 0, ranks: int = 1
) -> list[npt.NDArray[np.int64]]:
    """Return the image indexes of each step: a new order every epoch, without an incomplete last
    batch.

    Each rank gets its own part of every batch, so that all ranks together see the images of a
    single process at each step.
    """
    if batch % ranks:
        raise BadConfiguration(
            f"training: a batch of {batch} cannot be split among {ranks} processes"
        )
    if batch // ranks < 2:
        raise BadConfiguration(
            f"training: a batch of {batch} leaves {ranks} processes one image each; "
            "batch norm needs two"
        )
    if count < batch:
        raise BadConfiguration(f"training: {count} images do not fill one batch of {batch}")
    order = np.random.default_rng([seed, epoch]).permutation(count).astype(np.int64)
    steps = count // batch
    return list(order[: steps * batch].reshape(steps, ranks, batch // ranks)[:, rank])


def training_batch(
    images: CachedSplit,
    indexes: Sequence[int] | npt.NDArray[np.int64],
    size: Size,
    changes: Augmentation,
    *,
    seed: int,
    epoch: int,
    crop: Size | None = None,
) -> Batch:
    """Return random variations of the images, which depend only on seed, epoch and index."""
    samples = [
        augmented(
            images[int(index)],
            size,
            changes,
            np.random.default_rng([seed, epoch, int(index)]),
            crop=crop,
        )
        for index in indexes
    ]
    return as_batch(samples, images.dataset.card.depth)


def plain_batch(samples: Sequence[Sample], size: Size, statistics: DepthStatistics) -> Batch:
    """Return the samples resized to the working size, without augmentation."""
    return as_batch([resized(sample, size) for sample in samples], statistics)


def as_batch(samples: Sequence[Sample], statistics: DepthStatistics) -> Batch:
    """Normalise and stack samples of one size."""
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
