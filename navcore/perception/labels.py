"""Labels per pixel, and the port of whatever makes them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from navcore.mission.beware_list import BewareClass, BewareList
from navcore.robot.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Labels:
    """What each pixel of a frame shows."""

    class_ids: npt.NDArray[np.uint8]
    """(H, W) class id of the beware list, `NOTHING` for everything else."""
    confidence: npt.NDArray[np.float32]
    """(H, W) how sure the segmenter is, 0 to 1."""
    hypotheses: tuple[Labels, ...] = ()
    """Where several may claim a pixel, what each of them claims, whatever the list thinks of it: a
    network first, then the rules of colour. Of these the map is made, or an edit of the list would
    not bring back what another claim lay upon. Empty: nobody else claims anything."""

    @property
    def all_hypotheses(self) -> tuple[Labels, ...]:
        """Its claims; itself, where it has none."""
        return self.hypotheses or (self,)

    def mask(self, beware: BewareList) -> npt.NDArray[np.bool_]:
        """(H, W) the paper's mask M_c: pixels that bind the robot under this list, the union of its
        enabled classes."""
        return np.greater_equal(self.confidence, _least(beware)[self.class_ids])


class LabelSource(StrEnum):
    """What finds a class of the beware list in a picture."""

    NETWORK = "network"
    COLOUR = "colour rule"
    BOTH = "network and colour rule"
    NOTHING = "nothing"


class Segmenter(Protocol):
    """Anything that labels the pixels of a frame. Enabled or not: every class of the list is
    labelled."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Labels of the same height and width as the frame."""

    def finds(self, entry: BewareClass) -> LabelSource:
        """What of this segmenter finds an entry; `NOTHING` when it will never be seen."""


def with_full_confidence(class_ids: npt.NDArray[np.uint8]) -> Labels:
    """Labels of which nothing is in doubt."""
    return Labels(class_ids=class_ids, confidence=np.ones(class_ids.shape, dtype=np.float32))


def _least(beware: BewareList) -> npt.NDArray[np.float32]:
    """(256,) the least confidence that binds the robot, by class id; more than 1 where none does."""
    least = np.full(256, 2.0, dtype=np.float32)
    for entry in beware.enabled:
        least[entry.class_id] = entry.min_confidence
    return least
