"""A recording of an RGB-D camera with its poses, stored in a folder.

The folder holds

* `camera-intrinsics.txt`: the 3 × 3 matrix of the depth camera, pixels;
* `poses.txt`: one line per frame, its number and T_world_camera (4 × 4) row by row, metres
  (lines with # are comments);
* `frame-NNNNNN.depth.png`: 16 bits, millimetres, 0 and 65535 = not measured;
* `frame-NNNNNN.color.jpg` (or `.png`): the colour image of the same size; pixels whose colour
  is not known are transparent in a PNG.

Frame numbers count images at 30 Hz. The camera frame is the optical one (x right, y down, z
ahead); the floor of the world frame need not be known (`floor_plane.py` finds it).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.files import read_whole
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix
from navcore.learning.data.images import (
    MaskArray,
    RgbArray,
    decode_uncoloured,
    encode_rgb,
    read_bytes,
    read_depth,
    read_rgb,
    write_bytes,
    write_grey,
    write_rgb,
)
from navcore.robot.frame import Frame

INTRINSICS, POSES = "camera-intrinsics.txt", "poses.txt"
MAX_FRAMES = 100_000
MAX_TEXT_BYTES = 1 << 25
MAX_NUMBER = 999_999
FURTHEST_M = 1e4
"""Largest distance of a camera from the origin of its world frame."""
RATE_HZ = 30
"""Rate that frame numbers count."""
UNITS_PER_M = 1000.0
QUALITY = 95
"""Quality of the colour images that are written, per cent."""
NOT_MEASURED = 65535
LEAST_MEASURED_M = 0.4
"""Smallest valid depth: triangulating cameras measure wrong values below it."""
ROTATION_TOLERANCE = 5e-3
"""Tolerance of a rotation matrix, which may be written with few digits or averaged."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """The frames of a recording and their camera poses; images are read one by one."""

    folder: Path
    """Folder of the recording."""
    intrinsics: Intrinsics
    """Intrinsics of the depth camera."""
    numbers: npt.NDArray[np.int64]
    """(N,) frame numbers, increasing."""
    T_world_camera: npt.NDArray[np.float64]
    """(N, 4, 4) camera poses in the recording's own world frame, metres."""

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.numbers)

    def stamp_ns(self, index: int) -> int:
        """Return the capture time of a frame since the first one, ns."""
        return int(self.numbers[index] - self.numbers[0]) * 1_000_000_000 // RATE_HZ

    def depth_m(self, index: int) -> npt.NDArray[np.float32]:
        """Return the depth (H, W) in metres, 0 = not measured; raises `BadConfiguration`."""
        path = self._path(index, "depth.png")
        raw = read_depth(path)
        self._check_size(raw.shape, path)
        depth_m = np.where(raw == NOT_MEASURED, np.uint16(0), raw).astype(np.float32) / np.float32(
            UNITS_PER_M
        )
        depth_m[depth_m < LEAST_MEASURED_M] = 0
        return depth_m

    def rgb(self, index: int) -> RgbArray:
        """Return the colours (H, W, 3); raises `BadConfiguration` naming the file."""
        path = self._colour_path(index)
        rgb = read_rgb(path)
        self._check_size(rgb.shape[:2], path)
        return rgb

    def uncoloured(self, index: int) -> MaskArray | None:
        """Return the pixels (H, W) whose colour is not known; None where all are. Raises
        `BadConfiguration` naming the file."""
        path = self._colour_path(index)
        return decode_uncoloured(read_bytes(path), str(path)) if path.suffix == ".png" else None

    def _colour_path(self, index: int) -> Path:
        path = self._path(index, "color.jpg")
        return path if path.exists() else self._path(index, "color.png")

    def _path(self, index: int, ending: str) -> Path:
        return self.folder / f"frame-{self.numbers[index]:06d}.{ending}"

    def _check_size(self, shape: tuple[int, ...], path: Path) -> None:
        expected = (self.intrinsics.height, self.intrinsics.width)
        if shape != expected:
            raise BadConfiguration(
                f"{path}: is {shape} pixels (height, width), expected {expected} as the first "
                "depth image"
            )


