"""Fusion of depth into colour: both are re-weighted per channel, then added (squeeze and
excitation, the paper's SE-add)."""

from __future__ import annotations

from torch import Tensor, nn

from navcore.perception.esanet.network.blocks import chain

REDUCTION = 16
"""Reduction of the number of channels in the bottleneck of the gate."""


class SqueezeExcite(nn.Module):
    """Squeeze and excitation: scale each channel by a gate in (0, 1) computed from the means of all
    channels (Hu et al. 2018)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        squeezed = max(1, channels // REDUCTION)
        self.fc = nn.Sequential(
            nn.Conv2d(channels, squeezed, 1),
            nn.ReLU(),
            nn.Conv2d(squeezed, channels, 1),
            nn.Sigmoid(),
        )

    def gate(self, x: Tensor) -> Tensor:
        """Map (B, C, H, W) to gates (B, C, 1, 1) in (0, 1)."""
        return chain(self.fc, x.mean(dim=(2, 3), keepdim=True))

    def forward(self, x: Tensor) -> Tensor:
        """Scale the channels of (B, C, H, W)."""
        return x * self.gate(x)


class SqueezeExciteAdd(nn.Module):
    """Fusion by addition: SE(rgb) + SE(depth)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.se_rgb = SqueezeExcite(channels)
        self.se_depth = SqueezeExcite(channels)

    def forward(self, rgb: Tensor, depth: Tensor) -> Tensor:
        """Fuse two maps (B, C, H, W) into one of the same shape."""
        return self.se_rgb(rgb) + self.se_depth(depth)  # type: ignore[no-any-return]
