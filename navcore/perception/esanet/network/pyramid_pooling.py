"""Pyramid pooling: the context module of the paper, which adds global context to each pixel."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from navcore.perception.esanet.network.blocks import ConvBnAct

BINS = (1, 5)
"""Number of cells per side of the pooled maps."""


class PyramidPooling(nn.Module):
    """The map concatenated with its averages over 1×1 and 5×5 cells (Zhao et al. 2017), mixed by a
    1×1 convolution."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        branch = channels_in // len(BINS)
        self.features = nn.ModuleList(
            nn.Sequential(nn.AdaptiveAvgPool2d(bins), ConvBnAct(channels_in, branch, kernel=1))
            for bins in BINS
        )
        self.final_conv = ConvBnAct(channels_in + branch * len(BINS), channels_out, kernel=1)

    def forward(self, x: Tensor) -> Tensor:
        """Map (B, Cin, H, W) to (B, Cout, H, W)."""
        return self.final_conv(  # type: ignore[no-any-return]
            torch.cat([x, *(enlarge(pool(x), x) for pool in self.features)], dim=1)
        )


def enlarge(pooled: Tensor, like: Tensor) -> Tensor:
    """Resize the pooled map to the size of `like` by nearest neighbour, because the official
    learned upsampling supports only a factor of two."""
    return functional.interpolate(pooled, size=like.shape[2:], mode="nearest")
