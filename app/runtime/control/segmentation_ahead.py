"""One segmentation in flight beside the tick: the labels of the next frame are made in a thread of
their own while the tick works on those of this frame."""

from __future__ import annotations

import contextlib
import logging
import os
import queue
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from navcore.mission.beware_list import BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame

NICENESS = 2
"""Niceness of the thread, and of the threads that an engine starts in it: think and command go
before it, the web server after it."""
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SegmentedFrame:
    """A frame with its labels."""

    frame: Frame
    """The frame, in odometry's frame."""
    beware: BewareList | None = None
    """List by which it was labelled; None when it was not."""
    labels: Labels | None = None
    """Its labels; None when they could not be made: the tick tries again, and reports the error."""
    took_ms: float = 0.0
    """Duration of the segmentation, milliseconds."""

    def labels_by(self, beware: BewareList) -> Labels | None:
        """Return the labels, if they were made by this very list."""
        return self.labels if self.beware is beware else None


class SegmentationAhead:
    """A thread that labels one frame at a time; `begin` and `take` are called in turn by one other
    thread."""

    def __init__(self, segment: Callable[[Frame, BewareList], Labels]) -> None:
        self._segment = segment
        self._asked: queue.SimpleQueue[tuple[Frame, BewareList] | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[SegmentedFrame] = queue.SimpleQueue()
        self.in_flight: Frame | None = None
        """The frame that `take` is going to return; None when nothing was begun."""
        self.begun_s = 0.0
        """Time of the monotonic clock at which the newest one was begun, seconds."""
        # A daemon: an engine that hangs must not hold up the end of the program.
        self._thread = threading.Thread(target=self._run, name="segment", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread after the present frame, without waiting for it."""
        self._asked.put(None)

    def begin(self, frame: Frame, beware: BewareList) -> None:
        """Begin to label a frame, when none is in flight."""
        self.in_flight, self.begun_s = frame, time.monotonic()
        self._asked.put((frame, beware))

    def take(self, timeout_s: float) -> SegmentedFrame | None:
        """Wait for the frame in flight; None where it is not labelled in time."""
        try:
            done = self._done.get(timeout=timeout_s)
        except queue.Empty:
            return None
        self.in_flight = None
        return done

    def _run(self) -> None:
        if sys.platform.startswith("linux"):  # elsewhere a thread has no niceness of its own
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
        while (asked := self._asked.get()) is not None:
            self._done.put(self._segmented(*asked))

    def _segmented(self, frame: Frame, beware: BewareList) -> SegmentedFrame:
        begin_s = time.perf_counter()
        try:
            labels = self._segment(frame, beware)
        except Exception:
            # Not logged here: the tick meets the same error, and is the one that reports it.
            return SegmentedFrame(frame=frame)
        took_ms = (time.perf_counter() - begin_s) * 1e3
        return SegmentedFrame(frame=frame, beware=beware, labels=labels, took_ms=took_ms)
