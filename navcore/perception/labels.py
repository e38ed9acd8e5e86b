"""Labels per pixel, and the interface of the segmenters that make them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Protocol

import numpy as np
import numpy.typing as npt

from navcore.geometry.arrays import Bools, FloatImage
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.robot.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Labels:
    """Class and confidence of each pixel of a frame."""

    class_ids: npt.NDArray[np.uint8]
    """(H, W) class id of the beware list, `NOTHING` for everything else."""
    confidence: FloatImage
    """(H, W) confidence of the segmenter, 0 to 1."""
    hypotheses: tuple[Labels, ...] = ()
    """Labels per source where several sources may label a pixel, whether their classes are enabled
    or not: a network first, then the colour rules. The map is made of these, or an edit of the list
    could not restore a label that another one covered. Empty when there is a single source."""
    unlisted: Bools | None = None
    """(H, W) pixels that a network with a class `background` gives a class which neither is that
    nor is on the list: without another label they show nothing of the list, but no background. None
    where the list has all classes."""

    @property
    def all_hypotheses(self) -> tuple[Labels, ...]:
        """Labels per source; the labels themselves when there is a single source."""
        return self.hypotheses or (self,)

    def mask(self, beware: BewareList) -> Bools:
        """Return the (H, W) mask M_c of the paper: pixels that bind the robot under this list, the
        union of its enabled classes."""
        return np.greater_equal(self.confidence, _min_confidences(beware)[self.class_ids])


class LabelSource(StrEnum):
    """What can find a class of the beware list in an image."""

    NETWORK = "network"
    COLOUR = "colour rule"
    BOTH = "network and colour rule"
    """Each of them by itself."""
    WEIGHED = "network, weighed with colour rule"
    """The network, with the colour rule as further evidence."""
    PROTOTYPE = "example"
    NOTHING = "nothing"


class Segmenter(Protocol):
    """Interface of everything that labels the pixels of a frame, with all classes of the list,
    enabled or not."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return labels of the same height and width as the frame."""

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return the part of this segmenter that finds an entry; `NOTHING` when none does."""


def with_full_confidence(class_ids: npt.NDArray[np.uint8]) -> Labels:
    """Return labels with a confidence of 1 everywhere, read-only."""
    return Labels(class_ids=class_ids, confidence=_ones(class_ids.shape))


@lru_cache(maxsize=4)
def _ones(shape: tuple[int, ...]) -> FloatImage:
    ones = np.ones(shape, dtype=np.float32)
    ones.flags.writeable = False
    return ones


def only_coloured(labels: Labels, frame: Frame) -> Labels:
    """Return the labels without those of pixels whose colour the frame does not know; the same
    labels where it knows all."""
    if frame.uncoloured is None:
        return labels
    return dataclasses.replace(
        labels,
        class_ids=np.where(frame.uncoloured, np.uint8(NOTHING), labels.class_ids),
        hypotheses=tuple(only_coloured(source, frame) for source in labels.hypotheses),
    )


def _min_confidences(beware: BewareList) -> FloatImage:
    """Return the (256,) least confidence that binds the robot, by class id; 2 where none does."""
    least = np.full(256, 2.0, dtype=np.float32)
    for entry in beware.enabled:
        least[entry.class_id] = entry.min_confidence
    return least
