"""ESANet, the network that labels pixels from colour and depth.

D. Seichter, M. Köhler, B. Lewandowski, T. Wengefeld, H.-M. Gross, "Efficient RGB-D Semantic
Segmentation for Indoor Scene Analysis", ICRA 2021 (arXiv 2011.06961). Keys, shapes and numbers are
those of the official repository's SE-add, `ppm`, `learned-3x3-zeropad` networks, so that its
checkpoints load.
"""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional

from navcore.errors import BadFrame
from navcore.perception.esanet.network.blocks import ConvBnAct
from navcore.perception.esanet.network.decoder import Decoder, Outputs
from navcore.perception.esanet.network.encoder import Encoder
from navcore.perception.esanet.network.fusion import SqueezeExciteAdd
from navcore.perception.esanet.network.initialise import initialise
from navcore.perception.esanet.network.limits import STRIDE
from navcore.perception.esanet.network.pyramid_pooling import PyramidPooling
from navcore.perception.esanet.network.variants import (
    DECODER_CHANNELS,
    Variant,
    check_num_classes,
    stem_channels,
    variant_named,
)


def build(variant: str, num_classes: int, *, width: float = 1.0) -> EsaNet:
    """Build a network with initial weights (Kaiming), on the CPU, in train mode.

    `variant` is `r18`, `r18-nbt1d`, `r34`, `r34-nbt1d` or `r50`; `width` scales every number of
    channels, in steps of 1/8. Draws from torch's global generator. Raises `BadConfiguration`.
    """
    network = EsaNet(variant_named(variant), num_classes, width=width)
    initialise(network)
    return network


class EsaNet(nn.Module):
    """ESANet: two encoders, fused after the stem and each stage, a context module and a decoder."""

    def __init__(self, variant: Variant, num_classes: int, *, width: float = 1.0) -> None:
        super().__init__()
        check_num_classes(num_classes)
        self.variant, self.num_classes, self.width = variant.name, num_classes, width
        stem = stem_channels(width)
        self.encoder_rgb = Encoder(variant, 3, stem)
        self.encoder_depth = Encoder(variant, 1, stem)
        channels = self.encoder_rgb.channels
        decoder_channels = [stem * factor for factor in DECODER_CHANNELS]
        self._add_fusions(channels)
        self._add_skips(channels[1:4], decoder_channels[::-1])
        self.context_module = PyramidPooling(channels[-1], decoder_channels[0])
        self.decoder = Decoder(decoder_channels, num_classes)

    def _add_fusions(self, channels: tuple[int, ...]) -> None:
        for number, at_stage in enumerate(channels):
            self.add_module(f"se_layer{number}", SqueezeExciteAdd(at_stage))

    def _add_skips(self, channels: tuple[int, ...], decoder_channels: list[int]) -> None:
        for number, (at_stage, wanted) in enumerate(
            zip(channels, decoder_channels, strict=True), start=1
        ):
            self.add_module(
                f"skip_layer{number}", nn.Sequential(ConvBnAct(at_stage, wanted, kernel=1))
            )

    def forward(self, rgb: Tensor, depth: Tensor) -> Tensor | Outputs:
        """Map normalised rgb (B, 3, H, W) and depth (B, 1, H, W) to logits (B, classes, H, W).

        In train mode also return the side outputs: (full, 1/8, 1/16, 1/32). Raises `BadFrame`
        unless H and W are multiples of 32.
        """
        check_inputs(rgb, depth)
        skips, fused = self.encode(rgb, depth)
        outputs: Tensor | Outputs = self.decoder(self.context_module(fused), skips)
        return outputs

    def with_features(self, rgb: Tensor, depth: Tensor) -> tuple[Tensor, Tensor]:
        """Return the logits (B, classes, H, W) and the features (B, C, H/4, W/4) before the
        classifier; otherwise as `forward` outside train mode."""
        check_inputs(rgb, depth)
        skips, fused = self.encode(rgb, depth)
        return self.decoder.with_features(self.context_module(fused), skips)

    def encode(self, rgb: Tensor, depth: Tensor) -> tuple[list[Tensor], Tensor]:
        """Return the skips at 1/4, 1/8, 1/16 for the decoder, and the fused map at 1/32.

        Each rgb stage continues from the fused map; the depth encoder never sees colour.
        """
        rgb, depth = self.encoder_rgb.stem(rgb), self.encoder_depth.stem(depth)
        fused, depth = max_pool(self._fuse(0, rgb, depth)), max_pool(depth)
        skips = []
        for number in (1, 2, 3, 4):
            rgb, depth = (
                self.encoder_rgb.stage(number, fused),
                self.encoder_depth.stage(number, depth),
            )
            fused = self._fuse(number, rgb, depth)
            if number < 4:
                skips.append(self.get_submodule(f"skip_layer{number}")(fused))
        return skips, fused

    def _fuse(self, number: int, rgb: Tensor, depth: Tensor) -> Tensor:
        fused: Tensor = self.get_submodule(f"se_layer{number}")(rgb, depth)
        return fused


def max_pool(x: Tensor) -> Tensor:
    """(B, C, H, W) → (B, C, H/2, W/2)."""
    return functional.max_pool2d(x, kernel_size=3, stride=2, padding=1)


def check_inputs(rgb: Tensor, depth: Tensor) -> None:
    """Raise `BadFrame` unless rgb and depth are a batch of one size that the network accepts."""
    for name, tensor, channels in (("rgb", rgb, 3), ("depth", depth, 1)):
        if tensor.ndim != 4 or tensor.shape[1] != channels:
            raise BadFrame(
                f"ESANet: {name} has shape {tuple(tensor.shape)}, "
                f"expected (batch, {channels}, height, width)"
            )
        if not tensor.is_floating_point():
            raise BadFrame(
                f"ESANet: {name} is {tensor.dtype}, expected normalised floats "
                "(navcore.perception.esanet.network.preprocess)"
            )
    if rgb.shape[0] != depth.shape[0] or rgb.shape[2:] != depth.shape[2:]:
        raise BadFrame(
            f"ESANet: rgb {tuple(rgb.shape)} and depth {tuple(depth.shape)} "
            "differ in batch, height or width"
        )
    height, width = rgb.shape[2:]
    if rgb.shape[0] == 0 or height == 0 or width == 0 or height % STRIDE or width % STRIDE:
        raise BadFrame(
            f"ESANet: a batch of {rgb.shape[0]} images of {height}×{width}; "
            f"expected at least one, its height and width multiples of {STRIDE}: resize them first"
        )
