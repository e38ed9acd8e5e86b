"""Teaching in requests and answers."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, StrictBool

from navcore.errors import BadConfiguration
from web.interface.teaching import Annotation, CapturedFrame, FrameFolderState
from web.interface.wire import DOCUMENTED
from web.schemas.fields import Closed, Name, number

MAX_RUNS = 400_000
"""Largest number of values in the runs of an annotation."""
MAX_SIDE_PX = 4096
RunValue = Annotated[int, Field(strict=True, ge=0, le=MAX_SIDE_PX * MAX_SIDE_PX)]


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
