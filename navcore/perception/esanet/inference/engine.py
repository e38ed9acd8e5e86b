"""What an engine is: normalised pictures in, logits out. Everything else about it is speed."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration

Batch = npt.NDArray[np.float32]
"""(1, C, h, w) float32."""
THREADS = 2
"""No engine takes more: the thread that sends to the wheels must find a core, and waits on none of
these."""


class Inference(Protocol):
    """A network that is ready to run. Engines are not thread-safe: one thread calls one engine."""

    @property
    def name(self) -> str:
        """Engine and precision, e.g. `openvino f32`."""

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        """Normalised rgb (1, 3, h, w) and depth (1, 1, h, w) → (1, classes, h, w), valid until the
        next call."""


def check_logits(logits: Batch, classes: int, rgb: Batch, where: str) -> None:
    """Raise `BadConfiguration` unless a network answers with one logit a class and pixel."""
    wanted = (1, classes, *rgb.shape[2:])
    if logits.shape != wanted or logits.dtype != np.float32:
        raise BadConfiguration(
            f"{where}: answers with {logits.dtype} {logits.shape}, expected float32 {wanted}"
        )
