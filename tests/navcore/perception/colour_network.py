"""A stand-in for a network with features: mixtures of the colours of every second pixel."""

from __future__ import annotations

import numpy as np

from navcore.geometry.arrays import FloatImage
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.labels import Labels, LabelSource
from navcore.perception.prototype import describe, prototype_labels
from navcore.robot.frame import Frame


def features_of(frame: Frame) -> FloatImage:
    """Return features (1, 12, h, w) of a frame, noisy, always the same."""
    rng = np.random.default_rng(5)
    mix = rng.normal(size=(3, 12))
    pixels = np.tanh(frame.rgb[::2, ::2] / 255.0 @ mix)
    noisy = pixels + rng.normal(0, 0.02, pixels.shape)
    return noisy.transpose(2, 0, 1)[None].astype(np.float32)


class ColourNetwork:
    """A segmenter that knows no class but blue ones, by the id `blue`, and classes by example."""

    identity = "abc"

    def __init__(self, blue: int = 0) -> None:
        self._blue = blue

    def described(self, frame: Frame) -> FloatImage:
        """Return the descriptors of a frame."""
        return describe(frame, features_of(frame))

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return blue pixels as one class, and what fits the examples of the list."""
        is_blue = frame.rgb[..., 2].astype(int) > frame.rgb[..., 0].astype(int) + 100
        class_ids = np.where(is_blue, self._blue, 0).astype(np.uint8)
        labels = Labels(class_ids=class_ids, confidence=np.ones(is_blue.shape, np.float32))
        entries = [entry for entry in beware.classes if self._has(entry)]
        examples = prototype_labels(frame, self.described(frame), entries)
        return Labels(
            class_ids=labels.class_ids,
            confidence=labels.confidence,
            hypotheses=(labels, examples) if entries else (),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return whether an entry has an example of this network."""
        return LabelSource.PROTOTYPE if self._has(entry) else LabelSource.NOTHING

    def _has(self, entry: BewareClass) -> bool:
        return entry.prototype is not None and entry.prototype.network == self.identity
