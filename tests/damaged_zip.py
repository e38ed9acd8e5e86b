"""Zip archives whose streams are damaged."""

from __future__ import annotations

import io
import zipfile

METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
LOCAL_HEADER_BYTES = 30
LZMA_PROPERTIES_BYTES = 9
"""Beginning of a stream of LZMA, which is left as it is."""


def with_damaged_entry(archive: bytes, name: str, method: int) -> bytes:
    """Return an archive packed by a method of `zipfile`, in which the stream of one entry
    is overwritten."""
    content = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(archive)) as old, zipfile.ZipFile(content, "w", method) as new:
        for entry in old.infolist():
            new.writestr(entry.filename, old.read(entry))
        stream = new.getinfo(name)
    damaged = bytearray(content.getvalue())
    begin = stream.header_offset + LOCAL_HEADER_BYTES + len(name)
    end = begin + stream.compress_size
    begin += LZMA_PROPERTIES_BYTES if method == zipfile.ZIP_LZMA else 0
    damaged[begin:end] = b"\xff" * (end - begin)
    return bytes(damaged)
