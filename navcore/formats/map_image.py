"""Map images: PGM (P2, P5) and PNG from bytes and back, with every pixel value preserved."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration

Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]

MAX_SIDE, MAX_PIXELS = 65_000, 1 << 26
"""Largest side and number of pixels; the path planner can search 64 Mi cells."""
MAX_BYTES = 1 << 28
"""Largest file that is read, in bytes."""
_GAP = rb"(?:\s|#[^\n]*\n)+"
_HEADER = re.compile(rb"P([25])" + 3 * (_GAP + rb"(\d{1,9})") + rb"\s")
_PNG = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapImage:
    """Image as it is stored."""

    pixels: Pixels
    """(rows, cols) grey, (rows, cols, 3) blue, green, red or (rows, cols, 4) with opacity; row 0 is
    at the top."""
    white: int
    """Value of white in a channel: 255, 65535, or the maximum value that a PGM declares."""

    @property
    def suffix(self) -> str:
        """File suffix: `.pgm` for grey images, `.png` for others, which a PGM cannot hold."""
        return ".pgm" if self.pixels.ndim == 2 else ".png"


def decode(data: bytes, where: str) -> MapImage:
    """Return the image of a file's contents, whatever its name; raises `BadConfiguration`, in which
    `where` names the file."""
    if data.startswith((b"P2", b"P5")):
        image = _decode_pgm(data, where)
    elif data.startswith(_PNG):
        image = _decode_png(data, where)
    else:
        raise BadConfiguration(f"{where}: neither PGM (P2 or P5) nor PNG")
    image.pixels.flags.writeable = False
    return image


def encode(image: MapImage) -> bytes:
    """Return the contents of a file with the image: binary PGM for grey pixels, PNG for colour."""
    if image.pixels.ndim == 2:
        rows, cols = image.pixels.shape
        return (
            f"P5\n{cols} {rows}\n{image.white}\n".encode()
            + image.pixels.astype(_stored_type(image.white)).tobytes()
        )
    _, data = cv2.imencode(".png", image.pixels)
    return data.tobytes()


def _decode_pgm(data: bytes, where: str) -> MapImage:
    header = _HEADER.match(data)
    if header is None:
        raise BadConfiguration(
            f"{where}: the PGM header is invalid; expected P5, columns, rows and the value of white"
        )
    cols, rows, white = (int(number) for number in header.groups()[1:])
    _check_size(rows, cols, where)
    if not 1 <= white <= 65535:
        raise BadConfiguration(f"{where}: the value of white is {white}, allowed 1 to 65535")
    raster = data[header.end() :]
    values = (
        _binary(raster, rows * cols, white, where)
        if header[1] == b"5"
        else _plain(raster, rows * cols, where)
    )
    if values.size and int(values.max()) > white:
        raise BadConfiguration(
            f"{where}: a pixel has the value {int(values.max())}, white is {white}"
        )
    pixels: Pixels = values.astype(np.uint8) if white < 256 else values.astype(np.uint16)
    return MapImage(pixels=pixels.reshape(rows, cols), white=white)


def _binary(raster: bytes, count: int, white: int, where: str) -> npt.NDArray[np.integer]:
    kind = np.dtype(_stored_type(white))
    size = count * kind.itemsize
    if len(raster) < size or raster[size:].strip():
        raise BadConfiguration(f"{where}: expected {size} bytes of pixels, got {len(raster)}")
    return np.frombuffer(raster, dtype=kind, count=count)


def _plain(raster: bytes, count: int, where: str) -> npt.NDArray[np.integer]:
    text = re.sub(rb"#[^\n]*", b"", raster)
    if re.fullmatch(rb"[\d\s]*", text) is None:
        raise BadConfiguration(f"{where}: a plain PGM (P2) has numbers only, this one does not")
    values = (
        np.fromstring(text, dtype=np.int64, sep=" ")
        if text.strip()
        else np.empty(0, dtype=np.int64)
    )
    if len(values) != count:
        raise BadConfiguration(f"{where}: expected {count} pixels, got {len(values)}")
    return values


def _stored_type(white: int) -> str:
    return "u1" if white < 256 else ">u2"


def _decode_png(data: bytes, where: str) -> MapImage:
    _check_chunks(data, where)
    cols, rows = struct.unpack(">II", data[16:24])
    _check_size(rows, cols, where)
    # One, two and four bits a pixel are decoded as eight.
    pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.shape[:2] != (rows, cols):
        raise BadConfiguration(f"{where}: the PNG cannot be read")
    wide = pixels.dtype == np.uint16
    kept: Pixels = pixels.astype(np.uint16) if wide else pixels.astype(np.uint8)
    return MapImage(pixels=kept, white=65535 if wide else 255)


def _check_chunks(data: bytes, where: str) -> None:
    """Raise `BadConfiguration` unless the PNG is complete from IHDR to IEND with valid checksums;
    OpenCV would decode a truncated file."""
    at, kind = len(_PNG), b""
    while kind != b"IEND":
        length = int.from_bytes(data[at : at + 4], "big")
        kind, body_end = data[at + 4 : at + 8], at + 8 + length
        if body_end + 4 > len(data) or (at == len(_PNG) and (kind != b"IHDR" or length != 13)):
            raise BadConfiguration(f"{where}: the PNG is truncated after {len(data)} bytes")
        if zlib.crc32(data[at + 4 : body_end]) != int.from_bytes(
            data[body_end : body_end + 4], "big"
        ):
            raise BadConfiguration(
                f"{where}: the PNG is damaged: the checksum of a part ({kind!r}) is wrong"
            )
        at = body_end + 4


def _check_size(rows: int, cols: int, where: str) -> None:
    if not (1 <= rows <= MAX_SIDE and 1 <= cols <= MAX_SIDE and rows * cols <= MAX_PIXELS):
        raise BadConfiguration(
            f"{where}: {cols} × {rows} pixels; allowed are sides of 1 to {MAX_SIDE} and at most "
            f"{MAX_PIXELS} pixels"
        )
