"""Store of the small robot behind the console."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone
from tests.app.console.state import summary_of
from web.interface.beware import BewareVersion, BewareVersionSummary


class MemoryStore:
    """Store in memory."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, str], str] = {}
        self._lists: list[BewareVersion] = []

    def change_zones(self, saved: Iterable[Zone], deleted: Iterable[str]) -> None:
        """Do nothing: the editor keeps the zones."""

    def beware(self) -> BewareList | None:
        """Implement the store."""
        return self._lists[-1].list if self._lists else None

    def beware_versions(self, *, limit: int = 1000) -> tuple[BewareVersion, ...]:
        """Implement the store."""
        return tuple(self._lists[::-1][:limit])

    def beware_summaries(self) -> tuple[BewareVersionSummary, ...]:
        """Implement the store."""
        return tuple(map(summary_of, self._lists[::-1]))

    def beware_version(self, version: int) -> BewareVersion | None:
        """Implement the store."""
        return next((one for one in self._lists[::-1] if one.list.version == version), None)

    def save_beware(self, beware: BewareList, *, unix_s: float, by: str, what: str) -> None:
        """Implement the store."""
        self._lists.append(BewareVersion(list=beware, unix_s=unix_s, by=by, what=what))

    def documents(self, kind: str) -> dict[str, Any]:
        """Implement the store."""
        return {
            name: json.loads(value)
            for (of, name), value in sorted(self._kept.items())
            if of == kind
        }

    def save_document(self, kind: str, name: str, value: Any) -> None:
        """Implement the store."""
        self._kept[kind, name] = json.dumps(value)
        if value is None:
            del self._kept[kind, name]
