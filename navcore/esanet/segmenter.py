"""The network as a segmenter: a frame in, labels of the beware list out."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn import functional

from navcore.beware import NOTHING, BewareList
from navcore.errors import BadConfiguration
from navcore.esanet.model import STRIDE
from navcore.esanet.preprocess import Size, check_size, to_tensors
from navcore.esanet.weights import TrainedNetwork
from navcore.frame import Frame
from navcore.segment import Labels

OFFICIAL_SIZE = Size(height=480, width=640)
"""What the public checkpoints were trained at."""


class EsaNetSegmenter:
    """Labels by what the network sees; satisfies `navcore.segment.Segmenter`.

    A class of the network means the entry of the beware list that has its name, whatever the case of the letters, or the
    name that `aliases` (network class → entry) gives it.
    """

    def __init__(
        self, trained: TrainedNetwork, *, size: Size = OFFICIAL_SIZE, aliases: Mapping[str, str] | None = None
    ) -> None:
        """Takes the network over. `size` is what frames are resized to; raises `BadConfiguration`."""
        check_size(size, STRIDE)
        self.class_names = trained.card.class_names
        self._entry_names = _entry_names(self.class_names, aliases or {})
        self._size, self._statistics = size, trained.card.depth
        self._network = trained.network.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._device = next(trained.network.parameters()).device

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Labels of the frame's size; a pixel's confidence is the probability of its most likely class, listed or not."""
        winners, confidence = most_likely(self._logits(frame))
        return Labels(class_ids=self._class_ids(beware)[winners], confidence=confidence)

    def _logits(self, frame: Frame) -> Tensor:
        """(C, H, W) at the frame's size: the logits are resized, not the labels, as in the paper's evaluation."""
        depth = frame.depth_m * np.float32(self._statistics.units_per_m)
        rgb, depths = to_tensors(frame.rgb, depth, self._size, self._statistics)
        with torch.inference_mode():
            logits = self._network(rgb.to(self._device), depths.to(self._device))
            if logits.shape[2:] != frame.depth_m.shape:
                logits = functional.interpolate(logits, size=frame.depth_m.shape, mode="bilinear", align_corners=False)
            return logits[0]  # type: ignore[no-any-return]

    def _class_ids(self, beware: BewareList) -> npt.NDArray[np.uint8]:
        """(C,) class id of the beware list by output of the network; of two entries of one name the first wins."""
        ids = {entry.name.casefold(): entry.class_id for entry in reversed(beware.classes)}
        return np.array([ids.get(name, NOTHING) for name in self._entry_names], dtype=np.uint8)


def most_likely(logits: Tensor) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float32]]:
    """(C, H, W) → the most likely class (H, W) and its softmax probability (H, W).

    Raises `BadConfiguration` for logits that are not finite: whoever looks at a NaN sees nothing to beware of.
    """
    with torch.inference_mode():
        # The classes of a pixel lie side by side in memory: over the last axis this is up to three times as fast.
        probability, winners = functional.softmax(logits.permute(1, 2, 0), dim=-1).max(dim=-1)
        if not bool(torch.isfinite(probability).all()):
            raise BadConfiguration("ESANet: the network's output is not finite; its weights do not fit this camera's pictures")
        return winners.cpu().numpy(), probability.cpu().numpy()


def _entry_names(class_names: tuple[str, ...], aliases: Mapping[str, str]) -> tuple[str, ...]:
    """What the outputs are called in the beware list, letters folded."""
    for name in aliases:
        if name not in class_names:
            raise BadConfiguration(f"ESANet: alias of {name!r:.60}, which is no class of the network: {', '.join(class_names)}")
    return tuple(aliases.get(name, name).casefold() for name in class_names)
