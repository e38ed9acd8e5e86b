"""Port of the console to teaching: captured frames, their annotation, training runs and the
networks that came of them. `app` implements it.

Every method may be called from any thread; none waits for, or delays, the tick or the command
thread. Refusals are those of `web.interface.operations`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO, Literal, Protocol

import numpy as np
import numpy.typing as npt

from navcore.learning.data.class_names import BACKGROUND
from web.interface.wire import served

NOTHING_NAME = BACKGROUND
"""Name of the class of everything that is no object of the beware list."""
FrameSource = Literal["operator", "drive", "upload"]
"""What captured a frame: a click, the capture while driving, an upload."""
VERSION_NAME = r"^[A-Za-z0-9][A-Za-z0-9 _-]{0,39}$"
"""Name of a version of the network."""
MAX_UPLOAD_BYTES = 256_000_000
"""Largest weights file that is uploaded, bytes."""
MAX_FRAMES_BYTES = 520_000_000
"""Largest archive of frames in bytes, packed and unpacked: a full folder of frames, whose limit is
500 MB before the last one, with its lists."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class CapturedFrame:
    """A stored RGB-D frame."""

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
    version: int
    """Version of the annotation, another one after each edit that changes it."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class FrameFolderState:
    """What the folder of captured frames holds, and its limits."""

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
    version: int = 0
    """Version of a stored annotation; 0 of one that is not stored."""


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

    def annotate(
        self, frame_id: str, annotation: Annotation, *, expected_version: int | None = None
    ) -> CapturedFrame:
        """Replace the annotation of a frame; raises `BadConfiguration` for one that does not fit
        the image, or names a class twice or one that is not on the beware list, and `Outdated`
        where another one than `expected_version` is stored."""

    def region(self, frame_id: str, row: int, col: int, tolerance: float) -> npt.NDArray[np.bool_]:
        """Return the (H, W) connected pixels around a pixel of like colour without a step of depth
        between them. `tolerance` is the distance of colours in CIELAB."""

    def export(self) -> BinaryIO:
        """Return a file with all frames as a zip archive of a data set, which the caller closes;
        raises `Refused` without a frame, and until the file of the last export is closed."""

    def import_file(self) -> BinaryIO:
        """Return an empty file on the disk of the frames, for an archive that arrives, which the
        caller closes; raises `Refused` until the file of the last import is closed,
        `StorageFailed`."""

    def add_archive(self, file: BinaryIO) -> int:
        """Add the frames of such an archive and return their number; all or none. Raises
        `BadConfiguration` with what is damaged."""


TrainingPhase = Literal[
    "waiting", "rendering", "encoding", "training", "comparing", "done", "cancelled", "failed"
]
"""What a training run does, or how it ended."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class CurvePoint:
    """Point of a curve over the steps of a training."""

    step: int
    """Number of steps taken."""
    value: float
    """Value then."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class ClassFigures:
    """How well two networks find a class in images that neither was trained on."""

    name: str
    """Name of the class."""
    pixels: int
    """Number of its true pixels in these images."""
    old: float | None = None
    """IoU of the network that the training started from; null where it does not know the class, or
    without a true pixel."""
    new: float | None = None
    """IoU of the new network; null without a true pixel."""
    change: tuple[float, float] | None = None
    """95 % interval of new − old over these images; null where one of them is, and where fewer than
    two images show the class."""
    images: Literal["captured", "rendered"]
    """Images of the comparison: captured frames that were held back, or rendered ones."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkVersion:
    """Network that the robot can use."""

    name: str
    """Name of the version; `start` is the network that the console was started with."""
    origin: Literal["start", "training", "upload"]
    """Where it comes from."""
    sha256: str
    """SHA-256 of its file, hexadecimal."""
    class_names: tuple[str, ...]
    """Classes that it knows."""
    taught: tuple[str, ...] = ()
    """Classes that were annotated for its training."""
    start_name: str | None = None
    """Version that its training started from."""
    created_unix_s: float | None = None
    """When it was made, seconds since 1970."""
    figures: tuple[ClassFigures, ...] = ()
    """Comparison with the network that the training started from."""
    kept_share: float | None = None
    """Share of the pixels of the held-back frames that no annotation names, where the new network
    says what the old one said."""
    not_found: tuple[str, ...] = ()
    """Taught classes that it does not find in the held-back frames."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingRun:
    """State of a training run."""

    name: str
    """Name of the version that comes of it."""
    start_name: str
    """Version that it starts from."""
    class_names: tuple[str, ...]
    """Annotated classes."""
    phase: TrainingPhase
    """What it does, or how it ended."""
    done: int
    """Number of images or steps that are done in this phase."""
    of: int
    """Their number in total."""
    losses: tuple[CurvePoint, ...]
    """Least loss since the point before, by step."""
    mious: tuple[CurvePoint, ...]
    """Mean IoU of the taught classes in the held-back frames, by step."""
    looks: int
    """Number of validation images."""
    message: str
    """Why it failed; empty unless it has."""
    running: bool
    """Whether its process runs."""
    not_found: tuple[str, ...] = ()
    """Annotated classes that the trained network does not find in the frames that were held back;
    known when it is done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingOrder:
    """What an operator asks of a training."""

    start_name: str | None = None
    """Version to start from; None for the one in use."""
    class_names: tuple[str, ...] = ()
    """Classes that must be annotated; the training takes all that are."""
    steps: int | None = None
    """Largest number of steps; None for the default."""
    rehearsal: int | None = None
    """Number of rendered images for rehearsal and for comparison each; None for the default."""
    size: tuple[int, int] | None = None
    """Working size of the network (height, width), multiples of 32; None for that of the start."""
    seed: int = 0
    """Random seed of the rendered images."""


