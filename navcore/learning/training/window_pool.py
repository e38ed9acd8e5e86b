"""Decoded images in the memory of the device that trains, and random windows of them.

The windows are those of `augmentation.augmented`, for a whole batch at once: where a GPU trains,
preparing them on the processor takes longer than the step that learns from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from navcore.learning.data.card import Sample
from navcore.learning.data.images import LabelArray
from navcore.learning.data.photometry import KERNEL_SIDE, NEUTRAL_K
from navcore.learning.training.augmentation import least_scale
from navcore.learning.training.batches import Batch
from navcore.learning.training.recipe import Augmentation, Recipe
from navcore.learning.training.tensor_photometry import exposed, filtered, motion_blurred, tinted
from navcore.perception.esanet.network.preprocess import (
    RGB_MEAN,
    RGB_STD,
    DepthStatistics,
    Size,
)

BYTES_PER_PIXEL = 6
"""Memory of colours, depth and label."""
POINTS = 16
"""Number of random pixels of each class of an image that windows may be laid around."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PooledImages:
    """Images of one size as a pool keeps them: tensors, which processes hand over without
    copies."""

    rgb: Tensor
    """(N, H, W, 3) uint8 colours."""
    depth: Tensor
    """(N, H, W) int16 of the same bits as the 16-bit depth."""
    labels: Tensor
    """(N, H, W) uint8 labels, 0 = void, else class + 1."""
    pixels: Tensor
    """(N, C) float32 number of pixels of each class."""
    points: Tensor
    """(N, C, POINTS, 2) int16 row and column of random pixels of each class, 0 where it has
    none."""

    @staticmethod
    def of(
        samples: Sequence[Sample], num_classes: int, random: np.random.Generator
    ) -> PooledImages:
        """Return samples of one size with random points of their classes."""
        described = [_class_points(sample.labels, num_classes, random) for sample in samples]
        depth = np.stack([sample.depth for sample in samples]).astype(np.uint16, copy=False)
        return PooledImages(
            rgb=torch.from_numpy(np.stack([sample.rgb for sample in samples])),
            depth=torch.from_numpy(depth.view(np.int16)),
            labels=torch.from_numpy(np.stack([sample.labels for sample in samples])),
            pixels=torch.from_numpy(np.stack([pixels for pixels, _ in described])),
            points=torch.from_numpy(np.stack([points for _, points in described])),
        )


