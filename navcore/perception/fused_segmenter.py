"""Labels of a network and of the colour rules, fused."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.colour_segmenter import (
    PERSON_SURE,
    TALL_M,
    UNDECIDED,
    by_colour,
    colour_masks,
    topmost_label,
)
from navcore.perception.depth_filter import (
    heights_above_floor,
    reject_flat_regions,
    trim_label_bleed,
)
from navcore.perception.labels import Labels, LabelSource, Segmenter
from navcore.perception.overhang_filter import base_regions, overhung
from navcore.robot.frame import Frame


class FusedSegmenter:
    """A network and the colour rules together: what one of them claims stays claimed, except for
    pictures of things.

    A pixel shows as the network's where it is sure enough of an enabled class; else as the colour
    rule's; else as the network's, however unsure. Onto the map go the claims of both, but for the
    colour of somebody's shoes. A network's region that depth shows to be a flat picture of
    something with height is dismissed before, and so are what spills over the edge of a thing onto
    the floor behind it (`relief.py`) and the foot of something higher (`overhung.py`); what is too
    far away to tell whether it is such a foot counts neither for nor against. Rules marked
    `fallback` are for classes that the network does not know.
    """

    def __init__(self, network: Segmenter) -> None:
        self._network = network

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Labels of both."""
        heights_m = heights_above_floor(frame)
        seen = self._network.segment(frame, beware)
        keep = reject_flat_regions(seen.class_ids, frame, heights_m, beware)
        keep &= trim_label_bleed(seen.class_ids, frame)
        dismissed, doubtful = overhung(seen.class_ids, frame, heights_m, beware)
        real = Labels(
            class_ids=np.where(keep & ~dismissed, seen.class_ids, np.uint8(NOTHING)),
            confidence=np.where(doubtful, np.minimum(seen.confidence, UNDECIDED), seen.confidence),
        )
        coats = colour_masks(frame, heights_m, filter(self._by_colour, beware.classes))
        if not coats:
            return real
        shape = real.class_ids.shape
        people = (
            np.isin(seen.class_ids, beware.people_ids)
            & (seen.confidence >= PERSON_SURE)
            & (heights_m > TALL_M)
        )
        if people.any():
            coats = [(entry, fits & ~base_regions(fits, people, frame)) for entry, fits in coats]
        hypotheses = (real, *by_colour(coats, shape))
        return dataclasses.replace(
            fuse(real, topmost_label(coats, shape), beware), hypotheses=hypotheses
        )

    def finds(self, entry: BewareClass) -> LabelSource:
        """Network, rule, both or nothing."""
        known = self._knows(entry)
        if self._by_colour(entry):
            return LabelSource.BOTH if known else LabelSource.COLOUR
        return LabelSource.NETWORK if known else LabelSource.NOTHING

    def _knows(self, entry: BewareClass) -> bool:
        return self._network.finds(entry) is LabelSource.NETWORK

    def _by_colour(self, entry: BewareClass) -> bool:
        return entry.colour is not None and not (entry.colour.fallback and self._knows(entry))


def fuse(seen: Labels, coloured: npt.NDArray[np.uint8], beware: BewareList) -> Labels:
    """The network's labels and the class ids (H, W) of the colour rules, by the rule that
    `FusedSegmenter` states."""
    sure = seen.mask(beware) & (seen.class_ids != coloured)
    taken = (coloured != NOTHING) & ~sure
    return Labels(
        class_ids=np.where(taken, coloured, seen.class_ids),
        confidence=np.where(taken, np.float32(1), seen.confidence),
    )
