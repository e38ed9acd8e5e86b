"""Segmenter of a running console that can be exchanged between two frames."""

from __future__ import annotations

from app.runtime.start.segmentation import Perception
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.frame import Frame


class LivePerception:
    """The perception in use, itself a `Segmenter`.

    A frame is labelled as a whole by the segmenter in use when it came: `exchange` replaces one
    reference, and the next frame takes the new one.
    """

    def __init__(self, perception: Perception) -> None:
        self._now = perception

    @property
    def now(self) -> Perception:
        """Perception in use."""
        return self._now

    @property
    def title(self) -> str:
        """Title for operators."""
        return self._now.title

    @property
    def warning(self) -> str | None:
        """Why the network that was asked for, or was in use last, does not run; None when it does
        or none was."""
        return self._now.warning

    def exchange(self, perception: Perception) -> None:
        """Use another one from the next frame on."""
        self._now = perception

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        """Return the labels of a frame by the segmenter in use."""
        return self._now.segmenter.segment(frame, beware)

    def source_of(self, entry: BewareClass) -> LabelSource:
        """Return which part of the segmenter in use finds an entry."""
        return self._now.segmenter.source_of(entry)
