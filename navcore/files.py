"""Files that are there in full or not at all: bounded reading, and writing that a crash cannot
tear."""

from __future__ import annotations

import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from navcore.errors import BadConfiguration, StorageFailed


def read_whole(path: Path, *, at_most: int) -> bytes:
    """The bytes of a plain file of at most so many; raises `BadConfiguration` for anything else."""
    try:
        # Opened without waiting, or a pipe of that name would hold us for ever.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise BadConfiguration(f"{path}: not a plain file")
            with open(handle, "rb", closefd=False) as file:
                data = file.read(at_most + 1)
        finally:
            os.close(handle)
    except FileNotFoundError:
        raise BadConfiguration(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise BadConfiguration(f"{path}: not readable: {_words(error)}") from None
    if len(data) > at_most:
        raise BadConfiguration(f"{path}: larger than the {at_most} bytes that are read at most")
    return data


def write_whole(path: Path, data: bytes) -> None:
    """Put a file in place at once and on the disk; raises `StorageFailed`, and then what was there
    before is intact."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except (OSError, ValueError) as error:
        raise StorageFailed(f"{path} cannot be written: {_words(error)}") from None
    draft = Path(name)
    try:
        with open(handle, "wb") as file:  # noqa: PTH123
            file.write(data)
            file.flush()
            os.fchmod(file.fileno(), 0o644)
            os.fsync(file.fileno())
        draft.replace(path)
        _settle(path.parent)
    except OSError as error:
        with suppress(OSError):
            draft.unlink()
        raise StorageFailed(f"{path} cannot be written: {_words(error)}") from None


def _settle(folder: Path) -> None:
    """Have the disk keep the new name too."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _words(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
