"""Opening of zip archives that come from anywhere."""

from __future__ import annotations

import os
import struct
import zipfile
from pathlib import Path
from typing import BinaryIO

from navcore.errors import BadConfiguration

MAX_ENTRIES = 200_000
"""Largest number of files in an archive or folder."""
MAX_DIRECTORY_BYTES = 150 * MAX_ENTRIES
"""Largest size of the central directory of an archive: that of so many entries with usual names."""
MAX_COMMENT_BYTES = 1 << 16
END, LOCATOR64, END64 = (
    struct.Struct("<4s4H2LH"),
    struct.Struct("<4sLQL"),
    struct.Struct("<4sQ2H2L4Q"),
)
"""End of the central directory; for more than a field of it holds ZIP64 has a larger record, and
between both where that is."""
END_MARK, LOCATOR64_MARK, END64_MARK = b"PK\5\6", b"PK\6\7", b"PK\6\6"


def open_zip(source: Path | BinaryIO, what: str) -> zipfile.ZipFile:
    """Open an archive; raises `BadConfiguration`, in which it is called `what`, for one of too many
    entries, and `navcore.files.DAMAGED_ZIP`.

    `zipfile` reads the whole directory, which takes several times its size in memory; so it is
    opened only once the end of the archive has told that this is bounded.
    """
    if isinstance(source, Path):
        with source.open("rb") as file:
            entries, size_bytes = _directory(file)
    else:
        entries, size_bytes = _directory(source)
    if size_bytes > MAX_DIRECTORY_BYTES:
        raise BadConfiguration(
            f"{what}: the list of its files has {size_bytes} bytes, at most {MAX_DIRECTORY_BYTES} "
            "are read"
        )
    _check(entries, what)
    archive = zipfile.ZipFile(source)
    try:
        _check(len(archive.infolist()), what)  # the end of the archive may tell anything
    except BadConfiguration:
        archive.close()
        raise
    return archive


def _check(entries: int, what: str) -> None:
    if entries > MAX_ENTRIES:
        raise BadConfiguration(f"{what}: {entries} entries, at most {MAX_ENTRIES} are read")


def _directory(file: BinaryIO) -> tuple[int, int]:
    """Return the number of entries and the size in bytes of the central directory, as the records
    at the end of an archive tell them: the largest of all that a reader may take; zeros for what
    is no archive."""
    length = file.seek(0, os.SEEK_END)
    start = file.seek(max(0, length - MAX_COMMENT_BYTES - END.size))
    tail = file.read()
    at = tail.rfind(END_MARK)
    if tail[-END.size :].startswith(END_MARK) and tail.endswith(b"\0\0"):
        at = len(tail) - END.size  # without a comment; its fields may hold the mark again
    if at < 0 or len(tail) < at + END.size:
        return 0, 0
    *_, entries, size_bytes, _, _ = END.unpack_from(tail, at)
    for place in _places_of_end64(file, start + at):
        file.seek(place)
        record = file.read(END64.size)
        if len(record) == END64.size and record.startswith(END64_MARK):
            *_, entries64, size64_bytes, _ = END64.unpack(record)
            entries, size_bytes = max(entries, entries64), max(size_bytes, size64_bytes)
    return entries, size_bytes


def _places_of_end64(file: BinaryIO, end: int) -> list[int]:
    """Return where the record of ZIP64 may begin, given the position of that at the end: where
    its locator says, or before that."""
    before = end - LOCATOR64.size
    if before < 0:
        return []
    file.seek(before)
    mark, _, place, _ = LOCATOR64.unpack(file.read(LOCATOR64.size))
    places = (place, before - END64.size) if mark == LOCATOR64_MARK else ()
    return [one for one in places if 0 <= one < end]
