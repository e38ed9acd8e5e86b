"""Image and label files; sizes are checked before memory is allocated."""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration, StorageFailed
from navcore.files import read_whole

MAX_SIDE_PX = 8192
MAX_PIXELS = 1 << 25
"""Largest number of pixels of an image, twice 4096 × 4096."""
MAX_FILE_BYTES = 1 << 27
RgbArray = npt.NDArray[np.uint8]
DepthArray = npt.NDArray[np.uint16]
LabelArray = npt.NDArray[np.uint8]
MaskArray = npt.NDArray[np.bool_]
_PNG_START = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
_WITH_ALPHA = b"\x06"
"""Colour type of a PNG with red, green, blue and alpha."""
_JPEG_START = b"\xff\xd8"
_NPY_HEADER_BYTES = 10_000


def read_rgb(path: Path) -> RgbArray:
    """Read (H, W, 3) uint8 RGB from a PNG or JPEG; raises `BadConfiguration` naming the file."""
    return decode_rgb(read_bytes(path), str(path))


def read_depth(path: Path) -> DepthArray:
    """Read (H, W) uint16 in data set units, 0 = not measured, from a 16-bit PNG; raises
    `BadConfiguration`."""
    return decode_depth(read_bytes(path), str(path))


def read_grey(path: Path) -> LabelArray:
    """Read (H, W) uint8 from an 8-bit PNG of one channel; raises `BadConfiguration`."""
    image = _decode(read_bytes(path), str(path), cv2.IMREAD_UNCHANGED)
    if image.dtype != np.uint8 or image.ndim != 2:
        raise BadConfiguration(
            f"{path}: {image.dtype} {image.shape}, expected an 8-bit PNG of one channel"
        )
    return np.asarray(image, dtype=np.uint8)


def decode_rgb(content: bytes, where: str) -> RgbArray:
    """Decode the bytes of a PNG or JPEG to (H, W, 3) uint8 RGB; raises `BadConfiguration` naming
    `where`."""
    image = _decode(content, where, cv2.IMREAD_COLOR)
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def decode_uncoloured(content: bytes, where: str) -> MaskArray | None:
    """Return the transparent pixels (H, W) of the bytes of an image, whose colour is not known;
    None of an image without transparency. Raises `BadConfiguration` naming `where`."""
    if not content.startswith(_PNG_START) or content[25:26] != _WITH_ALPHA:
        return None
    image = _decode(content, where, cv2.IMREAD_UNCHANGED)
    return np.asarray(image[..., 3] == 0) if image.ndim == 3 and image.shape[2] == 4 else None


def decode_depth(content: bytes, where: str) -> DepthArray:
    """Decode the bytes of a 16-bit PNG to (H, W) uint16; raises `BadConfiguration` naming
    `where`."""
    image = _decode(content, where, cv2.IMREAD_UNCHANGED)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise BadConfiguration(
            f"{where}: {image.dtype} {image.shape}, expected depth as a 16-bit PNG of one channel"
        )
    return np.asarray(image, dtype=np.uint16)


def read_labels(path: Path) -> LabelArray:
    """Read labels (H, W) uint8, 0 = void, else class + 1, from a `.npy` of integers; raises
    `BadConfiguration`."""
    try:
        with path.open("rb") as file:
            shape, dtype = _npy_header(file, path)
            if len(shape) != 2 or dtype.kind not in "iu" or not _fits(*shape):
                raise BadConfiguration(
                    f"{path}: {dtype} {shape}, expected labels as whole numbers (height, width)"
                )
            file.seek(0)
            labels: npt.NDArray[np.integer] = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise BadConfiguration(f"{path}: the labels cannot be read: {error!s:.200}") from None
    if labels.dtype != np.uint8 and not 0 <= int(labels.min()) <= int(labels.max()) <= 255:
        raise BadConfiguration(
            f"{path}: labels reach from {labels.min()} to {labels.max()}, expected 0 to 255"
        )
    return np.ascontiguousarray(labels, dtype=np.uint8)


def encode_rgb(
    rgb: RgbArray, *, jpeg_quality: int | None = None, uncoloured: MaskArray | None = None
) -> bytes:
    """Return (H, W, 3) RGB as PNG, or as JPEG of a quality with full colour resolution. Pixels
    (H, W) whose colour is not known are transparent in a PNG."""
    bgr = np.ascontiguousarray(rgb[..., ::-1])
    if uncoloured is not None:
        alpha = np.where(uncoloured, np.uint8(0), np.uint8(255))
        bgr = np.dstack([bgr, alpha])
    if jpeg_quality is None:
        return _encoded(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, 3])
    sampling = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    return _encoded(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality, *sampling])


