"""Temporary files of robot models that are adapted at run time."""

from __future__ import annotations

import hashlib
import tempfile
from pathlib import Path

from navcore.files import write_whole


def cached_urdf(name: str, text: str) -> Path:
    """Return a file with the text of a model; its name is made from the content, so that processes
    and users share it and never read another model. Raises `StorageFailed`."""
    path = (
        Path(tempfile.gettempdir())
        / f"bewarenav-{name}-{hashlib.sha256(text.encode()).hexdigest()[:24]}.urdf"
    )
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        write_whole(path, text.encode())  # other processes may be reading it
    return path