class Trainings(Protocol):
    """Training runs, one at a time, each in a process of its own at the lowest priority."""

    def newest(self) -> TrainingRun | None:
        """Return the newest run; None before the first."""

    def start(self, order: TrainingOrder) -> TrainingRun:
        """Begin a run; raises `Refused` while one runs, for too few frames, and for a class without
        pixels."""

    def cancel(self) -> TrainingRun:
        """End the run that is going on; it can be resumed. Raises `Refused` when none is."""

    def resume(self) -> TrainingRun:
        """Continue the newest run where it was cancelled or failed; raises `Refused`."""

    def look(self, number: int) -> bytes:
        """Return a validation image of the newest run as PNG; raises `NotKnown`."""


class Networks(Protocol):
    """Versions of the network, one of them in use."""

    @property
    def used(self) -> str | None:
        """Name of the version in use; None while the colour rules drive alone."""

    @property
    def previous(self) -> str | None:
        """Name of the version that was in use before, `colour rules` where no network was; None
        where nothing was."""

    @property
    def exchange(self) -> str | None:
        """Name of the version that is being prepared; None while none is."""

    @property
    def trouble(self) -> str | None:
        """Why the last exchange did not take place; None if it did."""

    def all(self) -> Sequence[NetworkVersion]:
        """Return all versions, oldest first."""

    def use(self, name: str, *, force: bool = False) -> None:
        """Prepare a version beside the tick and exchange the network between two frames; returns at
        once. Raises `NotKnown`, and `Refused` while another one is being prepared and, without
        `force`, for a version that does not find what it was taught."""

    def roll_back(self) -> str:
        """Use the version that was in use before and return its name; raises `Refused` without
        one."""

    def import_file(self) -> BinaryIO:
        """Return an empty file on the disk of the versions, for a weights file that arrives, which
        the caller closes; raises `Refused` until the file of the last one is closed,
        `StorageFailed`."""

    def add(self, name: str, file: BinaryIO) -> NetworkVersion:
        """Store an uploaded weights file as a version; raises `BadConfiguration` for a damaged
        one."""

    def delete(self, name: str) -> None:
        """Delete a version; raises `Refused` for one in use and for `start`."""


class Teaching(Protocol):
    """Everything an operator needs to teach the network a class."""

    @property
    def frames(self) -> FrameFolder:
        """Captured frames."""

    @property
    def trainings(self) -> Trainings:
        """Training runs."""

    @property
    def networks(self) -> Networks:
        """Versions of the network."""
