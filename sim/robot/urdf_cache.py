"""Temporary files of robot models that are adapted at run time."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path


def cached_urdf(name: str, text: str) -> Path:
    """Return a file with the text of a model; its name is made from the content, so that processes
    share it and never read another model."""
    path = (
        Path(tempfile.gettempdir())
        / f"bewarenav-{name}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.urdf"
    )
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        handle, draft = tempfile.mkstemp(dir=path.parent, suffix=".urdf")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(draft).replace(path)  # atomic: other processes may be reading it
    return path