def encode_grey(image: DepthArray | LabelArray) -> bytes:
    """Return (H, W) as an 8-bit or 16-bit PNG."""
    return _encoded(".png", np.ascontiguousarray(image), [cv2.IMWRITE_PNG_COMPRESSION, 3])


def write_rgb(path: Path, rgb: RgbArray, *, jpeg_quality: int | None = None) -> None:
    """Write what `encode_rgb` returns; raises `StorageFailed`."""
    write_bytes(path, encode_rgb(rgb, jpeg_quality=jpeg_quality))


def write_grey(path: Path, image: DepthArray | LabelArray) -> None:
    """Write what `encode_grey` returns; raises `StorageFailed`."""
    write_bytes(path, encode_grey(image))


def write_bytes(path: Path, content: bytes) -> None:
    """Write the content of an image file; raises `StorageFailed`."""
    try:
        path.write_bytes(content)
    except OSError as error:
        raise StorageFailed(
            f"{path}: the image cannot be written: {error.strerror or error}"
        ) from error


def read_bytes(path: Path) -> bytes:
    """Return the content of an image file; raises `BadConfiguration` if it is missing or too
    large."""
    return read_whole(path, at_most=MAX_FILE_BYTES)


def image_size(content: bytes) -> tuple[int, int] | None:
    """Return (height, width) from the header of a PNG or JPEG; None for anything else."""
    if content.startswith(_PNG_START) and content[12:16] == b"IHDR" and len(content) >= 24:
        width, height = struct.unpack(">II", content[16:24])
        return height, width
    return _jpeg_size(content) if content.startswith(_JPEG_START) else None


def png_size(path: Path) -> tuple[int, int] | None:
    """Return (height, width) of a PNG file; None for any other file, and for one that is missing or
    cut off. Only its beginning and its end are read."""
    try:
        with path.open("rb") as file:
            head = file.read(24)
            file.seek(-len(_PNG_END), os.SEEK_END)
            is_whole = file.read() == _PNG_END
    except OSError:
        return None
    return image_size(head) if head.startswith(_PNG_START) and is_whole else None


def _jpeg_size(content: bytes) -> tuple[int, int] | None:
    """Return (height, width) from the start-of-frame segment of a JPEG."""
    at = 2
    while at + 9 <= len(content) and content[at] == 0xFF:
        marker = content[at + 1]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">HH", content[at + 5 : at + 9])
            return height, width
        at += 1 if marker == 0xFF else 2 + int.from_bytes(content[at + 2 : at + 4], "big")
    return None


def _decode(content: bytes, where: str, flags: int) -> npt.NDArray[np.integer]:
    size = image_size(content)
    if size is None or not _fits(*size):
        said = (
            "it is neither PNG nor JPEG, or cut off"
            if size is None
            else f"it claims {size[0]} × {size[1]} pixels"
        )
        raise BadConfiguration(
            f"{where}: {said}; expected a PNG or JPEG of at most {MAX_PIXELS} pixels"
        )
    try:
        image = cv2.imdecode(
            np.frombuffer(content, np.uint8), flags | cv2.IMREAD_IGNORE_ORIENTATION
        )
    except cv2.error:
        image = None
    if image is None:
        raise BadConfiguration(f"{where}: the image is damaged")
    return image  # type: ignore[return-value]  # cv2's stubs leave floats open


def _fits(height: int, width: int) -> bool:
    return 0 < height <= MAX_SIDE_PX and 0 < width <= MAX_SIDE_PX and height * width <= MAX_PIXELS


def _npy_header(file: BinaryIO, path: Path) -> tuple[tuple[int, ...], np.dtype[np.generic]]:
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(
            file, max_header_size=_NPY_HEADER_BYTES
        )
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(
            file, max_header_size=_NPY_HEADER_BYTES
        )
    else:
        raise BadConfiguration(f"{path}: a .npy file of version {version}, expected 1.0 or 2.0")
    return tuple(shape), dtype


def _encoded(suffix: str, image: npt.NDArray[np.integer], options: list[int]) -> bytes:
    _, content = cv2.imencode(suffix, image, options)
    return content.tobytes()
