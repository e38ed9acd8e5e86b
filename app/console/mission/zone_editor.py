"""The operator's zones: checked, stored, then in force; undo and redo, named zone sets, expiry."""

from __future__ import annotations

import dataclasses
import logging
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from itertools import zip_longest
from typing import NamedTuple, Protocol

from app.console.edit_history import Edit, EditStack
from app.console.mission.anchored_items import ItemAnchors, Unanchored
from app.console.mission.expiry_dates import ExpiryDates
from app.console.mission.saved_missions import DocumentStore
from app.runtime.control.operator_state import StateHolder
from app.storage.records import zone_of, zone_record
from navcore.errors import AlreadyThere, BadGeometry, NotKnown, Outdated, Refused, StorageFailed
from navcore.mission.anchors import place_of
from navcore.mission.zone import Zone, check_polygon, check_rules
from navcore.mission.zone_shapes import still_drawn
from web.interface.beware import OPERATOR
from web.interface.drafts import EditHistory, ZoneDraft
from web.interface.operations import Existing

MAX_ZONES = 500
MAX_SETS = 50
MAX_NAMED = 5
"""Largest number of zones that a refused import names."""
MAX_LIFETIME_S = 366 * 24 * 3600.0
"""Longest time until the expiry of a zone, seconds."""
SETS = "zone set"
"""Kind of the stored documents."""
log = logging.getLogger(__name__)


class ZoneStore(DocumentStore, Protocol):
    """Storage of zones and of JSON documents; `app.storage.Store` is one."""

    def change_zones(self, saved: Iterable[Zone], deleted: Iterable[str]) -> None:
        """Delete some zones and store others by their id: all or nothing."""


class ZoneWatcher(Protocol):
    """An observer of the zones in force; `app.runtime.record.recorder.Recorder` is one."""

    def watch_zones(self, zones: tuple[Zone, ...]) -> None:
        """Called with all zones whenever they have changed."""


class _Zones(NamedTuple):
    """Zones that an edit changed, by id."""

    before: Mapping[str, Zone | None]
    """As they were; None for a zone that did not exist."""
    after: Mapping[str, Zone | None]
    """As they are; None for a deleted zone."""


