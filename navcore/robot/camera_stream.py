"""Image size and rate of the depth camera: those that an Intel RealSense D455 offers."""

from __future__ import annotations

import re
from dataclasses import dataclass

from navcore.errors import BadConfiguration
from navcore.toml_config import ranged

SIZES = ((424, 240), (640, 480), (848, 480))
"""Columns and rows of the sizes that can be asked for."""
RATES_HZ = (10, 15, 30, 60)
"""Images per second that can be asked for: those of a D455, and every third image of 30."""
_STREAM = re.compile(r"(?:(\d{1,5})[x×](\d{1,5}))?(?:@(\d{1,4}))?(\+colour)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraStream:
    """Images of a camera."""

    width: int = ranged(16, 1280, default=424)
    """Number of columns."""
    height: int = ranged(16, 800, default=240)
    """Number of rows."""
    rate_hz: float = ranged(0.001, 90.0, default=10.0)
    """Number of images per second."""
    colour_lens: bool = False
    """Whether colour comes from a lens of its own, as in a real D455, and is registered to depth;
    else both share a lens."""

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.width, self.height

    def __str__(self) -> str:
        """Return it as `stream_of` reads it, e.g. `848x480@15` or `848x480@15+colour`."""
        lens = "+colour" if self.colour_lens else ""
        return f"{self.width}x{self.height}@{self.rate_hz:g}{lens}"


def stream_of(text: str, default: CameraStream | None = None) -> CameraStream:
    """Return the stream of a text such as `848x480`, `848x480@15`, `@15` or `+colour`, what it
    leaves out as in `default`.

    Raises `BadConfiguration` for another than `SIZES` and `RATES_HZ`.
    """
    default = default or CameraStream()
    size, rate = default.size, default.rate_hz
    parts = _STREAM.fullmatch(text.strip().lower())
    if parts is not None and parts[1] is not None:
        size = int(parts[1]), int(parts[2])
    if parts is not None and parts[3] is not None:
        rate = float(parts[3])
    offered = size in (*SIZES, default.size) and rate in (*RATES_HZ, default.rate_hz)
    if parts is None or not text.strip() or not offered:
        sizes = ", ".join(f"{width}x{height}" for width, height in SIZES)
        rates = ", ".join(map(str, RATES_HZ))
        raise BadConfiguration(
            f"camera {text!r:.40}: expected one of {sizes}, with @ and one of {rates} images per "
            "second if it is not the default, e.g. 848x480@15; +colour for a colour lens of its own"
        )
    lens = default.colour_lens or parts[4] is not None
    return CameraStream(width=size[0], height=size[1], rate_hz=rate, colour_lens=lens)
