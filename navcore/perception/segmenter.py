"""Label pixels: which of them show something on the beware list (the paper's equation for the mask M_c)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, ColourRule
from navcore.perception.depth_filter import Heights, heights_above_floor, without_pictures, without_specks, without_spills
from navcore.perception.ground import ground_heights
from navcore.perception.overhang_filter import feet, overhung
from navcore.robot.frame import Frame

STEEPEST = 0.2
"""What rises or falls by no more than this per metre may be ground with something painted on it."""
TALL_M = 0.1
"""What rises by so much more than a marking can is an obstacle, however depth errs."""
PERSON_SURE = 0.5
"""So sure a network must be of a person for him to be followed, and for the colour of his shoes to be no floor's."""
UNDECIDED = np.nextafter(np.float32(0.5), np.float32(0))
"""Confidence of what speaks neither for a thing nor against it: its log-odds are 0, and it binds nobody who asks for a half."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Labels:
    """What each pixel of a frame shows."""

    class_ids: npt.NDArray[np.uint8]
    """(H, W) class id of the beware list, `NOTHING` for everything else."""
    confidence: npt.NDArray[np.float32]
    """(H, W) how sure the segmenter is, 0 to 1."""
    claims: tuple[Labels, ...] = ()
    """Where several may claim a pixel, what each of them claims, whatever the list thinks of it: a network first, then the
    rules of colour. Of these the map is made, or an edit of the list would not bring back what another claim lay upon. Empty:
    nobody else claims anything."""

    @property
    def claimed(self) -> tuple[Labels, ...]:
        """Its claims; itself, where it has none."""
        return self.claims or (self,)

    def mask(self, beware: BewareList) -> npt.NDArray[np.bool_]:
        """(H, W) the paper's mask M_c: pixels that bind the robot under this list, the union of its enabled classes."""
        return np.greater_equal(self.confidence, _least(beware)[self.class_ids])


Coat = tuple[BewareClass, npt.NDArray[np.bool_]]
"""An entry of the list, and (H, W) the pixels that fit its colour rule."""


class Finder(StrEnum):
    """What finds a class of the beware list in a picture."""

    NETWORK = "network"
    COLOUR = "colour rule"
    BOTH = "network and colour rule"
    NOTHING = "nothing"


class Segmenter(Protocol):
    """Anything that labels the pixels of a frame. Enabled or not: every class of the list is labelled."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Labels of the same height and width as the frame."""

    def finds(self, entry: BewareClass) -> Finder:
        """What of this segmenter finds an entry; `NOTHING` when it will never be seen."""


class ColourSegmenter:
    """Labels by the colour rules of the beware list; where rules overlap, the first that is enabled shows."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Exact: a pixel fits a rule or it does not, so its confidence is 1."""
        coats = painted(frame, heights_above_floor(frame), beware.classes)
        shown, claims = uppermost(coats, frame.depth_m.shape), by_colour(coats, frame.depth_m.shape)
        return dataclasses.replace(certain(shown), claims=claims if len(claims) > 1 else ())

    def finds(self, entry: BewareClass) -> Finder:
        """A rule, where the entry has one."""
        return Finder.NOTHING if entry.colour is None else Finder.COLOUR


class JointSegmenter:
    """A network and the colour rules together: what one of them claims stays claimed, except for pictures of things.

    A pixel shows as the network's where it is sure enough of an enabled class; else as the colour rule's; else as the
    network's, however unsure. Onto the map go the claims of both, but for the colour of somebody's shoes. A network's region
    that depth shows to be a flat picture of something with height is dismissed before, and so are what spills over the edge of
    a thing onto the floor behind it (`relief.py`) and the foot of something higher (`overhung.py`); what is too far away to
    tell whether it is such a foot counts neither for nor against. Rules marked `fallback` are for classes that the network
    does not know.
    """

    def __init__(self, network: Segmenter) -> None:
        self._network = network

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Labels of both."""
        heights_m = heights_above_floor(frame)
        seen = self._network.segment(frame, beware)
        keep = without_pictures(seen.class_ids, frame, heights_m, beware)
        keep &= without_spills(seen.class_ids, frame)
        dismissed, doubtful = overhung(seen.class_ids, frame, heights_m, beware)
        real = Labels(
            class_ids=np.where(keep & ~dismissed, seen.class_ids, np.uint8(NOTHING)),
            confidence=np.where(doubtful, np.minimum(seen.confidence, UNDECIDED), seen.confidence),
        )
        coats = painted(frame, heights_m, filter(self._by_colour, beware.classes))
        if not coats:
            return real
        shape = real.class_ids.shape
        people = np.isin(seen.class_ids, beware.people_ids) & (seen.confidence >= PERSON_SURE) & (heights_m > TALL_M)
        if people.any():
            coats = [(entry, fits & ~feet(fits, people, frame)) for entry, fits in coats]
        claims = (real, *by_colour(coats, shape))
        return dataclasses.replace(joined(real, uppermost(coats, shape), beware), claims=claims)

    def finds(self, entry: BewareClass) -> Finder:
        """Network, rule, both or nothing."""
        known = self._knows(entry)
        if self._by_colour(entry):
            return Finder.BOTH if known else Finder.COLOUR
        return Finder.NETWORK if known else Finder.NOTHING

    def _knows(self, entry: BewareClass) -> bool:
        return self._network.finds(entry) is Finder.NETWORK

    def _by_colour(self, entry: BewareClass) -> bool:
        return entry.colour is not None and not (entry.colour.fallback and self._knows(entry))


def joined(seen: Labels, coloured: npt.NDArray[np.uint8], beware: BewareList) -> Labels:
    """The network's labels and the class ids (H, W) of the colour rules, by the rule that `JointSegmenter` states."""
    sure = seen.mask(beware) & (seen.class_ids != coloured)
    taken = (coloured != NOTHING) & ~sure
    return Labels(
        class_ids=np.where(taken, coloured, seen.class_ids),
        confidence=np.where(taken, np.float32(1), seen.confidence),
    )


