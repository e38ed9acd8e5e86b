"""Teaching in a running console."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from app.teaching.frames import LiveFrames
from navcore.robot.frame import Frame


class LiveTeaching:
    """Satisfies `web.interface.teaching.Teaching`."""

    def __init__(
        self,
        folder: Path,
        *,
        newest: Callable[[], Frame | None],
        class_names: Callable[[], Sequence[str]],
    ) -> None:
        """`folder` keeps everything; see `LiveFrames` for the rest."""
        self.frames = LiveFrames(folder / "frames", newest=newest, class_names=class_names)

    def note(self, frame: Frame) -> None:
        """Called by the think thread with the frame of each tick, placed in the map."""
        self.frames.note(frame)

    def close(self) -> None:
        """End the threads of this object."""
        self.frames.close()
