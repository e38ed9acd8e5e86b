"""The network as a segmenter: frames in, labels of the beware list out."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import DEFAULT_PERCEPTION
from navcore.config.perception.prototype import PrototypeConfig
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import FloatImage
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.esanet.inference.argmax import most_likely
from navcore.perception.esanet.inference.engine import Batch, Inference, check_logits
from navcore.perception.esanet.network.limits import STRIDE
from navcore.perception.esanet.network.preprocess import (
    DepthStatistics,
    Preprocessor,
    Size,
    check_size,
)
from navcore.perception.esanet.weights.class_names import BACKGROUND
from navcore.perception.labels import Labels, LabelSource
from navcore.perception.prototype import describe, prototype_labels
from navcore.robot.frame import Frame


class NetworkSegmenter:
    """A `Segmenter` on a network, run by any engine.

    A class of the network stands for the entry of the beware list with the same name, ignoring
    case, or else for the one with the name that `aliases` (network class → entry) gives it. Several
    classes may stand for one entry.
    """

    def __init__(
        self,
        inference: Inference,
        *,
        class_names: tuple[str, ...],
        depth: DepthStatistics,
        size: Size,
        aliases: Mapping[str, str] | None = None,
        identity: str = "",
        config: PrototypeConfig = DEFAULT_PERCEPTION.prototype,
    ) -> None:
        """Resize frames to the working size `size`; raises `BadConfiguration`.

        `identity` names the network in the prototypes that are made of its features; without one it
        has none.
        """
        check_size(size, STRIDE)
        self.class_names = class_names
        self.identity = identity if inference.has_features else ""
        self._inference, self._config = inference, config
        self._entry_names = _entry_names(class_names, aliases or {})
        self._known = {name for names in self._entry_names for name in names}
        # A network without a class for the background shows it by classes like floor and wall.
        names = [own for own, _ in self._entry_names]
        self._is_background = np.array(
            [own == BACKGROUND or BACKGROUND not in names for own in names]
        )
        self._depth, self._size, self._prepare = depth, size, Preprocessor(size, depth)

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return labels of the frame's size; the confidence is the probability of the most likely
        class, listed or not. What entries with a prototype of this network show is a hypothesis of
        its own."""
        rgb, depth = self._prepared(frame)
        entries = [entry for entry in beware.classes if self._has_prototype(entry)]
        if not entries:
            return self._labels(self._inference.logits(rgb, depth), rgb, frame, beware)
        logits, features = self._inference.logits_and_features(rgb, depth)
        labels = self._labels(logits, rgb, frame, beware)
        by_example = prototype_labels(frame, describe(frame, features), entries, self._config)
        return dataclasses.replace(labels, hypotheses=(labels, by_example))

    def for_another_thread(self) -> NetworkSegmenter:
        """Return the same network for use beside this one."""
        other = copy.copy(self)
        other._inference = self._inference.for_another_thread()
        other._prepare = Preprocessor(self._size, self._depth)
        return other

    def described(self, frame: Frame) -> FloatImage:
        """Return the (h, w, D) descriptors of a frame, of which prototypes are made; only of a
        network with an `identity`."""
        _, features = self._inference.logits_and_features(*self._prepared(frame))
        return describe(frame, features)

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return whether the network has a class for an entry, or features for its prototype; a
        class by alias also where an entry of the class's own name is listed and takes it."""
        if entry.detected_as.casefold() in self._known:
            return LabelSource.NETWORK
        return LabelSource.PROTOTYPE if self._has_prototype(entry) else LabelSource.NOTHING

    def _prepared(self, frame: Frame) -> tuple[Batch, Batch]:
        return self._prepare(frame.rgb, frame.depth_m * np.float32(self._depth.units_per_m))

    def _has_prototype(self, entry: BewareClass) -> bool:
        return entry.prototype is not None and entry.prototype.network == self.identity != ""

    def _labels(self, logits: Batch, rgb: Batch, frame: Frame, beware: BewareList) -> Labels:
        check_logits(logits, len(self.class_names), rgb, self._inference.name)
        height, width = frame.depth_m.shape
        winners, confidence = most_likely(logits[0], height=height, width=width)
        class_ids = self._class_ids(beware)
        is_unlisted = (class_ids == NOTHING) & ~self._is_background
        return Labels(
            class_ids=class_ids[winners],
            confidence=confidence,
            unlisted=is_unlisted[winners] if is_unlisted.any() else None,
        )

    def _class_ids(self, beware: BewareList) -> npt.NDArray[np.uint8]:
        """Return the class ids (C,) of the beware list by network output; the first of two entries
        with one name counts."""
        ids = {entry.detected_as.casefold(): entry.class_id for entry in reversed(beware.classes)}
        found = [ids.get(own, ids.get(alias, NOTHING)) for own, alias in self._entry_names]
        return np.array(found, dtype=np.uint8)


def _entry_names(
    class_names: tuple[str, ...], aliases: Mapping[str, str]
) -> tuple[tuple[str, str], ...]:
    """Return the names that the outputs may have on the beware list, case-folded: their own, which
    goes before, and the alias, the same where there is none."""
    for name in aliases:
        if name not in class_names:
            raise BadConfiguration(
                f"ESANet: alias of {name!r:.60}, which is no class of the network: "
                f"{', '.join(class_names)}"
            )
    return tuple((name.casefold(), aliases.get(name, name).casefold()) for name in class_names)