class WindowPool:
    """The newest images of one size; a new one takes the place of the oldest when it is full."""

    def __init__(self, size: Size, capacity: int, num_classes: int, device: torch.device) -> None:
        """Take memory for `capacity` images, `BYTES_PER_PIXEL` each pixel."""
        shape = (capacity, size.height, size.width)
        self.size, self.count, self._next = size, 0, 0
        self._rgb = torch.empty((*shape, 3), dtype=torch.uint8, device=device)
        self._depth = torch.empty(shape, dtype=torch.int16, device=device)  # bits of 16-bit numbers
        self._labels = torch.empty(shape, dtype=torch.uint8, device=device)
        self._pixels = torch.zeros((capacity, num_classes), device=device)
        self._points = torch.zeros(
            (capacity, num_classes, POINTS, 2), dtype=torch.int16, device=device
        )

    def add(self, images: PooledImages) -> None:
        """Take images of the pool's size."""
        kept = (self._rgb, self._depth, self._labels, self._pixels, self._points)
        new = (images.rgb, images.depth, images.labels, images.pixels, images.points)
        for number in range(len(images.rgb)):
            at = self._next
            for tensor, values in zip(kept, new, strict=True):
                tensor[at] = values[number]
            self._next = (at + 1) % len(self._rgb)
            self.count = max(self.count, at + 1)

    def windows(
        self, count: int, recipe: Recipe, statistics: DepthStatistics, random: torch.Generator
    ) -> Batch:
        """Return random variations of `count` random images, of the recipe's crop or working
        size."""
        changes, window = recipe.augmentation, recipe.crop or recipe.size
        draw = _Draw(count, self._labels.device, random)
        images = draw.below(draw.same(self.count)).long()
        scale = draw.uniform(*changes.scale)
        reduced = draw.uniform(0, 1) < changes.reduced
        scale = torch.where(reduced, draw.uniform(least_scale(recipe.size, window), 1.0), scale)
        height = torch.round(recipe.size.height * scale).clamp(min=window.height)
        width = torch.round(recipe.size.width * scale).clamp(min=window.width)
        row = draw.below(height - window.height + 1)
        col = draw.below(width - window.width + 1)
        at_row, at_col = self._around_a_class(images, height, width, window, draw)
        focused = draw.uniform(0, 1) < changes.focus
        row, col = torch.where(focused, at_row, row), torch.where(focused, at_col, col)
        mirrored = draw.uniform(0, 1) < changes.flip
        rgb, depth, labels = self._cut(images, row, col, height, width, window, mirrored)
        return Batch(
            rgb=_normalised(_in_other_light(rgb, width, changes, draw)),
            depth=_normalised_depth(depth, statistics),
            labels=labels,
        )

    def _around_a_class(
        self, images: Tensor, height: Tensor, width: Tensor, window: Size, draw: _Draw
    ) -> tuple[Tensor, Tensor]:
        """Return the first row and column of windows around a random pixel of a random class,
        preferring small classes; without labels, around the upper left pixel."""
        pixels = self._pixels[images]
        odds = torch.where(pixels > 0, pixels.clamp(min=1).rsqrt(), torch.full_like(pixels, 1e-9))
        kinds = torch.multinomial(odds, 1, generator=draw.random)[:, 0]
        chosen = draw.below(draw.same(POINTS)).long()
        rows, cols = self._points[images, kinds, chosen].float().unbind(1)
        before = draw.below(draw.same(window.height))
        left = draw.below(draw.same(window.width))
        row = torch.floor(rows * height / self.size.height) - before
        col = torch.floor(cols * width / self.size.width) - left
        return (
            torch.minimum(row.clamp(min=0), height - window.height),
            torch.minimum(col.clamp(min=0), width - window.width),
        )

    def _cut(
        self,
        images: Tensor,
        row: Tensor,
        col: Tensor,
        height: Tensor,
        width: Tensor,
        window: Size,
        mirrored: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return windows of images that are resized to (`height`, `width`) as by OpenCV: colours
        (B, 3, h, w) bilinearly, depth and labels (B, h, w) by nearest neighbour."""
        device = images.device
        rows = row[:, None] + torch.arange(window.height, device=device)
        cols = col[:, None] + torch.arange(window.width, device=device)
        cols = torch.where(mirrored[:, None], cols.flip(1), cols)
        down, across = (self.size.height / height)[:, None], (self.size.width / width)[:, None]
        image = images[:, None, None]
        near = (
            torch.floor(rows * down).long().clamp(max=self.size.height - 1)[:, :, None],
            torch.floor(cols * across).long().clamp(max=self.size.width - 1)[:, None, :],
        )
        depth = self._depth[image, *near].int() & 0xFFFF
        labels = self._labels[image, *near]
        y = ((rows + 0.5) * down - 0.5).clamp(0, self.size.height - 1)
        x = ((cols + 0.5) * across - 0.5).clamp(0, self.size.width - 1)
        above, before = y.floor(), x.floor()
        lower, right = (y - above)[:, :, None, None], (x - before)[:, None, :, None]
        top, left = above.long()[:, :, None], before.long()[:, None, :]
        bottom = (top + 1).clamp(max=self.size.height - 1)
        beside = (left + 1).clamp(max=self.size.width - 1)
        upper_left, upper_right, lower_left, lower_right = (
            self._rgb[image, y, x].float() for y in (top, bottom) for x in (left, beside)
        )
        rgb = torch.lerp(
            torch.lerp(upper_left, upper_right, right),
            torch.lerp(lower_left, lower_right, right),
            lower,
        )
        return torch.round(rgb).permute(0, 3, 1, 2), depth, labels


def _class_points(
    labels: LabelArray, num_classes: int, random: np.random.Generator
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int16]]:
    """Return number (C,) and random pixels (C, POINTS, 2) of each class of an image."""
    flat = labels.ravel()
    pixels = np.bincount(flat, minlength=256)[1 : num_classes + 1].astype(np.float32)
    points = np.zeros((num_classes, POINTS, 2), dtype=np.int16)
    for number in np.flatnonzero(pixels):
        chosen = random.choice(np.flatnonzero(flat == number + 1), POINTS)
        points[number] = np.stack(np.divmod(chosen, labels.shape[1]), axis=1)
    return pixels, points


class _Draw:
    """Random numbers for each image of a batch."""

    def __init__(self, count: int, device: torch.device, random: torch.Generator) -> None:
        self._count, self._device, self.random = count, device, random

    def uniform(self, low: float, high: float) -> Tensor:
        """Return (B,) numbers from `low` to `high`."""
        return low + (high - low) * torch.rand(
            self._count, device=self._device, generator=self.random
        )

    def normal(self, *shape: int) -> Tensor:
        """Return (B, *shape) standard normal numbers."""
        return torch.randn(self._count, *shape, device=self._device, generator=self.random)

    def same(self, number: float) -> Tensor:
        """Return (B,) times the same number."""
        return torch.full((self._count,), float(number), device=self._device)

    def below(self, ends: Tensor) -> Tensor:
        """Return whole numbers (B,) from 0 to `ends` − 1, as float32."""
        return torch.minimum(torch.floor(self.uniform(0, 1) * ends), ends - 1)


def _in_other_light(rgb: Tensor, width: Tensor, changes: Augmentation, draw: _Draw) -> Tensor:
    """Return colours with random tint, textures, motion, exposure and white balance; `width` (B,)
    are those of the whole images in pixels."""
    low, high = changes.hsv
    factors = torch.stack([draw.uniform(low, high) for _ in range(3)], dim=1)
    rgb = tinted(rgb, factors)
    if changes.filtered:
        chosen = draw.uniform(0, 1) < changes.filtered
        rgb = filtered(rgb, chosen * draw.uniform(0, 1), draw.normal(KERNEL_SIDE, KERNEL_SIDE))
    if changes.blur != (0.0, 0.0):
        rgb = motion_blurred(rgb, width * draw.uniform(*changes.blur))
    if (changes.exposure, changes.white_k) == ((1.0, 1.0), (NEUTRAL_K, NEUTRAL_K)):
        return rgb
    light = torch.exp(draw.uniform(*np.log(changes.exposure).tolist()))
    low, high = changes.white_k  # even steps of what is seen: of the reciprocal
    return exposed(rgb, light, 1 / draw.uniform(1 / high, 1 / low))


def _normalised(rgb: Tensor) -> Tensor:
    mean, std = (torch.from_numpy(of)[:, None, None].to(rgb) for of in (RGB_MEAN, RGB_STD))
    return ((rgb / 255 - mean) / std).contiguous(memory_format=torch.channels_last)


def _normalised_depth(depth: Tensor, statistics: DepthStatistics) -> Tensor:
    """Return (B, 1, h, w) depth as `preprocess.normalise_depth` does."""
    normal = (depth - statistics.mean) / statistics.std
    unmeasured = (depth == 0) if statistics.raw else torch.zeros_like(depth, dtype=torch.bool)
    return torch.where(unmeasured, torch.zeros_like(normal), normal)[:, None]
