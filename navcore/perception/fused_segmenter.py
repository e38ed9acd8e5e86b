"""Labels of a network and of the colour rules, fused."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import (
    DEFAULT_PERCEPTION,
    ColourEvidenceConfig,
    PerceptionConfig,
)
from navcore.geometry.arrays import Bools, FloatImage
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.colour_segmenter import (
    ColourMask,
    colour_masks,
    disjoint_layers,
    topmost_label,
)
from navcore.perception.depth_filter import (
    heights_above_floor,
    reject_flat_regions,
    trim_label_bleed,
)
from navcore.perception.labels import Labels, LabelSource, Segmenter
from navcore.perception.overhang_filter import base_regions, overhung_regions
from navcore.robot.frame import Frame
from navcore.robot.profile import DepthSensor

UNDECIDED = np.nextafter(np.float32(0.5), np.float32(0))
"""Confidence that speaks neither for a label nor against it: its log-odds are 0, and it is below
every threshold of at least one half."""
_EVIDENCE = DEFAULT_PERCEPTION.evidence
_NOT_CERTAIN = np.nextafter(np.float32(1), np.float32(0))
"""Largest confidence of a network: on the map only rules that speak alone are certain."""


class FusedSegmenter:
    """A network and the colour rules together, unless depth refutes them.

    Where the network knows a class, its colour rule does not speak alone: both weigh each other's
    evidence (`weigh`), unless the rule is marked `alone`. Rules that speak alone are certain: the
    label of a pixel is the network's where it is confident enough of an enabled class; else that of
    such a rule; else the network's, whatever its confidence. The map is made of the labels of both,
    except for the colour of a person's shoes. Before that, regions of the network
    are rejected that are flat prints, bleed over the outline of an object (`depth_filter`), or are
    the base of a taller object (`overhang_filter`); where the latter is undecided, the region
    counts neither for nor against. Rules marked `fallback` are for classes that the network does
    not know. Classes by example, which come with the network's labels, are a third source, behind
    the colour rules; and so are the labels of the network that the evidence of a colour has put
    another class in place of.
    """

    def __init__(
        self,
        network: Segmenter,
        sensor: DepthSensor,
        config: PerceptionConfig = DEFAULT_PERCEPTION,
    ) -> None:
        """Fuse a network with the colour rules; `sensor` is the depth camera whose errors decide
        what depth can refute."""
        self._network = network
        self._config = config
        self._sensor = sensor

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return the fused labels of a frame."""
        heights_m = heights_above_floor(frame)
        seen = self._network.segment(frame, beware)
        filtered = self._without_refuted(seen, frame, heights_m, beware)
        examples = tuple(
            self._without_refuted(labels, frame, heights_m, beware)
            for labels in seen.all_hypotheses[1:]
        )
        fitting = self._colour_masks(frame, heights_m, seen, beware)
        masks = {entry.class_id: fits for entry, fits in fitting}
        network, weighed = filtered, [e.class_id for e in beware.classes if self._is_weighed(e)]
        for class_id in weighed:
            filtered = weigh(filtered, class_id, masks.get(class_id), self._config.evidence)
        behind = (*_covered(network, filtered), *examples)
        alone = [mask for mask in fitting if mask[0].class_id not in weighed]
        if not alone and not behind:
            return filtered
        shape = filtered.class_ids.shape
        fused = fuse(filtered, topmost_label(alone, shape), beware)
        for labels in behind:
            fused = _filled(fused, labels, beware)
        layers = disjoint_layers(alone, shape)
        return dataclasses.replace(fused, hypotheses=(filtered, *layers, *behind))

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return what finds an entry; of an example and a colour rule, the rule is named."""
        if self._is_weighed(entry):
            return LabelSource.WEIGHED
        if self._has_rule(entry):
            return LabelSource.BOTH if self._is_known(entry) else LabelSource.COLOUR
        return self._network.source_of(entry)

    def _colour_masks(
        self, frame: Frame, heights_m: FloatImage, seen: Labels, beware: BewareList
    ) -> list[ColourMask]:
        """Return what fits the colour rules, but for the shoes of a person."""
        masks = colour_masks(frame, heights_m, filter(self._has_rule, beware.classes), self._config)
        people = (
            np.isin(seen.class_ids, beware.people_ids)
            & (seen.confidence >= self._config.min_person_confidence)
            & (heights_m > self._config.colour.obstacle_above_m)
        )
        if not masks or not people.any():
            return masks
        overhang = self._config.overhang
        return [
            (entry, fits & ~base_regions(fits, people, frame, overhang)) for entry, fits in masks
        ]

    def _without_refuted(
        self, seen: Labels, frame: Frame, heights_m: FloatImage, beware: BewareList
    ) -> Labels:
        """Return the network's labels without those that depth refutes, none of them certain."""
        config, sensor = self._config, self._sensor
        keep = reject_flat_regions(
            seen.class_ids, frame, heights_m, beware, sensor, config.depth
        ) & trim_label_bleed(seen.class_ids, frame, config.depth)
        base, undecided = overhung_regions(
            seen.class_ids, frame, heights_m, beware, sensor, config.overhang
        )
        return dataclasses.replace(
            seen,
            class_ids=np.where(keep & ~base, seen.class_ids, np.uint8(NOTHING)),
            confidence=np.minimum(seen.confidence, np.where(undecided, UNDECIDED, _NOT_CERTAIN)),
            hypotheses=(),
        )

    def _is_known(self, entry: BewareClass) -> bool:
        return self._network.source_of(entry) is LabelSource.NETWORK

    def _has_rule(self, entry: BewareClass) -> bool:
        return entry.colour is not None and not (entry.colour.fallback and self._is_known(entry))

    def _is_weighed(self, entry: BewareClass) -> bool:
        rule = entry.colour
        return rule is not None and not rule.alone and not rule.fallback and self._is_known(entry)


