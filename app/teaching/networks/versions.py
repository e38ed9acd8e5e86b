"""Versions of the network on disk: one folder each, complete when `version.json` is there."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from app.teaching.json_files import json_of
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.files import read_whole, write_whole
from navcore.toml_config import from_table
from web.interface.teaching import VERSION_NAME as PATTERN
from web.interface.teaching import NetworkVersion

MODEL_NAME, VERSION_NAME, USED_NAME = "model.safetensors", "version.json", "used.json"
MAX_BYTES = 1_000_000
MAX_VERSIONS = 40
"""Number of versions from which none is added: each takes some 20 MB."""
START = "start"
"""Name of the network that the console was started with."""
COLOUR_RULES = "colour rules"
"""What drove without a network, in the history of the networks in use."""


class VersionStore:
    """Folder of versions."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def all(self) -> list[NetworkVersion]:
        """Return the complete versions, oldest first; a damaged one is left out."""
        found = []
        for path in self.folder.glob(f"*/{VERSION_NAME}"):
            try:
                found.append(read_version(path.parent))
            except BadConfiguration:
                continue
        return sorted(found, key=lambda one: (one.created_unix_s or 0.0, one.name))

    def refuse_if_full(self) -> None:
        """Raise `Refused` where no version can be added."""
        if len(self.all()) >= MAX_VERSIONS:
            raise Refused(f"there are {MAX_VERSIONS} versions of the network; delete one first")

    def weights_of(self, name: str) -> Path:
        """Return the weights file of a version; raises `NotKnown`."""
        if name not in {one.name for one in self.all()}:
            raise NotKnown(f"no version of the network is called {name!r:.60}")
        return self.folder / name / MODEL_NAME

    def new_name(self) -> str:
        """Return the name of the next training, `taught 1`, `taught 2`, …"""
        prefix = "taught "
        taken = [path.name.removeprefix(prefix) for path in self.folder.glob(f"{prefix}*")]
        return f"{prefix}{max((int(name) for name in taken if name.isdecimal()), default=0) + 1}"

    def delete(self, name: str) -> None:
        """Delete a version: first its description, so that a crash leaves no half of it listed."""
        folder = self.weights_of(name).parent
        try:
            (folder / VERSION_NAME).unlink()
            shutil.rmtree(folder)
        except OSError as error:
            raise StorageFailed(f"{folder}: cannot be deleted: {error.strerror}") from error

    def used(self) -> list[str]:
        """Return the versions that were in use, the present one last; empty for the network of the
        start."""
        try:
            names = json.loads(read_whole(self.folder / USED_NAME, at_most=MAX_BYTES))
            return [str(name) for name in names]
        except (BadConfiguration, ValueError, TypeError):
            return []

    def history_of(self, names: Sequence[str]) -> list[str]:
        """Return the versions that were in use, the present one last, without those that are gone
        and without a step from one to itself."""
        known = {START, COLOUR_RULES, *(one.name for one in self.all())}
        kept = [*(name for name in names[:-1] if name in known), *names[-1:]]
        return [name for name, _ in groupby(kept)]

    def note_used(self, names: list[str]) -> None:
        """Store the versions that were in use, the present one last."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StorageFailed(f"{self.folder}: cannot be made: {error.strerror}") from error
        write_whole(self.folder / USED_NAME, json.dumps(names).encode())


def check_version_name(name: str) -> None:
    """Raise `BadConfiguration` unless a version can have this name."""
    if not re.fullmatch(PATTERN, name) or name in (START, COLOUR_RULES):
        raise BadConfiguration(
            f"{name!r:.60} cannot be the name of a version; expected up to 40 letters, digits, "
            "blanks, - and _"
        )


def write_version(folder: Path, version: NetworkVersion) -> None:
    """Write the description of a version into its folder, which completes it."""
    write_whole(folder / VERSION_NAME, json_of(version))


def read_version(folder: Path) -> NetworkVersion:
    """Read the description of a version; raises `BadConfiguration`."""
    path = folder / VERSION_NAME
    try:
        table = json.loads(read_whole(path, at_most=MAX_BYTES))
    except (ValueError, RecursionError) as error:
        raise BadConfiguration(f"{path}: not readable: {error!s:.200}") from None
    version = from_table(NetworkVersion, table, str(path))
    if version.name != folder.name or not (folder / MODEL_NAME).is_file():
        raise BadConfiguration(f"{path}: does not belong to the network beside it")
    return version
