"""Interface of an inference engine: normalised images in, logits out."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration

Batch = npt.NDArray[np.float32]
"""Array (1, C, h, w) of float32."""
THREADS = 2
"""Default number of threads of an engine: the command thread, which waits for none of them, needs a
free core."""


class Inference(Protocol):
    """A network that is ready to run. Engines are not thread-safe."""

    @property
    def name(self) -> str:
        """Name of engine and precision, e.g. `openvino f32`."""

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        """Map normalised rgb (1, 3, h, w) and depth (1, 1, h, w) to logits (1, classes, h, w),
        valid until the next call."""

    @property
    def has_features(self) -> bool:
        """Whether `logits_and_features` can be called: not for every ONNX file."""

    def for_another_thread(self) -> Inference:
        """Return the same network, with its weights shared, for use beside this one."""

    def logits_and_features(self, rgb: Batch, depth: Batch) -> tuple[Batch, Batch]:
        """Return the logits, and the features (1, C, h/4, w/4) that the classifier makes them of,
        valid until the next call."""


def check_logits(logits: Batch, classes: int, rgb: Batch, where: str) -> None:
    """Raise `BadConfiguration` unless there is one float32 logit per class and pixel."""
    wanted = (1, classes, *rgb.shape[2:])
    if logits.shape != wanted or logits.dtype != np.float32:
        raise BadConfiguration(
            f"{where}: answers with {logits.dtype} {logits.shape}, expected float32 {wanted}"
        )
