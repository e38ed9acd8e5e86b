"""ResNet encoder of one modality: a stem at half resolution, then four stages."""

from __future__ import annotations

from torch import Tensor, nn

from navcore.perception.esanet.network.blocks import ResidualBlock, chain, relu
from navcore.perception.esanet.network.variants import Variant


class Encoder(nn.Module):
    """Stem and stages of a ResNet, called one by one since depth is fused into colour after
    each."""

    def __init__(self, variant: Variant, channels_in: int, stem_channels: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels_in, stem_channels, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(stem_channels)
        widths = [stem_channels * factor for factor in (1, 2, 4, 8)]
        expansion = variant.block.expansion
        before = [stem_channels, *(width * expansion for width in widths)]
        for number, (width, blocks) in enumerate(zip(widths, variant.blocks, strict=True), start=1):
            stage = _stage(
                variant.block, before[number - 1], width, blocks, stride=1 if number == 1 else 2
            )
            self.add_module(f"layer{number}", stage)
        self.channels = tuple(before)
        """Number of channels after the stem and after each stage."""

    def stem(self, image: Tensor) -> Tensor:
        """Map (B, 3 or 1, H, W) to (B, C, H/2, W/2), before the max-pool, because the first fusion
        is in between."""
        return relu(self.bn1(self.conv1(image)))

    def stage(self, number: int, x: Tensor) -> Tensor:
        """Run stage 1 to 4; the first keeps the size of the map, each other halves it."""
        stage = self.get_submodule(f"layer{number}")
        assert isinstance(stage, nn.Sequential)
        return chain(stage, x)


def _stage(
    block: type[ResidualBlock], channels_in: int, channels: int, blocks: int, *, stride: int
) -> nn.Sequential:
    """Build residual blocks, of which the first changes the size and the channels of the map."""
    first = block(channels_in, channels, stride)
    return nn.Sequential(
        first, *(block(channels * block.expansion, channels) for _ in range(blocks - 1))
    )
