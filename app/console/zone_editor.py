"""The operator's zones: checked, stored, then binding; every edit can be undone; sets of them by
name; expiry by the clock."""

from __future__ import annotations

import dataclasses
import logging
import threading
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from app.storage.records import zone_of, zone_record
from navcore.errors import BadGeometry, NotKnown, Outdated, Refused, StorageFailed
from navcore.grid.grid import GridSpec
from navcore.mission.zone import Zone, check_polygon, check_rules
from navcore.mission.zone_shapes import still_drawn
from web.drafts import ZoneDraft, ZoneHistory

MAX_ZONES = 500
MAX_SETS = 50
MAX_UNDO = 100
LONGEST_S = 366 * 24 * 3600.0
SETS = "zone set"
log = logging.getLogger(__name__)


class ZoneShelf(Protocol):
    """Where zones and named things are kept; `app.storage.Store` is one."""

    def change_zones(self, saved: Iterable[Zone], deleted: Iterable[str]) -> None:
        """Store some zones and forget others, all or nothing."""

    def kept(self, kind: str) -> dict[str, Any]:
        """Name → JSON value of everything of a kind, in the order of names."""

    def keep(self, kind: str, name: str, value: Any) -> None:
        """Store a JSON value under a name; None forgets it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Edit:
    """What one step of the operator changed: zones before and after it, by id; None where there was
    none."""

    text: str
    before: Mapping[str, Zone | None]
    after: Mapping[str, Zone | None]


class ZoneEditor:
    """Safe from any thread: one edit at a time, readers see whole tuples."""

    def __init__(
        self,
        zones: tuple[Zone, ...],
        *,
        spec: GridSpec,
        shelf: ZoneShelf,
        bind: Callable[[tuple[Zone, ...]], None],
        calendar_s: Callable[[], float],
        new_id: Callable[[], str] = lambda: uuid.uuid4().hex[:12],
    ) -> None:
        """`bind` lets zones bind the robot; `calendar_s` is the robot's calendar clock, seconds
        since 1970."""
        self._zones, self._spec, self._shelf, self._bind, self._calendar_s = (
            zones,
            spec,
            shelf,
            bind,
            calendar_s,
        )
        self._new_id = new_id
        self._lock = threading.RLock()
        self._newest = {
            zone.id: zone.version
            for zone in (*zones, *(zone for kept in self.sets().values() for zone in kept))
        }
        self._done: list[_Edit] = []
        self._undone: list[_Edit] = []

    @property
    def stored(self) -> tuple[Zone, ...]:
        """All zones, in the order they were first stored."""
        return self._zones

    @property
    def history(self) -> ZoneHistory:
        """What undo and redo would do now."""
        done, undone = self._done, self._undone
        return ZoneHistory(
            undo=done[-1].text if done else None, redo=undone[-1].text if undone else None
        )

    def checked(self, draft: ZoneDraft, *, zone_id: str, version: int) -> Zone:
        """The zone that a draft would make; raises `BadGeometry` with what is wrong."""
        polygon = check_polygon(draft.polygon, self._spec)
        zone = Zone(
            id=zone_id,
            name=draft.name,
            polygon=polygon,
            enabled=draft.enabled,
            margin_m=draft.margin_m,
            version=version,
            kind=draft.kind,
            max_speed_mps=draft.max_speed_mps,
            colour=draft.colour,
            expires_at_s=self._expiry(draft),
            drawn=still_drawn(draft.drawn, polygon),
        )
        check_rules(zone)
        return zone

    def add(self, draft: ZoneDraft) -> Zone:
        """Store a zone, then let it bind the robot."""
        return self._added([draft], f"new zone {draft.name!r}")[0]

    def add_all(self, drafts: Sequence[ZoneDraft]) -> tuple[Zone, ...]:
        """Store many zones as one step; those whose time is over by now are off, as they are where
        they come from."""
        now_s = self._calendar_s()
        drafts = [_as_it_is_by(now_s, draft) for draft in drafts]
        return self._added(
            drafts, f"import of {len(drafts)} {'zone' if len(drafts) == 1 else 'zones'}"
        )

    def _added(self, drafts: Sequence[ZoneDraft], text: str) -> tuple[Zone, ...]:
        with self._lock:
            zones = tuple(
                self.checked(draft, zone_id=self._new_id(), version=1) for draft in drafts
            )
            if len(self._zones) + len(zones) > MAX_ZONES:
                raise Refused(
                    f"at most {MAX_ZONES} zones are kept, there are {len(self._zones)}; delete some first"
                )
            self._step(text, {zone.id: zone for zone in zones})
        return zones

    def replace(
        self, zone_id: str, draft: ZoneDraft, *, expected_version: int | None = None
    ) -> Zone:
        """Change a zone."""
        with self._lock:
            old = self._expected(zone_id, expected_version)
            zone = self.checked(draft, zone_id=zone_id, version=old.version + 1)
            self._step(f"change of {zone.name!r}", {zone_id: zone})
        return zone

    def delete(self, zone_id: str, *, expected_version: int | None = None) -> None:
        """Forget a zone."""
        with self._lock:
            old = self._expected(zone_id, expected_version)
            self._step(f"deletion of {old.name!r}", {zone_id: None})

    def undo(self) -> str:
        """Take the newest edit back; what it was."""
        with self._lock:
            edit = _last(self._done, "undo")
            self._apply(edit.before)
            self._undone.append(self._done.pop())
        return edit.text

    def redo(self) -> str:
        """Do again what was taken back last; what it was."""
        with self._lock:
            edit = _last(self._undone, "redo")
            self._apply(edit.after)
            self._done.append(self._undone.pop())
        return edit.text

    def expire(self) -> None:
        """Switch off what has expired; where the store does not take it, it is tried again the next
        time."""
        if not any(self._expired(zone) for zone in self._zones):
            return
        with self._lock:
            gone = [zone for zone in self._zones if self._expired(zone)]
            try:
                self._apply(
                    {
                        zone.id: dataclasses.replace(zone, enabled=False, expires_at_s=None)
                        for zone in gone
                    }
                )
            except StorageFailed:
                log.exception(
                    "expired zones could not be switched off; they bind the robot until they can"
                )
                return
        for zone in gone:
            log.warning("zone %r has expired and is switched off", zone.name)

    # Named sets

    def sets(self) -> dict[str, tuple[Zone, ...]]:
        """Name → its zones."""
        return {
            name: tuple(map(zone_of, records)) for name, records in self._shelf.kept(SETS).items()
        }

    def save_set(self, name: str) -> None:
        """Keep the present zones under a name, in the place of what had it before; of an expiry,
        how long it is until then."""
        with self._lock:
            kept = self._shelf.kept(SETS)
            if name not in kept and len(kept) >= MAX_SETS:
                raise Refused(f"at most {MAX_SETS} sets are kept; delete one first")
            now_s = self._calendar_s()
            lasting = [
                zone
                if zone.expires_at_s is None
                else dataclasses.replace(zone, expires_at_s=zone.expires_at_s - now_s)
                for zone in self._zones
            ]
            self._shelf.keep(SETS, name, [zone_record(zone) for zone in lasting])

    def use_set(self, name: str) -> None:
        """Let a set's zones bind the robot in the place of the present ones; one step, which can be
        undone."""
        with self._lock:
            wanted = {zone.id: self._counted_from_now(zone) for zone in self._set(name)}
            self._step(f"switch to {name!r}", {**{zone.id: None for zone in self._zones}, **wanted})

    def delete_set(self, name: str) -> None:
        """Forget a set; the present zones stay."""
        with self._lock:
            self._set(name)
            self._shelf.keep(SETS, name, None)

    def _set(self, name: str) -> tuple[Zone, ...]:
        try:
            return self.sets()[name]
        except KeyError:
            raise NotKnown(f"no set of zones is called {name!r}") from None

    # Inside

    def _counted_from_now(self, zone: Zone) -> Zone:
        """A zone of a set, whose expiry says how long it holds; an older set says until when, and
        then it holds for good."""
        if zone.expires_at_s is None:
            return zone
        lasts_s = zone.expires_at_s if 0 < zone.expires_at_s < LONGEST_S else None
        return dataclasses.replace(
            zone, expires_at_s=None if lasts_s is None else self._calendar_s() + lasts_s
        )

    def _expiry(self, draft: ZoneDraft) -> float | None:
        now_s = self._calendar_s()
        at_s = draft.expires_at_s if draft.expires_in_s is None else now_s + draft.expires_in_s
        if at_s is not None and not now_s < at_s < now_s + LONGEST_S:
            raise BadGeometry(
                f"zone {draft.name!r}: its expiry has to lie within the next year; give it anew, or none"
            )
        return at_s

    def _expired(self, zone: Zone) -> bool:
        return zone.expires_at_s is not None and zone.expires_at_s <= self._calendar_s()

    def _expected(self, zone_id: str, version: int | None) -> Zone:
        for zone in self._zones:
            if zone.id == zone_id:
                if version is not None and version != zone.version:
                    raise Outdated(
                        f"zone {zone.name!r} is at version {zone.version}, the edit was made on {version}"
                    )
                return zone
        raise NotKnown(f"no zone has the id {zone_id!r}")

    def _step(self, text: str, after: Mapping[str, Zone | None]) -> None:
        present = {zone.id: zone for zone in self._zones}
        edit = _Edit(
            text=text, before={zone_id: present.get(zone_id) for zone_id in after}, after=after
        )
        self._apply(after)
        self._done = [*self._done[1 - MAX_UNDO :], edit]
        self._undone = []

    def _apply(self, wanted: Mapping[str, Zone | None]) -> None:
        """Store first, bind then: what is refused has changed nothing.

        A version is given once: one who holds an older edit of a zone that went and came back is
        not to be believed.
        """
        present = {zone.id: zone for zone in self._zones}
        saved = {
            zone_id: dataclasses.replace(
                zone, version=max(zone.version, self._newest.get(zone_id, 0) + 1)
            )
            for zone_id, zone in wanted.items()
            if zone is not None
        }
        deleted = [zone_id for zone_id, zone in wanted.items() if zone is None]
        self._shelf.change_zones(saved.values(), deleted)
        self._newest |= {zone_id: zone.version for zone_id, zone in saved.items()}
        merged = {**present, **saved}
        self._zones = tuple(zone for zone_id, zone in merged.items() if zone_id not in deleted)
        self._bind(self._zones)


def _as_it_is_by(now_s: float, draft: ZoneDraft) -> ZoneDraft:
    if draft.expires_at_s is None or draft.expires_in_s is not None or draft.expires_at_s > now_s:
        return draft
    return dataclasses.replace(draft, enabled=False, expires_at_s=None)


def _last(edits: list[_Edit], verb: str) -> _Edit:
    if not edits:
        raise Refused(f"there is no edit of a zone to {verb}")
    return edits[-1]
