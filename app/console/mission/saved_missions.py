"""Missions saved under a name."""

from __future__ import annotations

import threading
from typing import Any, Protocol

from app.console.mission.anchored_items import ItemAnchors, Unanchored
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
    """The saved missions of a store. Safe from any thread: one change at a time."""

    def __init__(self, store: DocumentStore, anchors: ItemAnchors | None = None) -> None:
        """`anchors`: how goals follow the map; None to leave them where they are."""
        self._store, self._changing = store, threading.Lock()
        self._anchors = anchors or Unanchored()

    def all(self) -> dict[str, SavedMission]:
        """Return all missions by name."""
        return {
            name: SavedMission(
                goals=tuple(self._anchors.placed(goal_of(goal)) for goal in record["goals"]),
                loop=record["loop"],
            )
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
        with self._changing:
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
            records = [goal_record(self._anchors.anchored(goal)) for goal in mission.queue]
            self._store.save_document(MISSIONS, name, {"goals": records, "loop": mission.loop})

    def delete(self, name: str) -> None:
        """Delete a mission; raises `NotKnown`."""
        with self._changing:
            self.named(name)
            self._store.save_document(MISSIONS, name, None)