class ZoneEditor:
    """Satisfies the console's port `ZoneEdits`. Safe from any thread: one edit at a time."""

    def __init__(
        self,
        holder: StateHolder,
        *,
        store: ZoneStore,
        watcher: ZoneWatcher | None = None,
        dates: ExpiryDates | None = None,
        anchors: ItemAnchors | None = None,
        new_id: Callable[[], str] = lambda: uuid.uuid4().hex[:12],
        number: Callable[[], int] | None = None,
    ) -> None:
        """`dates`: when zones expire; one for the editors of all sites, so that a zone that was
        drawn for some time keeps it. `anchors`: how zones follow the map; None to leave them where
        they are. `number` counts the edits of all kinds."""
        self._holder, self._store, self._watcher = holder, store, watcher
        self._dates, self._new_id = dates or ExpiryDates(), new_id
        self._anchors = anchors or Unanchored()
        self._edits = EditStack[_Zones](number=number)
        saved = (zone for zones in self.sets().values() for zone in zones)
        self._versions = {zone.id: zone.version for zone in (*self.stored, *saved)}
        self._unstored = frozenset[str]()  # ids of zones that moved while the store refused
        self._changes = 0

    def retired(self) -> AbstractContextManager[None]:
        """Refuse every edit from now on, unless the block fails; no edit is halfway within it."""
        return self._edits.retired()

    @property
    def stored(self) -> tuple[Zone, ...]:
        """All zones, in the order in which they were first stored."""
        return self._holder.intent.zones

    @property
    def changes(self) -> int:
        """Number of changes since the start of the console."""
        return self._changes

    @property
    def history(self) -> EditHistory:
        """Descriptions of the next undo and redo."""
        return self._edits.history

    def checked(self, draft: ZoneDraft, *, zone_id: str, version: int) -> Zone:
        """Return the zone of a draft; raises `BadGeometry` with what is wrong."""
        polygon = check_polygon(draft.polygon)
        zone = dataclasses.replace(
            Zone.of(draft, zone_id=zone_id, version=version),
            polygon=polygon,
            expires_at_s=self._expiry(draft),
            drawn=still_drawn(draft.drawn, polygon),
        )
        check_rules(zone)
        return zone

    def add(self, draft: ZoneDraft) -> Zone:
        """Store a zone and put it in force."""
        return self._add([draft], f"new zone {draft.name!r}")[0]

    def add_all(self, drafts: Sequence[ZoneDraft], existing: Existing = "keep") -> tuple[Zone, ...]:
        """Store many zones as one step; an expired zone is stored switched off."""
        now_s = self._dates.calendar_s()
        with self._edits.editing():
            drafts = [_expired_off(now_s, draft) for draft in drafts]
            for draft in drafts:  # a wrong zone is refused before the operator is asked
                self.checked(draft, zone_id="", version=1)
            there = [self._same_outline(draft) for draft in drafts]
            known = tuple(zone.name for zone in there if zone is not None)
            if known and existing == "ask":
                raise AlreadyThere(_how_many_there(len(drafts), known), known)
            if existing == "skip":
                drafts = [draft for draft, zone in zip(drafts, there, strict=True) if zone is None]
            text = f"import of {len(drafts)} {'zone' if len(drafts) == 1 else 'zones'}"
            ids = [zone.id if zone else None for zone in there] if existing == "replace" else []
            return self._add(drafts, text, ids) if drafts else ()

    def _same_outline(self, draft: ZoneDraft) -> Zone | None:
        """Return the stored zone with the outline of a draft; None without one."""
        ring = [(round(x, 3), round(y, 3)) for x, y in draft.polygon]
        ring = ring[:-1] if len(ring) > 1 and ring[0] == ring[-1] else ring
        return next(
            (
                zone
                for zone in self.stored
                if [(round(x, 3), round(y, 3)) for x, y in zone.polygon] == ring
            ),
            None,
        )

    def _add(
        self, drafts: Sequence[ZoneDraft], text: str, ids: Sequence[str | None] = ()
    ) -> tuple[Zone, ...]:
        """Store zones under the ids that are given, else under new ones."""
        with self._edits.editing():
            zones = tuple(
                self.checked(draft, zone_id=zone_id or self._new_id(), version=1)
                for draft, zone_id in zip_longest(drafts, ids)
            )
            if len({zone.id for zone in (*self.stored, *zones)}) > MAX_ZONES:
                raise Refused(
                    f"at most {MAX_ZONES} zones are kept, there are {len(self.stored)}; "
                    "delete some first"
                )
            self._step(text, {zone.id: zone for zone in zones})
        return zones

    def replace(
        self, zone_id: str, draft: ZoneDraft, *, expected_version: int | None = None
    ) -> Zone:
        """Change a zone."""
        with self._edits.editing():
            old = self._expected(zone_id, expected_version)
            zone = self.checked(draft, zone_id=zone_id, version=old.version + 1)
            self._step(f"change of {zone.name!r}", {zone_id: zone})
        return zone

    def move(self, placed: Callable[[Zone], Zone]) -> tuple[tuple[Zone, Zone], ...]:
        """Move zones because the map was corrected, which is no step that can be undone; return
        each that moved, as it was and as it is.

        `placed` returns any zone where the correction has it: undone and repeated edits bring zones
        back there, too. The zones move even if the store refuses; `expire` tries that again.
        """
        with self._edits.editing():
            moved = tuple(
                (zone, there) for zone in self.stored if (there := placed(zone)) is not zone
            )
            if moved:
                self._apply(
                    {
                        zone.id: dataclasses.replace(there, version=zone.version + 1)
                        for zone, there in moved
                    },
                    even_unstored=True,
                )
            self._edits.follow(_each(placed))
        return moved

    def anchor(self, anchored: Callable[[Zone], Zone]) -> None:
        """Give zones the anchors with which `anchored` returns them, also if the store refuses;
        `expire` tries that again."""
        with self._edits.editing():
            before = self.stored
            zones = tuple(map(anchored, before))
            self._holder.change(lambda state: dataclasses.replace(state, zones=zones))
            self._edits.follow(_each(anchored))
            new = [
                zone
                for zone, old in zip(zones, before, strict=True)
                if zone is not old and zone.anchors[0].poses
            ]
            try:
                self._store.change_zones(new, [])
            except StorageFailed:
                log.exception("the poses that zones belong to are not stored yet")
                self._unstored |= {zone.id for zone in new}

    def delete(self, zone_id: str, *, expected_version: int | None = None) -> None:
        """Delete a zone."""
        with self._edits.editing():
            old = self._expected(zone_id, expected_version)
            self._step(f"deletion of {old.name!r}", {zone_id: None})

    def undo(self, *, by: str = OPERATOR, number: int | None = None) -> str:
        """Undo the newest edit and return its description; only the audit log keeps who did it."""
        return self._edits.undo(lambda edit: self._apply(edit.step.before), number=number)

    def redo(self, *, by: str = OPERATOR) -> str:
        """Repeat the edit that was undone last and return its description."""
        return self._edits.redo(self._repeat)

    def _repeat(self, edit: Edit[_Zones]) -> _Zones:
        self._apply(edit.step.after)
        return edit.step

    def expire(self) -> None:
        """Switch off expired zones, store those that moved while the store refused, and give the
        others their dates by the calendar clock, which holds over a restart, where that was set.
        Raises `StorageFailed` when the store refuses; the next call tries again."""
        if not self._unstored and all(self._aged(zone) is zone for zone in self.stored):
            return
        with self._edits.editing():
            aged = [(zone, self._aged(zone)) for zone in self.stored]
            self._apply({zone.id: now for zone, now in aged if now is not zone})
        expired = [zone for zone, now in aged if zone.enabled and not now.enabled]
        for zone in expired:
            log.warning("zone %r has expired and is switched off", zone.name)

    # Named sets

    def sets(self) -> dict[str, tuple[Zone, ...]]:
        """Return the zone sets by name."""
        documents = self._store.documents(SETS)
        placed = self._anchors.placed
        return {
            name: tuple(placed(zone_of(record)) for record in records)
            for name, records in documents.items()
        }

    def save_set(self, name: str, *, replace: bool = True) -> None:
        """Save the present zones under a name; `AlreadyThere` for the name of a set unless it is to
        be replaced.

        A set stores the remaining time of a zone in `expires_at_s`, not the date of its expiry.
        """
        with self._edits.editing():
            saved = self._store.documents(SETS)
            if name in saved and not replace:
                zones = len(saved[name])
                raise AlreadyThere(
                    f"a set of zones is called “{name}” already, with {zones} "
                    f"{'zone' if zones == 1 else 'zones'}; replace it, or give another name",
                    (name,),
                )
            if name not in saved and len(saved) >= MAX_SETS:
                raise Refused(f"at most {MAX_SETS} sets are kept; delete one first")
            lasting = [
                zone
                if zone.expires_at_s is None
                else dataclasses.replace(zone, expires_at_s=self._dates.left_s(zone.expires_at_s))
                for zone in self.stored
            ]
            anchored = map(self._anchors.anchored, lasting)
            self._store.save_document(SETS, name, [zone_record(zone) for zone in anchored])

    def use_set(self, name: str) -> None:
        """Replace the present zones by those of a set, as one step that can be undone."""
        with self._edits.editing():
            wanted = {zone.id: self._from_now(zone) for zone in self._set(name)}
            self._step(f"switch to {name!r}", {**{zone.id: None for zone in self.stored}, **wanted})

    def delete_set(self, name: str) -> None:
        """Delete a set; the present zones stay."""
        with self._edits.editing():
            self._set(name)
            self._store.save_document(SETS, name, None)

    def _set(self, name: str) -> tuple[Zone, ...]:
        try:
            return self.sets()[name]
        except KeyError:
            raise NotKnown(f"no set of zones is called {name!r}") from None

    # Inside

    def _from_now(self, zone: Zone) -> Zone:
        """Return a zone of a set with its expiry counted from now."""
        if zone.expires_at_s is None:
            return zone
        return dataclasses.replace(zone, expires_at_s=self._dates.after(zone.expires_at_s))

    def _expiry(self, draft: ZoneDraft) -> float | None:
        at_s = draft.expires_at_s
        if draft.expires_in_s is not None:
            at_s = self._dates.after(draft.expires_in_s)
        if at_s is not None and not 0.0 < self._dates.left_s(at_s) < MAX_LIFETIME_S:
            raise BadGeometry(
                f"zone {draft.name!r}: its expiry has to be within the next year; "
                "give another one, or none"
            )
        return at_s

    def _aged(self, zone: Zone) -> Zone:
        """Return a zone as it is now: switched off if it has expired, else with its date by the
        calendar clock; the same object where nothing has changed."""
        if zone.expires_at_s is None:
            return zone
        if self._dates.left_s(zone.expires_at_s) <= 0.0:
            return dataclasses.replace(zone, enabled=False, expires_at_s=None)
        at_s = self._dates.by_calendar(zone.expires_at_s)
        return zone if at_s == zone.expires_at_s else dataclasses.replace(zone, expires_at_s=at_s)

    def _expected(self, zone_id: str, version: int | None) -> Zone:
        for zone in self.stored:
            if zone.id == zone_id:
                if version is not None and version != zone.version:
                    raise Outdated(
                        f"zone {zone.name!r} is at version {zone.version}, "
                        f"the edit was made on {version}"
                    )
                return zone
        raise NotKnown(f"no zone has the id {zone_id!r}")

    def _step(self, text: str, after: Mapping[str, Zone | None]) -> None:
        present = {zone.id: zone for zone in self.stored}
        before = {zone_id: present.get(zone_id) for zone_id in after}
        after = {
            zone_id: None if zone is None else self._anchored(zone, before[zone_id])
            for zone_id, zone in after.items()
        }
        self._apply(after)
        self._edits.add(text, _Zones(before, after))

    def _anchored(self, zone: Zone, before: Zone | None) -> Zone:
        """Return a zone with its anchor: that of before, where it has stayed in its place."""
        if before is not None and place_of(before) == place_of(zone):
            zone = dataclasses.replace(zone, anchors=before.anchors)
        return self._anchors.anchored(zone)

    def _apply(self, wanted: Mapping[str, Zone | None], *, even_unstored: bool = False) -> None:
        """Store zones, then put them in force: a refusal has changed nothing, unless they are to
        be in force `even_unstored`.

        No version number is used twice, so that an edit of an outdated version is recognised even
        when the zone was deleted and restored in between.
        """
        present = {zone.id: zone for zone in self.stored}
        saved = {
            zone_id: dataclasses.replace(
                zone, version=max(zone.version, self._versions.get(zone_id, 0) + 1)
            )
            for zone_id, zone in wanted.items()
            if zone is not None
        }
        deleted = [zone_id for zone_id, zone in wanted.items() if zone is None]
        waiting = {
            zone_id: present[zone_id] for zone_id in self._unstored - wanted.keys() & present.keys()
        }
        try:
            self._store.change_zones([*waiting.values(), *saved.values()], deleted)
            self._unstored = frozenset()
        except StorageFailed:
            if not even_unstored:
                raise
            log.exception("zones that moved with the map are in force, but not stored yet")
            self._unstored |= saved.keys()
        self._versions |= {zone_id: zone.version for zone_id, zone in saved.items()}
        merged = {**present, **saved}
        zones = tuple(zone for zone_id, zone in merged.items() if zone_id not in deleted)
        self._holder.change(lambda state: dataclasses.replace(state, zones=zones))
        self._changes += 1
        if self._watcher is not None:
            self._watcher.watch_zones(zones)


def _each(change: Callable[[Zone], Zone]) -> Callable[[_Zones], _Zones]:
    """Return the edit whose zones are changed, for one."""

    def changed(zones: Mapping[str, Zone | None]) -> dict[str, Zone | None]:
        return {zone_id: None if zone is None else change(zone) for zone_id, zone in zones.items()}

    return lambda step: _Zones(changed(step.before), changed(step.after))


def _expired_off(now_s: float, draft: ZoneDraft) -> ZoneDraft:
    """Return a draft switched off if it has expired."""
    if draft.expires_at_s is None or draft.expires_in_s is not None or draft.expires_at_s > now_s:
        return draft
    return dataclasses.replace(draft, enabled=False, expires_at_s=None)


def _how_many_there(count: int, known: Sequence[str]) -> str:
    """Return how many zones of a file are there already, and which."""
    names = ", ".join(f"“{name}”" for name in known[:MAX_NAMED])
    more = f" and {len(known) - MAX_NAMED} more" if len(known) > MAX_NAMED else ""
    zones, are = "zone" if count == 1 else "zones", "is" if len(known) == 1 else "are"
    return f"{count} {zones}: {len(known)} {are} here already ({names}{more})"
