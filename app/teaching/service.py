"""Teaching in a running console."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from app.runtime.start.live_perception import LivePerception
from app.runtime.start.segmentation import Perception
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.teaching.frames.live_frames import LiveFrames
from app.teaching.networks.live_networks import Compose, LiveNetworks
from app.teaching.networks.versions import START, VersionStore
from app.teaching.training.live_trainings import LiveTrainings
from navcore.mission.beware_list import BewareList
from navcore.robot.frame import Frame

DEFAULT_CHOICE = SegmenterChoice()


def versions_in(folder: Path) -> VersionStore:
    """Return the versions of the network in the folder of `LiveTeaching`."""
    return VersionStore(folder / "versions")


class LiveTeaching:
    """Satisfies `web.interface.teaching.Teaching`."""

    def __init__(
        self,
        folder: Path,
        *,
        newest: Callable[[], Frame | None],
        beware: Callable[[], BewareList],
        perception: LivePerception,
        compose: Compose,
        choice: SegmenterChoice = DEFAULT_CHOICE,
        used: str = START,
    ) -> None:
        """`folder` keeps everything; `newest` gives the newest frame, placed in the map. `choice`
        and `used`: options and version of the start."""

        def try_out(perception: Perception) -> None:
            frame = newest()
            if frame is not None:
                perception.segmenter.segment(frame, beware())

        versions = versions_in(folder)
        self.frames = LiveFrames(
            folder / "frames",
            newest=newest,
            class_names=lambda: [entry.detected_as for entry in beware().classes],
        )
        self.networks = LiveNetworks(
            versions, perception, choice=choice, used=used, compose=compose, try_out=try_out
        )
        self.trainings = LiveTrainings(versions, self.frames.store, self.networks.start_of)

    def note(self, frame: Frame) -> None:
        """Called by the think thread with the frame of each tick, placed in the map."""
        self.frames.note(frame)

    def close(self) -> None:
        """End the threads and the process of this object."""
        self.frames.close()
        self.trainings.close()
        self.networks.close()
