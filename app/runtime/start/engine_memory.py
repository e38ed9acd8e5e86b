"""The engine that was chosen for a network on this machine, remembered from one start to the next.

Measuring takes seconds and, on a busy machine, ends differently at every start. So the choice is
kept in the user's cache folder, and made again by `bewarenav doctor`, after an update of an engine,
or when the engine has become too slow. The network that was exported for it is kept beside it:
then a start needs no torch.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import os
import platform
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from navcore.errors import BadConfiguration
from navcore.files import write_whole
from navcore.perception.esanet.inference import network_file
from navcore.perception.esanet.inference.network_file import NetworkFile, open_network
from navcore.perception.esanet.network.preprocess import Size

PACKAGES = ("bewarenav", "torch", "onnx", "onnxruntime", "openvino")
"""Packages whose versions decide which engine is fast."""
FILE = "engines.json"
KEPT_NETWORKS = 4
"""Number of exported networks that are kept, and of compiled ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenEngine:
    """An engine that was chosen by measurement."""

    name: str
    """Engine and precision, e.g. `openvino int8`."""
    p99_ms: float
    """99th percentile of the time per image when it was chosen, milliseconds."""
    smaller: bool
    """Whether smaller images than in training were chosen with it."""
    title: str = ""
    """Title of the network for operators."""


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
                title=str(entry["title"]),
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

    def network(self, key: str, *, known: ChosenEngine, sha256: str) -> NetworkFile | None:
        """Return the exported network that was kept under a key for the engine that is known, with
        the hash of the weights; None without one, and for a damaged one."""
        with suppress(BadConfiguration, OSError):
            file = open_network(self._network_path(key), camera=Size(height=1, width=1))
            # One in eight bits holds the ranges of the convolutions in its layers.
            ranges = () if known.name.endswith("int8") else None
            return dataclasses.replace(file, title=known.title, sha256=sha256, ranges=ranges)
        return None

    def keep_network(self, key: str, onnx: bytes) -> None:
        """Keep an exported network under a key, and the newest of the others."""
        path = self._network_path(key)
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, onnx)
            _keep_newest(path.parent, "*.onnx")

    def compiled(self) -> Path:
        """Return the folder for what engines compile of a network, and keep the newest there."""
        folder = self._file.parent / "compiled"
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            _keep_newest(folder, "*.blob")
        return folder

    def _network_path(self, key: str) -> Path:
        text = f"{key}; {_export_version()}"
        name = hashlib.blake2b(text.encode(), digest_size=8).hexdigest()
        return self._file.parent / "networks" / f"{name}.onnx"

    def _read(self) -> dict[str, Any]:
        with suppress(OSError, ValueError):
            found = json.loads(self._file.read_text(encoding="utf-8"))
            if isinstance(found, dict):
                return found
        return {}


def _keep_newest(folder: Path, pattern: str) -> None:
    kept = sorted(folder.glob(pattern), key=lambda file: file.stat().st_mtime)
    for old in kept[:-KEPT_NETWORKS]:
        old.unlink(missing_ok=True)


@functools.cache
def _export_version() -> str:
    """Return a hash of the program that exports a network."""
    folder = Path(network_file.__file__).parents[1]
    sources = b"".join(file.read_bytes() for file in sorted(folder.rglob("*.py")))
    return hashlib.blake2b(sources, digest_size=8).hexdigest()


def key_of(network: str, *, live: bool, threads: int, camera: tuple[int, int]) -> str:
    """Return the key of a network, by the hash of its file, on this machine with the installed
    versions of the engines; `live` where it must keep up with real time, `camera` the columns and
    rows of its images."""
    versions = []
    for package in PACKAGES:
        with suppress(importlib.metadata.PackageNotFoundError):
            versions.append(f"{package} {importlib.metadata.version(package)}")
    machine = f"{platform.node()}, {platform.machine()}, {os.cpu_count()} processors"
    pace = "real time" if live else "any pace"
    images = "images of {} × {}".format(*camera)
    return "; ".join([machine, network, f"{threads} threads, {pace}, {images}", *versions])