class RecordingWriter:
    """Writes the frames of a robot as a recording into a folder."""

    def __init__(self, folder: Path) -> None:
        """Use a folder without a recording; raises `BadConfiguration` for one that has one."""
        self._folder, self._last = folder, -1
        if (folder / POSES).exists():
            raise BadConfiguration(f"{folder}: holds a recording already; give another folder")

    def add(self, frame: Frame) -> None:
        """Write a frame in the map frame; one that has the number of the last one is left out."""
        number = round(frame.stamp_ns * RATE_HZ / 1e9)
        if not self._last < number <= MAX_NUMBER:
            return
        if self._last < 0:
            lens = frame.intrinsics
            rows = f"{lens.fx:.9g} 0 {lens.cx:.9g}\n0 {lens.fy:.9g} {lens.cy:.9g}\n0 0 1\n"
            write_bytes(self._folder / INTRINSICS, rows.encode())
        self._last = number
        depth = np.round(frame.depth_m * UNITS_PER_M).clip(0, NOT_MEASURED).astype(np.uint16)
        write_grey(self._folder / f"frame-{number:06d}.depth.png", depth)
        colours = self._folder / f"frame-{number:06d}.color.jpg"
        if frame.uncoloured is None:
            write_rgb(colours, frame.rgb, jpeg_quality=QUALITY)
        else:
            content = encode_rgb(frame.rgb, uncoloured=frame.uncoloured)
            write_bytes(colours.with_suffix(".png"), content)
        # Last, so that no pose is without its images when the drive is killed.
        row = " ".join(f"{value:.9g}" for value in frame.T_map_camera.ravel())
        with (self._folder / POSES).open("a", encoding="utf-8") as poses:
            poses.write(f"{number} {row}\n")


def open_recording(folder: Path, *, every: int = 1) -> Recording:
    """Open the recording in a folder, using every N-th frame; raises `BadConfiguration`."""
    matrix = _numbers(folder / INTRINSICS, 3)
    if matrix.shape != (3, 3) or min(matrix[0, 0], matrix[1, 1]) <= 0:
        raise BadConfiguration(
            f"{folder / 'camera-intrinsics.txt'}: expected a 3 × 3 matrix with positive focal "
            "lengths"
        )
    table = _numbers(folder / POSES, 17)
    _check_poses(table, folder / POSES)
    table = table[::every]
    height, width = read_depth(folder / f"frame-{int(table[0, 0]):06d}.depth.png").shape
    fx, fy, cx, cy = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return Recording(
        folder=folder,
        intrinsics=Intrinsics(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy),
        numbers=table[:, 0].astype(np.int64),
        T_world_camera=table[:, 1:].reshape(-1, 4, 4),
    )


def _numbers(path: Path, columns: int) -> npt.NDArray[np.float64]:
    """Read the lines of a text file as finite numbers (N, columns); raises `BadConfiguration`."""
    rows = []
    for count, line in enumerate(
        read_whole(path, at_most=MAX_TEXT_BYTES).decode("utf-8", "replace").splitlines(), start=1
    ):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != columns or not np.isfinite(row).all():
            raise BadConfiguration(
                f"{path}: line {count}: expected {columns} numbers, got {line!r:.60}"
            )
        rows.append(row)
    return np.array(rows).reshape(-1, columns)


def _check_poses(table: npt.NDArray[np.float64], path: Path) -> None:
    numbers, poses = table[:, 0], table[:, 1:].reshape(-1, 4, 4)
    if not 0 < len(table) <= MAX_FRAMES:
        raise BadConfiguration(f"{path}: has {len(table)} poses, expected 1 to {MAX_FRAMES}")
    if (
        (numbers != np.round(numbers)).any()
        or numbers.min() < 0
        or numbers.max() > MAX_NUMBER
        or (np.diff(numbers) <= 0).any()
    ):
        raise BadConfiguration(
            f"{path}: frames must be numbered by increasing whole numbers from 0 to {MAX_NUMBER}"
        )
    for number, pose in zip(numbers, poses, strict=True):
        if not _is_rigid(pose):
            raise BadConfiguration(
                f"{path}: frame {number:.0f}: its matrix is no rotation and translation "
                f"within {FURTHEST_M:g} m"
            )


def _is_rigid(pose: Matrix) -> bool:
    rotation = pose[:3, :3]
    orthogonal = (
        np.abs(rotation @ rotation.T - np.eye(3)).max() < ROTATION_TOLERANCE
        and np.linalg.det(rotation) > 0
    )
    return bool(
        orthogonal
        and np.abs(pose[:3, 3]).max() < FURTHEST_M
        and np.abs(pose[3] - [0, 0, 0, 1]).max() < ROTATION_TOLERANCE
    )
