"""Preprocessing of camera images for the network: resizing, and normalisation of colour and
depth."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.errors import BadConfiguration, BadFrame
from navcore.toml_config import ranged

if TYPE_CHECKING:
    from torch import Tensor

RGB_MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
RGB_STD = np.array([0.229, 0.224, 0.225], dtype=np.float32)
"""Mean and standard deviation of ImageNet, in RGB order, of values from 0 to 1."""
MAX_SIDE_PX = 4096
"""Largest side of a working size; a typing error must not fill the memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthStatistics:
    """Depth statistics of the training data, in the unit of that data set."""

    mean: float = ranged(0.0, 1e6)
    """Mean depth in data set units."""
    std: float = ranged(1e-6, 1e6)
    """Standard deviation of the depth in data set units."""
    units_per_m: float = ranged(1e-3, 1e6)
    """Number of data set units per metre."""
    raw: bool = True
    """Whether a depth of 0 means "not measured" and is set to the mean; off for in-painted
    ("refined") depth."""

    def in_unit(self, units_per_m: float) -> DepthStatistics:
        """Return the same statistics for images in another unit: with those of its own the network
        would take every distance for another one."""
        factor = units_per_m / self.units_per_m
        return dataclasses.replace(
            self, mean=self.mean * factor, std=self.std * factor, units_per_m=units_per_m
        )


NYUV2_DEPTH = DepthStatistics(mean=2841.949, std=1417.259, units_per_m=1000.0)
SUNRGBD_DEPTH = DepthStatistics(mean=19025.149, std=9880.916, units_per_m=8000.0)
"""Statistics of SUN RGB-D, whose files hold millimetres shifted left by three bits."""
SCENENET_DEPTH = DepthStatistics(mean=4006.928, std=2459.776, units_per_m=1000.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """Size of an image."""

    height: int = ranged(32, MAX_SIDE_PX)
    """Number of rows."""
    width: int = ranged(32, MAX_SIDE_PX)
    """Number of columns."""


def resize_rgb(rgb: npt.NDArray[np.uint8], size: Size) -> npt.NDArray[np.uint8]:
    """Resize (H, W, 3) to (h, w, 3), bilinear."""
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8 or rgb.size == 0:
        raise BadFrame(f"rgb is {rgb.dtype} {rgb.shape}, expected uint8 (height, width, 3)")
    return np.asarray(
        cv2.resize(rgb, (size.width, size.height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8
    )


def resize_depth(depth: npt.NDArray[np.float32], size: Size) -> npt.NDArray[np.float32]:
    """Resize (H, W) to (h, w) by nearest neighbour: depth must not be mixed across edges."""
    if depth.ndim != 2 or depth.dtype != np.float32 or depth.size == 0:
        raise BadFrame(f"depth is {depth.dtype} {depth.shape}, expected float32 (height, width)")
    return np.asarray(
        cv2.resize(depth, (size.width, size.height), interpolation=cv2.INTER_NEAREST),
        dtype=np.float32,
    )


def normalise_rgb(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Normalise (H, W, 3) from 0 … 255: (rgb / 255 − mean) / std."""
    scaled: npt.NDArray[np.float32] = rgb.astype(np.float32) / np.float32(255.0)
    return (scaled - RGB_MEAN) / RGB_STD


def normalise_depth(
    depth: npt.NDArray[np.float32], statistics: DepthStatistics
) -> npt.NDArray[np.float32]:
    """Normalise (H, W) in data set units: (d − mean) / std, and exactly 0 where raw depth is
    missing."""
    normalised: npt.NDArray[np.float32] = (depth - np.float32(statistics.mean)) / np.float32(
        statistics.std
    )
    if statistics.raw:
        normalised[depth == 0] = 0.0
    return normalised


def to_tensors(
    rgb: npt.NDArray[np.uint8],
    depth: npt.NDArray[np.float32],
    size: Size,
    statistics: DepthStatistics,
) -> tuple[Tensor, Tensor]:
    """Preprocess colours (H, W, 3) and depth (H, W) in data set units to float32 rgb (1, 3, h, w)
    and depth (1, 1, h, w).

    rgb keeps its channels last in memory, which is fast for convolutions. Raises `BadFrame`.
    """
    import torch

    colours = normalise_rgb(resize_rgb(rgb, size))
    distances = normalise_depth(resize_depth(depth, size), statistics)
    return torch.from_numpy(colours).permute(2, 0, 1)[None], torch.from_numpy(distances)[None, None]


class Preprocessor:
    """`to_tensors` for the loop: bit-identical, with lookup tables and without new memory."""

    def __init__(self, size: Size, statistics: DepthStatistics) -> None:
        self._size, self._statistics = size, statistics
        levels = np.arange(256, dtype=np.uint8)
        self._table = np.ascontiguousarray(
            normalise_rgb(np.repeat(levels[:, None, None], 3, axis=2))[:, 0].T
        )
        self._rgb = np.empty((1, 3, size.height, size.width), dtype=np.float32)

    def __call__(
        self, rgb: npt.NDArray[np.uint8], depth: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Preprocess (H, W, 3) and (H, W) in data set units to (1, 3, h, w), valid until the next
        call, and (1, 1, h, w)."""
        _look_up(resize_rgb(rgb, self._size), self._table, self._rgb[0])
        return self._rgb, normalise_depth(resize_depth(depth, self._size), self._statistics)[
            None, None
        ]


@compiled
def _look_up(
    rgb: npt.NDArray[np.uint8], table: npt.NDArray[np.float32], planes: npt.NDArray[np.float32]
) -> None:
    """Map levels (h, w, 3) through one table per channel (3, 256) into planes (3, h, w)."""
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            for channel in range(3):
                planes[channel, i, j] = table[channel, rgb[i, j, channel]]


def check_size(size: Size, stride: int) -> None:
    """Raise `BadConfiguration` unless both sides are multiples of `stride` up to 4096."""
    for name, value in (("height", size.height), ("width", size.width)):
        if (
            isinstance(value, bool)
            or not isinstance(value, int)
            or not 0 < value <= MAX_SIDE_PX
            or value % stride
        ):
            raise BadConfiguration(
                f"ESANet: working {name} {value!r:.40}: expected a multiple of {stride} "
                f"from {stride} to {MAX_SIDE_PX}"
            )
