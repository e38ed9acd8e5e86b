"""Where the models of robots lie that are made at run time."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path


def cached_urdf(name: str, text: str) -> Path:
    """A model's text in a file under a name made from its content, so that two processes share it
    and never a wrong one."""
    path = (
        Path(tempfile.gettempdir())
        / f"bewarenav-{name}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.urdf"
    )
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        handle, draft = tempfile.mkstemp(dir=path.parent, suffix=".urdf")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(draft).replace(path)  # whole or not at all: other processes may be reading it
    return path
