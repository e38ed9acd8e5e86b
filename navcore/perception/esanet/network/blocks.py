"""Convolution blocks of ESANet (Seichter et al. 2021, figure 2).

Attribute names are the official repository's, because they are the keys of its checkpoints;
registration order is key order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from torch import Tensor, nn
from torch.nn import functional

NBT1D_EPS = 1e-3
"""Batch-norm epsilon in a non-bottleneck-1D block; all other batch norms have torch's 1e-5."""


def relu(x: Tensor) -> Tensor:
    """Apply ReLU in place: no caller passes a tensor that is read again."""
    return functional.relu(x, inplace=True)


def chain(modules: nn.Sequential | nn.ModuleList | Sequence[nn.Module], x: Tensor) -> Tensor:
    """Apply the modules to `x` one after the other."""
    for module in modules:
        x = module(x)
    return x


class ConvBnAct(nn.Module):
    """Convolution without bias, batch norm and ReLU; keeps the size of the map."""

    def __init__(self, channels_in: int, channels_out: int, *, kernel: int) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels_in, channels_out, kernel, padding=kernel // 2, bias=False)
        self.bn = nn.BatchNorm2d(channels_out)

    def forward(self, x: Tensor) -> Tensor:
        """Map (B, Cin, H, W) to (B, Cout, H, W)."""
        return relu(self.bn(self.conv(x)))


class ResidualBlock(nn.Module):
    """Base of the residual blocks: y = ReLU(branch(x) + shortcut(x)); subclasses define the
    branch."""

    expansion: ClassVar[int] = 1
    """Number of output channels per channel of the branch."""
    downsample: nn.Sequential | None

    def branch(self, x: Tensor) -> Tensor:
        """Map (B, Cin, H, W) to (B, channels · expansion, H/stride, W/stride), before the last
        ReLU."""
        raise NotImplementedError

    def forward(self, x: Tensor) -> Tensor:
        """Map (B, Cin, H, W) to (B, channels · expansion, H/stride, W/stride)."""
        shortcut = x if self.downsample is None else chain(self.downsample, x)
        return relu(self.branch(x) + shortcut)

    def _shortcut(self, channels_in: int, channels: int, stride: int) -> nn.Sequential | None:
        """Return a 1×1 convolution and batch norm if the branch changes the shape, else None."""
        channels_out = channels * self.expansion
        if stride == 1 and channels_in == channels_out:
            return None
        return nn.Sequential(
            nn.Conv2d(channels_in, channels_out, 1, stride, bias=False),
            nn.BatchNorm2d(channels_out),
        )


class BasicBlock(ResidualBlock):
    """Block of two 3×3 convolutions (ResNet 18 and 34)."""

    def __init__(self, channels_in: int, channels: int, stride: int = 1) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels_in, channels, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(channels)
        self.conv2 = nn.Conv2d(channels, channels, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(channels)
        self.downsample = self._shortcut(channels_in, channels, stride)

    def branch(self, x: Tensor) -> Tensor:
        x = relu(self.bn1(self.conv1(x)))
        return self.bn2(self.conv2(x))  # type: ignore[no-any-return]


class Bottleneck(ResidualBlock):
    """Block of 1×1, 3×3 and 1×1 convolutions (ResNet 50), the stride in the 3×3 one as in
    torchvision."""

    expansion: ClassVar[int] = 4

    def __init__(self, channels_in: int, channels: int, stride: int = 1) -> None:
        super().__init__()
        channels_out = channels * self.expansion
        self.conv1 = nn.Conv2d(channels_in, channels, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(channels)
        self.conv2 = nn.Conv2d(channels, channels, 3, stride, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(channels)
        self.conv3 = nn.Conv2d(channels, channels_out, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(channels_out)
        self.downsample = self._shortcut(channels_in, channels, stride)

    def branch(self, x: Tensor) -> Tensor:
        x = relu(self.bn1(self.conv1(x)))
        x = relu(self.bn2(self.conv2(x)))
        return self.bn3(self.conv3(x))  # type: ignore[no-any-return]


class NonBottleneck1D(ResidualBlock):
    """Block of two 3×3 convolutions, each split into 3×1 and 1×3 with a ReLU between (Romera et al.
    2017, ERFNet).

    It has a third fewer weights than the basic block and more nonlinearities. The convolutions have
    a bias.
    """

    def __init__(self, channels_in: int, channels: int, stride: int = 1) -> None:
        super().__init__()
        self.conv3x1_1 = nn.Conv2d(channels_in, channels, (3, 1), (stride, 1), (1, 0))
        self.conv1x3_1 = nn.Conv2d(channels, channels, (1, 3), (1, stride), (0, 1))
        self.bn1 = nn.BatchNorm2d(channels, eps=NBT1D_EPS)
        self.conv3x1_2 = nn.Conv2d(channels, channels, (3, 1), padding=(1, 0))
        self.conv1x3_2 = nn.Conv2d(channels, channels, (1, 3), padding=(0, 1))
        self.bn2 = nn.BatchNorm2d(channels, eps=NBT1D_EPS)
        self.downsample = self._shortcut(channels_in, channels, stride)

    def branch(self, x: Tensor) -> Tensor:
        x = relu(self.bn1(self.conv1x3_1(relu(self.conv3x1_1(x)))))
        return self.bn2(self.conv1x3_2(relu(self.conv3x1_2(x))))  # type: ignore[no-any-return]
