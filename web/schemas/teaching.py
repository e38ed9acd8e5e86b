"""Teaching in requests and answers."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, StrictBool, StrictStr

from navcore.errors import BadConfiguration
from web.interface.teaching import (
    VERSION_NAME,
    Annotation,
    CapturedFrame,
    FrameFolderState,
    NetworkVersion,
    TrainingOrder,
    TrainingRun,
)
from web.interface.wire import DOCUMENTED
from web.schemas.fields import Closed, Name, number

MAX_RUNS = 400_000
"""Largest number of values in the runs of an annotation."""
MAX_SIDE_PX = 4096
RunValue = Annotated[int, Field(strict=True, ge=0, le=MAX_SIDE_PX * MAX_SIDE_PX)]


class SizeIn(Closed):
    """Size of an image."""

    height: Annotated[int, Field(strict=True, ge=32, le=MAX_SIDE_PX)]
    """Number of rows."""
    width: Annotated[int, Field(strict=True, ge=32, le=MAX_SIDE_PX)]
    """Number of columns."""


class CapturingIn(Closed):
    """Whether frames are captured while the robot moves."""

    on: StrictBool
    """Capture while the robot moves."""


class AnnotationIn(Closed):
    """Annotation of a frame."""

    class_names: Annotated[list[Name], Field(max_length=250)]
    """Names of the labels 1, 2, …"""
    runs: Annotated[list[RunValue], Field(max_length=MAX_RUNS)]
    """Label and number of pixels by turns, row by row: `[0, 500, 1, 20, …]`; label 0 says
    nothing."""

    def annotation(self, height: int, width: int) -> Annotation:
        """Return the labels of a frame of a size; raises `BadConfiguration`."""
        labels, lengths = self.runs[0::2], self.runs[1::2]
        if len(labels) != len(lengths) or sum(lengths) != height * width:
            raise BadConfiguration(
                f"the runs cover {sum(lengths)} pixels, the frame has {height * width}"
            )
        if max(labels, default=0) > len(self.class_names):
            raise BadConfiguration(
                f"label {max(labels)} is beyond the {len(self.class_names)} classes of the "
                "annotation"
            )
        flat = np.repeat(np.array(labels, dtype=np.uint8), lengths)
        return Annotation(class_names=tuple(self.class_names), labels=flat.reshape(height, width))


class AnnotationOut(BaseModel):
    """Annotation of a frame, or a region in it."""

    model_config = DOCUMENTED

    width: int
    """Number of columns."""
    height: int
    """Number of rows."""
    class_names: list[str]
    """Names of the labels 1, 2, …"""
    runs: list[int]
    """Label and number of pixels by turns, row by row; label 0 says nothing."""

    @classmethod
    def of(cls, annotation: Annotation) -> AnnotationOut:
        """Return the answer for an annotation."""
        height, width = annotation.labels.shape
        flat = annotation.labels.ravel()
        starts = np.flatnonzero(np.diff(flat, prepend=np.int16(-1)))
        lengths = np.diff(starts, append=flat.size)
        runs = np.stack([flat[starts].astype(np.int64), lengths], axis=1)
        return cls(
            width=width,
            height=height,
            class_names=list(annotation.class_names),
            runs=runs.ravel().tolist(),
        )


class StoredAnnotationOut(AnnotationOut):
    """Stored annotation of a frame."""

    version: int
    """Version, that of the ETag."""

    @classmethod
    def of(cls, annotation: Annotation) -> StoredAnnotationOut:
        """Return the answer for a stored annotation."""
        return cls(**dict(AnnotationOut.of(annotation)), version=annotation.version)


class RegionIn(Closed):
    """Clicked pixel of a frame."""

    row: Annotated[int, Field(strict=True, ge=0, lt=MAX_SIDE_PX)]
    """Row of the pixel."""
    col: Annotated[int, Field(strict=True, ge=0, lt=MAX_SIDE_PX)]
    """Column of the pixel."""
    tolerance: Annotated[float, number(0.0, 200.0)] = 18.0
    """Largest distance from the colour of the pixel, in CIELAB."""


class FramesOut(BaseModel):
    """Captured frames."""

    model_config = DOCUMENTED

    folder: FrameFolderState
    """What the folder holds, and its limits."""
    frames: list[CapturedFrame]
    """All frames, oldest first."""


class CaptureOut(BaseModel):
    """Outcome of a capture."""

    model_config = DOCUMENTED

    frame: CapturedFrame | None
    """Stored frame; null for a near-duplicate of a stored one, which was dropped."""


class AddedOut(BaseModel):
    """Outcome of an upload."""

    model_config = DOCUMENTED

    added: int
    """Number of frames that were added."""


class TrainingIn(Closed):
    """What a training is to do; what is left out has its default."""

    start: Annotated[StrictStr, Field(pattern=VERSION_NAME)] | None = None
    """Version to start from; null for the one in use."""
    class_names: Annotated[tuple[Name, ...], Field(max_length=250)] = ()
    """Classes that must be annotated; the training takes all that are."""
    steps: Annotated[int, Field(strict=True, ge=1, le=100_000)] | None = None
    """Largest number of steps; it ends before when the loss hardly falls any more."""
    rehearsal: Annotated[int, Field(strict=True, ge=0, le=1000)] | None = None
    """Number of rendered images for rehearsal, and as many others for comparison."""
    size: SizeIn | None = None
    """Working size of the network, multiples of 32; null for that of the start. A smaller one is
    faster and sees less."""
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**31)] = 0
    """Random seed of the rendered images."""

    def order(self) -> TrainingOrder:
        """Return the order."""
        size = None if self.size is None else (self.size.height, self.size.width)
        values = {**dict(self), "size": size}
        return TrainingOrder(start_name=values.pop("start"), **values)


class TrainingOut(BaseModel):
    """Newest training run."""

    model_config = DOCUMENTED

    run: TrainingRun | None
    """State of the run; null before the first."""


class NetworksOut(BaseModel):
    """Versions of the network."""

    model_config = DOCUMENTED

    used: str | None
    """Version in use; null while the colour rules drive alone."""
    previous: str | None
    """Version that was in use before, to which one can roll back, `colour rules` where no network
    was; null where nothing was."""
    exchange: str | None
    """Version that is being prepared; null while none is."""
    trouble: str | None
    """Why the last exchange did not take place; null if it did."""
    versions: list[NetworkVersion]
    """All versions, that of the start first, then oldest first."""
