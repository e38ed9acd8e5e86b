"""How depth enters colour: both are re-weighted channel by channel, then added (squeeze and
excitation, the paper's SE-add)."""

from __future__ import annotations

from torch import Tensor, nn

from navcore.perception.esanet.network.blocks import chain

REDUCTION = 16
"""The bottleneck of the gate has this many times fewer channels."""


class SqueezeExcite(nn.Module):
    """Scales each channel by a gate in (0, 1) computed from the means of all channels (Hu et al.
    2018)."""

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
        """(B, C, H, W) → (B, C, 1, 1) in (0, 1)."""
        return chain(self.fc, x.mean(dim=(2, 3), keepdim=True))

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, H, W) → the same shape."""
        return x * self.gate(x)


class SqueezeExciteAdd(nn.Module):
    """Fused = SE(rgb) + SE(depth)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.se_rgb = SqueezeExcite(channels)
        self.se_depth = SqueezeExcite(channels)

    def forward(self, rgb: Tensor, depth: Tensor) -> Tensor:
        """Two maps (B, C, H, W) → one of the same shape."""
        return self.se_rgb(rgb) + self.se_depth(depth)  # type: ignore[no-any-return]
