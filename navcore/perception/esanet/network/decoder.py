"""Decoder from 1/32 to full size: three modules that add the encoders' skips, then two upsamplings
of the class maps."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from navcore.perception.esanet.network.blocks import ConvBnAct, NonBottleneck1D, chain

BLOCKS_PER_MODULE = 3
"""Number of non-bottleneck-1D blocks per decoder module."""
Outputs = tuple[Tensor, Tensor, Tensor, Tensor]
"""Logits (B, classes, h, w) at full size, 1/8, 1/16 and 1/32."""


class LearnedUpsampling(nn.Module):
    """Upsampling by two: nearest neighbour, then a 3×3 convolution per channel that is initially
    bilinear interpolation."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels, channels, 3, padding=1, groups=channels)
        self.reset_to_bilinear()

    def reset_to_bilinear(self) -> None:
        """Set the kernel to [1 2 1] × [1 2 1] / 16 and the bias to 0."""
        ramp = torch.tensor([1.0, 2.0, 1.0]) / 4
        with torch.no_grad():
            self.conv.weight.copy_(torch.outer(ramp, ramp).expand_as(self.conv.weight))
        if self.conv.bias is not None:
            nn.init.zeros_(self.conv.bias)

    def forward(self, x: Tensor) -> Tensor:
        """Upsample (B, C, H, W) to (B, C, 2H, 2W)."""
        return self.conv(functional.interpolate(x, scale_factor=2.0, mode="nearest"))  # type: ignore[no-any-return]


class DecoderModule(nn.Module):
    """Decoder module: 3×3 convolution, three non-bottleneck-1D blocks, learned upsampling, plus the
    skip of that size."""

    def __init__(self, channels_in: int, channels: int, num_classes: int) -> None:
        super().__init__()
        self.conv3x3 = ConvBnAct(channels_in, channels, kernel=3)
        self.decoder_blocks = nn.Sequential(
            *(NonBottleneck1D(channels, channels) for _ in range(BLOCKS_PER_MODULE))
        )
        self.upsample = LearnedUpsampling(channels)
        self.side_output = nn.Conv2d(channels, num_classes, 1)

    def refine(self, x: Tensor) -> Tensor:
        """Map (B, Cin, h, w) to (B, C, h, w), the input of the side output."""
        return chain(self.decoder_blocks, self.conv3x3(x))

    def merge(self, refined: Tensor, skip: Tensor) -> Tensor:
        """Upsample (B, C, h, w) and add the skip (B, C, 2h, 2w)."""
        return self.upsample(refined) + skip  # type: ignore[no-any-return]


class Decoder(nn.Module):
    """Decoder from the context at 1/32 and the skips at 1/16, 1/8 and 1/4 to class logits."""

    def __init__(self, channels: Sequence[int], num_classes: int) -> None:
        """Build the modules; `channels` are those of the three modules, the context has the
        first."""
        super().__init__()
        first, second, third = channels
        self.decoder_module_1 = DecoderModule(first, first, num_classes)
        self.decoder_module_2 = DecoderModule(first, second, num_classes)
        self.decoder_module_3 = DecoderModule(second, third, num_classes)
        self.conv_out = nn.Conv2d(third, num_classes, 3, padding=1)
        self.upsample1 = LearnedUpsampling(num_classes)
        self.upsample2 = LearnedUpsampling(num_classes)

    def forward(self, x: Tensor, skips: Sequence[Tensor]) -> Tensor | Outputs:
        """Return the logits at full size, in train mode with the side outputs.

        `skips` are ordered from fine to coarse: 1/4, 1/8, 1/16.
        """
        features, side_outputs = self._decoded(x, skips)
        logits = self.classified(features)
        if not self.training:
            return logits
        coarse, middle, fine = side_outputs
        return logits, fine, middle, coarse

    def with_features(self, x: Tensor, skips: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Return the logits at full size, and what the classifier makes them of: the features
        (B, C, h, w) at 1/4."""
        features, _ = self._decoded(x, skips)
        return self.classified(features), features

    def _decoded(self, x: Tensor, skips: Sequence[Tensor]) -> tuple[Tensor, list[Tensor]]:
        """Return the features at 1/4 and, in train mode, the side outputs from coarse to fine."""
        side_outputs = []
        modules = (self.decoder_module_1, self.decoder_module_2, self.decoder_module_3)
        for module, skip in zip(modules, reversed(skips), strict=True):
            refined = module.refine(x)
            if self.training:
                side_outputs.append(module.side_output(refined))
            x = module.merge(refined, skip)
        return x, side_outputs

    def classified(self, features: Tensor) -> Tensor:
        """Map the features (B, C, h, w) at 1/4 to logits (B, classes, 4h, 4w)."""
        return self.upsample2(self.upsample1(self.conv_out(features)))  # type: ignore[no-any-return]