def certain(class_ids: npt.NDArray[np.uint8]) -> Labels:
    """Labels of which nothing is in doubt."""
    return Labels(class_ids=class_ids, confidence=np.ones(class_ids.shape, dtype=np.float32))


def uppermost(coats: Sequence[Coat], shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """(H, W) the class id of the first coat that is enabled, else of the first."""
    class_ids = np.full(shape, NOTHING, dtype=np.uint8)
    first_shows = sorted(coats, key=lambda coat: not coat[0].enabled)
    for entry, fits in first_shows[::-1]:
        class_ids[fits] = entry.class_id
    return class_ids


def by_colour(coats: Sequence[Coat], shape: tuple[int, ...]) -> tuple[Labels, ...]:
    """The coats as claims, as few as hold them all: those share one that lie beside each other."""
    layers: list[npt.NDArray[np.uint8]] = []
    for entry, fits in coats:
        layer = next((layer for layer in layers if not layer[fits].any()), None)
        if layer is None:
            layers.append(layer := np.full(shape, NOTHING, dtype=np.uint8))
        layer[fits] = entry.class_id
    return tuple(map(certain, layers))


def painted(frame: Frame, heights_m: Heights, entries: Iterable[BewareClass]) -> list[Coat]:
    """Each entry whose colour rule some pixel fits, in their order, and (H, W) which pixels; none higher than the rule allows.

    Higher than the ground there, that is, which may rise or fall before the robot; nor the foot of something of that colour.
    """
    hsv = np.asarray(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2HSV), dtype=np.uint8)
    coats = []
    for entry in entries:
        if entry.colour is None:
            continue
        fits = _matches(hsv, entry.colour)
        low, above = fits, heights_m
        if (fits & (above > entry.colour.max_height_m)).any():
            above = heights_m - ground_heights(frame, STEEPEST)
            low = fits & ~(above > entry.colour.max_height_m)
        if entry.min_size_m is not None and low.any():
            low = without_specks(low, frame, entry.min_size_m)
        tall = fits & (above > entry.colour.max_height_m + TALL_M)
        if tall.any():
            low &= ~feet(low, tall, frame)
        if low.any():
            coats.append((entry, low))
    return coats


def _least(beware: BewareList) -> npt.NDArray[np.float32]:
    """(256,) the least confidence that binds the robot, by class id; more than 1 where none does."""
    least = np.full(256, 2.0, dtype=np.float32)
    for entry in beware.enabled:
        least[entry.class_id] = entry.min_confidence
    return least


def _matches(hsv: npt.NDArray[np.uint8], rule: ColourRule) -> npt.NDArray[np.bool_]:
    """(H, W) pixels that fit; OpenCV keeps hue in steps of 2°, saturation and value in 0…255."""
    first, last = (round(hue / 2) for hue in rule.hue_deg)
    floor = (round(rule.min_saturation * 255), round(rule.min_value * 255))
    # Whether the range wraps is told by the rule, not by its rounding: 0.5° to 0° goes once around.
    wraps = rule.hue_deg[0] > rule.hue_deg[1]
    spans = [(first, 180), (0, last)] if wraps else [(first, last)]
    if last == 180:
        spans.append((0, 0))  # 360° is 0°
    mask = np.zeros(hsv.shape[:2], dtype=np.bool_)
    for low, high in spans:
        mask |= cv2.inRange(hsv, np.array([low, *floor]), np.array([high, 255, 255])) > 0
    return mask
