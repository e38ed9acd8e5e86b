"""Captured frames of a running console: capture by a click and while driving, annotation."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from app.teaching.frames import frame_archive
from app.teaching.frames.frame_record import UNITS_PER_M
from app.teaching.frames.frame_store import FrameStore, NoDepth
from app.teaching.frames.rules import CaptureRules, RegionRules
from navcore.errors import BadConfiguration, BewareNavError, Refused, StorageFailed
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.perception.region_growing import alike_at
from navcore.robot.frame import Frame
from web.interface.single_file import SingleFile
from web.interface.teaching import (
    NOTHING_NAME,
    Annotation,
    CapturedFrame,
    FrameFolderState,
)

JOIN_S = 2.0
"""Longest wait for the end of the thread, seconds."""
POLL_S = 0.2
"""Time after which the waiting thread asks whether it shall end, seconds."""
DEFAULT, REGION = CaptureRules(), RegionRules()
log = logging.getLogger(__name__)


class LiveFrames:
    """Satisfies `web.interface.teaching.FrameFolder`.

    `note` is called by the think thread and only hands a frame over; a thread of this object writes
    it.
    """

    def __init__(
        self,
        folder: Path,
        *,
        newest: Callable[[], Frame | None],
        class_names: Callable[[], Sequence[str]],
        rules: CaptureRules = DEFAULT,
    ) -> None:
        """`newest` gives the newest frame, placed in the map; `class_names` are those that the
        network may learn."""
        self.store = FrameStore(folder, rules)
        self._newest, self._class_names = newest, class_names
        self._capturing, self._trouble = False, None  # type: tuple[bool, str | None]
        self._waiting: queue.Queue[Frame] = queue.Queue(maxsize=1)
        self._thread: threading.Thread | None = None
        self._ending = threading.Event()
        self._guard = threading.Lock()
        self._noted: Pose2 | None = None
        self._exported = SingleFile(
            "the images are being exported already; wait until that has ended"
        )
        self._imported = SingleFile("images are being imported already; wait until that has ended")

    def state(self) -> FrameFolderState:
        """Return what the folder holds."""
        frames, rules = self.store.all(), self.store.rules
        return FrameFolderState(
            folder=str(self.store.folder),
            frames=len(frames),
            annotated=sum(frame.annotated for frame in frames),
            bytes_used=self.store.bytes_used,
            max_frames=rules.max_frames,
            max_bytes=rules.max_bytes,
            capturing=self._capturing,
            dropped=self.store.dropped,
            trouble=self._trouble,
        )

    def all(self) -> Sequence[CapturedFrame]:
        """Return all frames, oldest first."""
        return self.store.all()

    def capture(self) -> CapturedFrame | None:
        """Store the newest frame; None for a near-duplicate."""
        frame = self._newest()
        if frame is None:
            raise Refused("the camera has delivered no image yet")
        return self.store.add_frame(frame, "operator")

    def capture_while_driving(self, on: bool) -> None:
        """Set whether frames are captured while the robot moves."""
        with self._guard:
            self._trouble = None if on else self._trouble
            self._capturing = on
            if on and self._thread is None:
                self._thread = threading.Thread(target=self._run, name="capture", daemon=True)
                self._thread.start()

    def note(self, frame: Frame) -> None:
        """Capture a frame that is placed in the map, if frames are captured and the last one is
        written."""
        if not self._capturing or not self._has_moved(frame.pose):
            return
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(frame)
            self._noted = frame.pose

    def close(self) -> None:
        """End the capture and its thread."""
        with self._guard:
            self._capturing, thread = False, self._thread
        if thread is not None:
            self._ending.set()
            thread.join(JOIN_S)

    def delete(self, frame_id: str) -> None:
        """Delete a frame and its annotation."""
        self.store.delete(frame_id)

    def picture(self, frame_id: str) -> bytes:
        """Return the colours of a frame as PNG."""
        return self.store.picture(frame_id)

    def annotation(self, frame_id: str) -> Annotation:
        """Return the annotation of a frame."""
        return self.store.annotation(frame_id)

    def annotate(
        self, frame_id: str, annotation: Annotation, *, expected_version: int | None = None
    ) -> CapturedFrame:
        """Replace the annotation of a frame; refused where a class that is marked in it is neither
        on the beware list nor in the folder."""
        known = {name.casefold() for name in (NOTHING_NAME, *self._class_names())}
        stored = {name.casefold() for name in self.store.annotation(frame_id).class_names}
        marked = set(np.unique(annotation.labels).tolist())
        for label, name in enumerate(annotation.class_names, 1):
            if label in marked and name.casefold() not in known | stored:
                raise BadConfiguration(
                    f"{name!r:.60} is not on the beware list; add the class there first"
                )
        return self.store.annotate(frame_id, annotation, expected_version=expected_version)

    def region(self, frame_id: str, row: int, col: int, tolerance: float) -> npt.NDArray[np.bool_]:
        """Return the region around a pixel."""
        rgb, depth_mm = self.store.images(frame_id)
        return alike_at(
            row,
            col,
            rgb=rgb,
            depth_m=depth_mm.astype(np.float32) / UNITS_PER_M,
            tolerance=tolerance,
            depth_step_m=REGION.depth_step_m,
            max_share=REGION.max_share,
        )

    def export(self) -> BinaryIO:
        """Return a file with all frames as a zip archive."""
        return self._exported.open(lambda: frame_archive.exported(self.store))

    def import_file(self) -> BinaryIO:
        """Return an empty file for an archive that arrives."""
        try:
            return self._imported.open(lambda: frame_archive.empty_file(self.store))
        except OSError as error:
            said = f"the archive cannot be stored: {error.strerror or error}"
            raise StorageFailed(said) from error

    def add_archive(self, file: BinaryIO) -> int:
        """Add the frames of an archive."""
        return frame_archive.add_archive(self.store, file)

    def _has_moved(self, pose: Pose2) -> bool:
        """Return whether the robot has moved enough for another frame to be worth comparing."""
        last, rules = self._noted, self.store.rules
        return (
            last is None
            or last.distance_to(pose.x_m, pose.y_m) >= rules.step_m / 2
            or abs(wrap_angle(last.yaw_rad - pose.yaw_rad)) >= rules.step_rad / 2
        )

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                frame = self._waiting.get(timeout=POLL_S)
            except queue.Empty:
                continue
            try:
                self.store.add_frame(frame, "drive")
            except NoDepth as error:
                log.info("a frame is left out: %s", error)
            except BewareNavError as error:
                # A full folder or disk stays full: no further attempt until the operator asks.
                self._capturing, self._trouble = False, str(error)
                log.warning("the capture of frames ended: %s", error)
            except Exception as error:
                self._capturing, self._trouble = False, f"{type(error).__name__}: {error}"
                log.exception("the capture of frames ended")
