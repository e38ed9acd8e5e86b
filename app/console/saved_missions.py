"""Missions that are kept under a name."""

from __future__ import annotations

from typing import Any, Protocol

from app.storage.records import goal_of, goal_record
from navcore.errors import NotKnown, Refused
from navcore.mission.mission import Mission
from web.drafts import SavedMission

MAX_MISSIONS = 200
MISSIONS = "mission"


class Shelf(Protocol):
    """Where named things are kept; `app.storage.Store` is one."""

    def kept(self, kind: str) -> dict[str, Any]:
        """Name → JSON value of everything of a kind."""

    def keep(self, kind: str, name: str, value: Any) -> None:
        """Store a JSON value under a name; None forgets it."""


class SavedMissions:
    """Save, look up, forget."""

    def __init__(self, shelf: Shelf) -> None:
        self._shelf = shelf

    def all(self) -> dict[str, SavedMission]:
        """Name → mission."""
        return {
            name: SavedMission(goals=tuple(map(goal_of, record["goals"])), loop=record["loop"])
            for name, record in self._shelf.kept(MISSIONS).items()
        }

    def named(self, name: str) -> SavedMission:
        """One mission; raises `NotKnown`."""
        try:
            return self.all()[name]
        except KeyError:
            raise NotKnown(f"no mission is called {name!r}") from None

    def save(self, name: str, mission: Mission) -> None:
        """Keep a mission's waiting goals."""
        if not mission.queue:
            raise Refused("there is no goal to save; add one first")
        kept = self._shelf.kept(MISSIONS)
        if name not in kept and len(kept) >= MAX_MISSIONS:
            raise Refused(f"at most {MAX_MISSIONS} missions are kept; delete one first")
        self._shelf.keep(
            MISSIONS,
            name,
            {"goals": [goal_record(goal) for goal in mission.queue], "loop": mission.loop},
        )

    def delete(self, name: str) -> None:
        """Forget a mission."""
        self.named(name)
        self._shelf.keep(MISSIONS, name, None)
