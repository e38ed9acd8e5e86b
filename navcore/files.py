"""Bounded reading and atomic writing of files."""

from __future__ import annotations

import glob
import lzma
import os
import shutil
import stat
import tempfile
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path

from navcore.errors import BadConfiguration, StorageFailed

DAMAGED_ZIP = (
    OSError,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    ValueError,
    OverflowError,
    RuntimeError,
)
"""What is raised where a zip archive that comes from anywhere is opened and read."""


def read_whole(path: Path, *, at_most: int) -> bytes:
    """Return the contents of a regular file of at most `at_most` bytes; raises `BadConfiguration`
    for anything else."""
    try:
        # Opened without blocking: a pipe of that name would block for ever.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise BadConfiguration(f"{path}: not a regular file")
            with open(handle, "rb", closefd=False) as file:
                data = file.read(at_most + 1)
        finally:
            os.close(handle)
    except FileNotFoundError:
        raise BadConfiguration(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise BadConfiguration(f"{path}: not readable: {_reason(error)}") from None
    if len(data) > at_most:
        raise BadConfiguration(f"{path}: larger than the allowed {at_most} bytes")
    return data


def is_there(path: Path) -> bool:
    """Return whether a file or folder exists; raises `BadConfiguration` where that cannot be told,
    as in a folder that may not be entered."""
    try:
        return path.exists()
    except (OSError, ValueError) as error:
        raise BadConfiguration(f"{path}: not readable: {_reason(error)}") from None


def write_whole(path: Path, data: bytes) -> None:
    """Write a file atomically and durably; raises `StorageFailed`, and then an older file is
    intact."""
    try:
        handle, name = tempfile.mkstemp(prefix=_draft(path), dir=path.parent)
    except (OSError, ValueError) as error:
        raise StorageFailed(f"{path} cannot be written: {_reason(error)}") from None
    draft = Path(name)
    try:
        with open(handle, "wb") as file:  # noqa: PTH123
            file.write(data)
            file.flush()
            os.fchmod(file.fileno(), 0o644)
            os.fsync(file.fileno())
        draft.replace(path)
        sync_folder(path.parent)
    except BaseException as error:
        with suppress(OSError):
            draft.unlink()
        if isinstance(error, OSError):
            raise StorageFailed(f"{path} cannot be written: {_reason(error)}") from None
        raise


def remove_drafts(path: Path) -> None:
    """Delete what `write_whole` has left of a file where its process was killed. For a process that
    alone writes the file; what fails is left to the next time."""
    for draft in path.parent.glob(f"{glob.escape(_draft(path))}*"):
        with suppress(OSError):
            draft.unlink()


def link_or_copy(source: Path, target: Path) -> None:
    """Give a file a further name, or copy it where the file system has no links; raises
    `OSError`."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def sync_folder(folder: Path) -> None:
    """Make the new name durable too."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _draft(path: Path) -> str:
    """Return how the name of a file begins that is to replace another one: no user's does."""
    return f".{path.name}.bewarenav-draft-"


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
