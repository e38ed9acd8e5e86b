"""Record of a captured frame: what a data set keeps of an image, and where it was taken."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from app.teaching.frames.thumbnails import SIZE, Fingerprint, thumbnail_of
from app.teaching.json_files import json_of
from navcore.errors import BadConfiguration
from navcore.files import read_whole
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Pose2
from navcore.learning.data.card import DepthSums, Files
from navcore.learning.data.images import DepthArray, RgbArray
from navcore.robot.frame import Frame
from navcore.toml_config import from_table
from web.interface.teaching import FrameSource

TrainingSplit = Literal["train", "valid"]
"""Split of a frame in trainings: trained on, or held back."""
MAX_RECORD_BYTES = 100_000
UNITS_PER_M = 1000.0
"""Unit of the depth images: millimetres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameRecord:
    """What is kept of a frame beside its images; the file `train/camera/ID.json`."""

    id: str
    """Name of the frame."""
    source: FrameSource
    """What captured it."""
    width: int
    """Number of columns."""
    height: int
    """Number of rows."""
    pixels: int
    """Number of pixels with a depth."""
    total: int
    """Sum of their depths in millimetres."""
    squares: int
    """Sum of their squared depths."""
    thumbnail: str
    """Grey thumbnail, 18 rows of 32 pixels, hexadecimal."""
    intrinsics: Intrinsics | None = None
    """Intrinsics of the camera; None for an uploaded image."""
    pose: Pose2 | None = None
    """Pose of the robot in the map frame; None for an uploaded image."""
    T_map_camera: tuple[float, ...] | None = None
    """Pose of the camera in the map frame, a 4 × 4 matrix row by row; None for an uploaded
    image."""
    split: TrainingSplit | None = None
    """Split of the frame in all trainings; None before the first one."""
    stamp_ns: int | None = None
    """Time of capture in nanoseconds of the robot's clock; None for an uploaded image."""

    @property
    def sums(self) -> DepthSums:
        """Sums of the depth of this frame."""
        return DepthSums(pixels=self.pixels, total=self.total, squares=self.squares)

    @property
    def fingerprint(self) -> Fingerprint:
        """What is compared to find near-duplicates."""
        grey = np.frombuffer(bytes.fromhex(self.thumbnail), dtype=np.uint8)
        return Fingerprint(pose=self.pose, thumbnail=grey.reshape(SIZE[::-1]))

    @property
    def files(self) -> Files:
        """Paths of colours, depth and labels, relative to the folder."""
        return (
            f"train/rgb/{self.id}.png",
            f"train/depth/{self.id}.png",
            f"train/label/{self.id}.npy",
        )

    @property
    def path(self) -> str:
        """Path of this record, relative to the folder."""
        return f"train/camera/{self.id}.json"

    def as_json(self) -> bytes:
        """Return the content of the file."""
        return json_of(self)


def depth_mm_of(frame: Frame) -> DepthArray:
    """Return the (H, W) depth of a frame in millimetres, 0 where it was not measured."""
    millimetres = np.nan_to_num(np.round(frame.depth_m * UNITS_PER_M), nan=0.0, posinf=0.0)
    return np.asarray(np.clip(millimetres, 0, 65535), dtype=np.uint16)


def has_depth(depth_mm: DepthArray) -> bool:
    """Return whether an image can be learned from: whether its (H, W) depth has a spread."""
    sums = DepthSums()
    sums.add(depth_mm)
    try:
        sums.statistics(units_per_m=UNITS_PER_M)
    except BadConfiguration:
        return False
    return True


def record_of(
    name: str,
    rgb: RgbArray,
    depth_mm: DepthArray,
    source: FrameSource,
    frame: Frame | None = None,
) -> FrameRecord:
    """Return the record of an image, with camera and pose if a frame is given, which must be placed
    in the map."""
    sums = DepthSums()
    sums.add(depth_mm)
    taken = (
        {}
        if frame is None
        else {
            "intrinsics": frame.intrinsics,
            "pose": frame.pose,
            "T_map_camera": tuple(frame.T_map_camera.ravel().tolist()),
            "stamp_ns": frame.stamp_ns,
        }
    )
    return FrameRecord(
        id=name,
        source=source,
        width=depth_mm.shape[1],
        height=depth_mm.shape[0],
        pixels=sums.pixels,
        total=sums.total,
        squares=sums.squares,
        thumbnail=thumbnail_of(rgb).tobytes().hex(),
        **taken,  # type: ignore[arg-type]
    )


def read_record(path: Path) -> FrameRecord:
    """Read a record; raises `BadConfiguration`."""
    try:
        table = json.loads(read_whole(path, at_most=MAX_RECORD_BYTES))
        record = from_table(FrameRecord, table, str(path))
        whole = len(bytes.fromhex(record.thumbnail)) == SIZE[0] * SIZE[1]
    except (ValueError, RecursionError) as error:
        raise BadConfiguration(f"{path}: not readable: {error!s:.200}") from None
    if record.id != path.stem or not whole:
        raise BadConfiguration(f"{path}: not the record of a captured frame")
    return record