def weigh(
    seen: Labels, class_id: int, fits: Bools | None, config: ColourEvidenceConfig = _EVIDENCE
) -> Labels:
    """Return the network's labels with the evidence of the colour rule of a class that it knows.

    The rule multiplies the odds of the class (Bayes): by `config.fits` at the (H, W) pixels `fits`
    that fit it, None for no pixel, else by `config.misses`. Of a pixel with another label of
    confidence p the network leaves the class at most min(p, 1 − p); its label becomes the class
    where that is then more likely than not.
    """
    own = seen.class_ids == class_id
    concerned = np.flatnonzero(own if fits is None else own | fits)
    if not len(concerned):
        return seen
    is_own, said = own.ravel()[concerned], seen.confidence.ravel()[concerned]
    fit = np.zeros_like(is_own) if fits is None else fits.ravel()[concerned]
    claim = np.where(is_own, said, np.minimum(said, 1 - said))
    odds = np.where(fit, np.float32(config.fits), np.float32(config.misses)) * claim
    posterior = np.minimum(odds / (odds + 1 - claim), _NOT_CERTAIN).astype(np.float32)
    changed = is_own | (posterior > UNDECIDED)
    pixels = concerned[changed]
    class_ids, confidence = seen.class_ids.copy(), seen.confidence.copy()
    class_ids.ravel()[pixels], confidence.ravel()[pixels] = class_id, posterior[changed]
    return dataclasses.replace(seen, class_ids=class_ids, confidence=confidence)


def fuse(seen: Labels, coloured: npt.NDArray[np.uint8], beware: BewareList) -> Labels:
    """Return the network's labels fused with the (H, W) class ids of the colour rules, as
    `FusedSegmenter` states it."""
    network_wins = seen.mask(beware) & (seen.class_ids != coloured)
    colour_wins = (coloured != NOTHING) & ~network_wins
    return dataclasses.replace(
        seen,
        class_ids=np.where(colour_wins, coloured, seen.class_ids),
        confidence=np.where(colour_wins, np.float32(1), seen.confidence),
    )


def _covered(network: Labels, weighed: Labels) -> tuple[Labels, ...]:
    """Return the network's labels where the evidence of a colour has put another class in their
    place; nothing where it has not. That class may be off, or become so."""
    covered = (network.class_ids != weighed.class_ids) & (network.class_ids != NOTHING)
    if not covered.any():
        return ()
    class_ids = np.where(covered, network.class_ids, np.uint8(NOTHING))
    return (Labels(class_ids=class_ids, confidence=network.confidence),)


def _filled(labels: Labels, behind: Labels, beware: BewareList) -> Labels:
    """Return labels with others in place of those that bind nothing."""
    wins = (behind.class_ids != NOTHING) & ~labels.mask(beware)
    return dataclasses.replace(
        labels,
        class_ids=np.where(wins, behind.class_ids, labels.class_ids),
        confidence=np.where(wins, behind.confidence, labels.confidence),
    )
