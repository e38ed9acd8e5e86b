"""Port of the console to teaching: captured frames, their annotation, training runs and the
networks that came of them. `app` implements it.

Every method may be called from any thread; none waits for, or delays, the tick or the command
thread. Refusals are those of `web.interface.operations`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict

from web.interface.wire import DOCUMENTED

NOTHING_NAME = "background"
"""Name of the class of everything that is no object of the beware list."""
FrameSource = Literal["operator", "drive", "upload"]
"""What captured a frame: a click, the capture while driving, an upload."""
MAX_UPLOAD_BYTES = 256_000_000
"""Largest uploaded archive of frames in bytes, packed and unpacked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CapturedFrame:
    """A stored RGB-D frame."""

    __pydantic_config__: ClassVar[ConfigDict] = DOCUMENTED

    id: str
    """Name of the frame; the order of the names is that of the captures."""
    source: FrameSource
    """What captured it."""
    width: int
    """Number of columns."""
    height: int
    """Number of rows."""
    annotated: bool
    """Whether an annotation was saved; only annotated frames are learned from."""
    class_names: tuple[str, ...]
    """Classes with pixels in the annotation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameFolderState:
    """What the folder of captured frames holds, and its limits."""

    __pydantic_config__: ClassVar[ConfigDict] = DOCUMENTED

    folder: str
    """Folder of the frames, in the layout of a data set."""
    frames: int
    """Number of stored frames."""
    annotated: int
    """Number of frames with an annotation."""
    bytes_used: int
    """Their size in bytes."""
    max_frames: int
    """Number of frames from which the folder is full."""
    max_bytes: int
    """Size in bytes from which the folder is full."""
    capturing: bool
    """Whether frames are captured while the robot moves."""
    dropped: int
    """Number of near-duplicates that were not kept since the start of the console."""
    trouble: str | None = None
    """Why the capture while driving ended by itself; null while all is well."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Annotation:
    """Labels of a frame by class name."""

    class_names: tuple[str, ...]
    """Names of the labels 1, 2, …; unique, ignoring case."""
    labels: npt.NDArray[np.uint8]
    """(H, W) label of each pixel: 0 where the annotation says nothing, else number of the class."""


class FrameFolder(Protocol):
    """Captured frames on disk."""

    def state(self) -> FrameFolderState:
        """Return what the folder holds."""

    def all(self) -> Sequence[CapturedFrame]:
        """Return all frames, oldest first."""

    def capture(self) -> CapturedFrame | None:
        """Store the newest frame of the camera; None for a near-duplicate of a stored one. Raises
        `Refused` when the folder is full and without a frame, `StorageFailed` when the disk is."""

    def capture_while_driving(self, on: bool) -> None:
        """Set whether frames are captured while the robot moves."""

    def delete(self, frame_id: str) -> None:
        """Delete a frame and its annotation; raises `NotKnown`."""

    def picture(self, frame_id: str) -> bytes:
        """Return the colours of a frame as PNG; raises `NotKnown`."""

    def annotation(self, frame_id: str) -> Annotation:
        """Return the annotation of a frame; raises `NotKnown`."""

    def annotate(self, frame_id: str, annotation: Annotation) -> CapturedFrame:
        """Replace the annotation of a frame; raises `BadConfiguration` for one that does not fit
        the image, or names a class twice or one that is not on the beware list."""

    def region(self, frame_id: str, row: int, col: int, tolerance: float) -> npt.NDArray[np.bool_]:
        """Return the (H, W) connected pixels around a pixel of like colour without a step of depth
        between them. `tolerance` is the distance of colours in CIELAB."""

    def export(self) -> bytes:
        """Return all frames as a zip archive of a data set."""

    def add_archive(self, data: bytes) -> int:
        """Add the frames of such an archive and return their number; all or none. Raises
        `BadConfiguration` with what is damaged."""


class Teaching(Protocol):
    """Everything an operator needs to teach the network a class."""

    @property
    def frames(self) -> FrameFolder:
        """Captured frames."""
