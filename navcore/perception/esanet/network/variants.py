"""Variants of ESANet: kind of encoder block, and number of blocks per stage."""

from __future__ import annotations

from dataclasses import dataclass

from navcore.errors import BadConfiguration
from navcore.perception.esanet.network.blocks import (
    BasicBlock,
    Bottleneck,
    NonBottleneck1D,
    ResidualBlock,
)
from navcore.perception.esanet.network.limits import MAX_CLASSES

BASE_CHANNELS = 64
"""Channels of the stem at width 1; all other channels are multiples of it."""
DECODER_CHANNELS = (8, 4, 2)
"""Channels of the three decoder modules, in multiples of the stem: 512, 256, 128 at width 1."""
WIDTH_STEP = 1 / 8
MAX_WIDTH = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One encoder of the paper's Table I; the decoder is the same for all of them."""

    name: str
    """Name of the variant, as `build` takes it."""
    block: type[ResidualBlock]
    """Type of the residual blocks of both encoders."""
    blocks: tuple[int, int, int, int]
    """Number of blocks per stage."""


VARIANTS = (
    Variant(name="r18", block=BasicBlock, blocks=(2, 2, 2, 2)),
    Variant(name="r18-nbt1d", block=NonBottleneck1D, blocks=(2, 2, 2, 2)),
    Variant(name="r34", block=BasicBlock, blocks=(3, 4, 6, 3)),
    Variant(name="r34-nbt1d", block=NonBottleneck1D, blocks=(3, 4, 6, 3)),
    Variant(name="r50", block=Bottleneck, blocks=(3, 4, 6, 3)),
)


def variant_named(name: str) -> Variant:
    """Return the variant of a name; raises `BadConfiguration` with the known names."""
    for variant in VARIANTS:
        if variant.name == name:
            return variant
    known = ", ".join(variant.name for variant in VARIANTS)
    raise BadConfiguration(f"ESANet: no variant {name!r:.60}; known variants: {known}")


def stem_channels(width: float) -> int:
    """Return the channels of the stem at a width; raises `BadConfiguration` unless the width is a
    multiple of 1/8."""
    number = isinstance(width, int | float) and not isinstance(width, bool)
    if not number or not WIDTH_STEP <= width <= MAX_WIDTH or width % WIDTH_STEP:
        raise BadConfiguration(
            f"ESANet: width {width!r:.40}: expected a multiple of {WIDTH_STEP:g} "
            f"from it to {MAX_WIDTH:g}"
        )
    return int(BASE_CHANNELS * width)


def check_num_classes(num_classes: int) -> None:
    """Raise `BadConfiguration` unless the number of classes is a whole number from 1 to 255."""
    if (
        isinstance(num_classes, bool)
        or not isinstance(num_classes, int)
        or not 1 <= num_classes <= MAX_CLASSES
    ):
        raise BadConfiguration(
            f"ESANet: num_classes is {num_classes!r:.40}, "
            f"expected a whole number from 1 to {MAX_CLASSES}"
        )
