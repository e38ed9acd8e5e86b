"""The engine that was chosen for a network on this machine, remembered from one start to the next.

Measuring takes seconds and, on a busy machine, ends differently at every start. So the choice is
kept in the user's cache folder, and made again by `bewarenav doctor`, after an update of an engine,
or when the engine has become too slow.
"""

from __future__ import annotations

import dataclasses
import importlib.metadata
import json
import os
import platform
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PACKAGES = ("bewarenav", "torch", "onnx", "onnxruntime", "openvino")
"""Packages whose versions decide which engine is fast."""
FILE = "engines.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenEngine:
    """An engine that was chosen by measurement."""

    name: str
    """Engine and precision, e.g. `openvino int8`."""
    p99_ms: float
    """99th percentile of the time per image when it was chosen, milliseconds."""
    smaller: bool
    """Whether smaller images than in training were chosen with it."""


class EngineMemory:
    """The chosen engines of a file; an unreadable file counts as empty, and one that cannot be
    written is left alone: everything is measured again then."""

    def __init__(self, file: Path) -> None:
        self._file = file

    @staticmethod
    def of_user() -> EngineMemory:
        """Return the memory in `$BEWARENAV_CACHE`, by default `bewarenav` in the user's cache
        folder, `$XDG_CACHE_HOME` or `~/.cache`."""
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        return EngineMemory(Path(os.environ.get("BEWARENAV_CACHE") or cache / "bewarenav") / FILE)

    def recall(self, key: str) -> ChosenEngine | None:
        """Return the engine that was remembered under a key; None without one."""
        with suppress(KeyError, TypeError, ValueError):
            entry = self._read()[key]
            return ChosenEngine(
                name=str(entry["name"]),
                p99_ms=float(entry["p99_ms"]),
                smaller=bool(entry["smaller"]),
            )
        return None

    def remember(self, key: str, engine: ChosenEngine) -> None:
        """Keep an engine under a key, in place of an earlier one."""
        entries = {**self._read(), key: dataclasses.asdict(engine)}
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            new = self._file.with_name(f"{FILE}.{os.getpid()}")
            new.write_text(json.dumps(entries, indent=1), encoding="utf-8")
            new.replace(self._file)

    def _read(self) -> dict[str, Any]:
        with suppress(OSError, ValueError):
            found = json.loads(self._file.read_text(encoding="utf-8"))
            if isinstance(found, dict):
                return found
        return {}


def key_of(network: str, *, live: bool, threads: int) -> str:
    """Return the key of a network, by the hash of its file, on this machine with the installed
    versions of the engines; `live` where it must keep up with real time."""
    versions = []
    for package in PACKAGES:
        with suppress(importlib.metadata.PackageNotFoundError):
            versions.append(f"{package} {importlib.metadata.version(package)}")
    machine = f"{platform.node()}, {platform.machine()}, {os.cpu_count()} processors"
    pace = "real time" if live else "any pace"
    return "; ".join([machine, network, f"{threads} threads, {pace}", *versions])
