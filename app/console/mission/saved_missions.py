"""Missions saved under a name."""

from __future__ import annotations

from typing import Any, Protocol

from app.storage.records import goal_of, goal_record
from navcore.errors import AlreadyThere, NotKnown, Refused
from navcore.mission.mission import Mission
from web.interface.drafts import SavedMission

MAX_MISSIONS = 200
MISSIONS = "mission"
"""Kind of the stored documents."""


class DocumentStore(Protocol):
    """Storage of JSON documents by kind and name; `app.storage.Store` is one."""

    def documents(self, kind: str) -> dict[str, Any]:
        """Return the JSON documents of a kind by name, sorted by name."""

    def save_document(self, kind: str, name: str, value: Any) -> None:
        """Store a JSON document under a name; None deletes it."""


class SavedMissions:
    """The saved missions of a store."""

    def __init__(self, store: DocumentStore) -> None:
        self._store = store

    def all(self) -> dict[str, SavedMission]:
        """Return all missions by name."""
        return {
            name: SavedMission(goals=tuple(map(goal_of, record["goals"])), loop=record["loop"])
            for name, record in self._store.documents(MISSIONS).items()
        }

    def named(self, name: str) -> SavedMission:
        """Return one mission; raises `NotKnown`."""
        try:
            return self.all()[name]
        except KeyError:
            raise NotKnown(f"no mission is called {name!r}") from None

    def save(self, name: str, mission: Mission, *, replace: bool) -> None:
        """Save the waiting goals of a mission; raises `AlreadyThere`."""
        if not mission.queue:
            raise Refused("there is no goal to save; add one first")
        saved = self._store.documents(MISSIONS)
        if name in saved and not replace:
            goals = len(saved[name]["goals"])
            raise AlreadyThere(
                f"a mission is called “{name}” already, with {goals} "
                f"{'goal' if goals == 1 else 'goals'}; replace it, or give another name",
                (name,),
            )
        if name not in saved and len(saved) >= MAX_MISSIONS:
            raise Refused(f"at most {MAX_MISSIONS} missions are kept; delete one first")
        self._store.save_document(
            MISSIONS,
            name,
            {"goals": [goal_record(goal) for goal in mission.queue], "loop": mission.loop},
        )

    def delete(self, name: str) -> None:
        """Delete a mission; raises `NotKnown`."""
        self.named(name)
        self._store.save_document(MISSIONS, name, None)
