"""The operator's edits of the beware list: checked, stored, then in force; every edit can be
undone, and every stored version comes back."""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

from app.console.edit_history import MAX_UNDO, Edit, EditStack
from app.runtime.control.operator_state import StateHolder
from navcore.errors import BadConfiguration, NeedsForce, NotKnown, Outdated
from navcore.mapping.points.erasing import Erased
from navcore.mission.beware_changes import changes_between
from navcore.mission.beware_list import (
    BewareClass,
    BewareList,
    default_beware_list,
    parse_beware_list,
)
from navcore.mission.beware_sets import ready_made
from navcore.perception.labels import LabelSource, Segmenter
from web.interface.beware import (
    OPERATOR,
    BewareDraft,
    BewareVersion,
    BewareVersionSummary,
    ColourRules,
    Examples,
)
from web.interface.drafts import EditHistory

Removed = list[Erased]
"""What the map will have lost by an edit, filled before the next tick."""
MAX_TOLD = 3
"""Largest number of changes that a description names."""


class BewareStore(Protocol):
    """Storage of beware lists; `app.storage.SiteStore` is one."""

    def beware(self) -> BewareList | None:
        """Return the list saved last; None on a new site."""

    def beware_versions(self, *, limit: int = ...) -> tuple[BewareVersion, ...]:
        """Return the lists saved last, newest first."""

    def beware_summaries(self) -> tuple[BewareVersionSummary, ...]:
        """Return all stored versions without their lists, newest first."""

    def beware_version(self, version: int) -> BewareVersion | None:
        """Return the newest list of a version; None where it is not kept."""

    def save_beware(self, beware: BewareList, *, unix_s: float, by: str, what: str) -> None:
        """Store the list in force; earlier lists are kept."""


class MapFollower(Protocol):
    """What lets the map follow the colour rules; `beware_map.BewareMap` is one."""

    def follow(
        self, before: BewareList, after: BewareList, put_back: Removed | None = None
    ) -> Removed:
        """Have the map follow another list, and get back what an undone edit has removed, the list
        that the call for that edit has returned; returns the list that will hold what this edit
        removes."""


class CheckedColours(ColourRules, Protocol):
    """Colour rules from clicks, and the check of those in a list."""

    def check(self, entries: Iterable[BewareClass]) -> None:
        """Raise `BadConfiguration` for a colour rule that takes half of all pixels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lists:
    """The lists before and after an edit."""

    before: BewareList
    after: BewareList
    removed: Removed = field(default_factory=list)
    """What the edit took off the map."""


class BewareEditor:
    """Satisfies the console's port `BewareEdits`. Safe from any thread: one edit at a time."""

    def __init__(
        self,
        holder: StateHolder,
        *,
        store: BewareStore,
        segmenter: Segmenter,
        colours: CheckedColours,
        follower: MapFollower,
        examples: Examples,
        defaults: BewareList | None = None,
        calendar_s: Callable[[], float] = time.time,
        number: Callable[[], int] | None = None,
    ) -> None:
        """`defaults`: list of a new site, by default the shipped one. `number` counts the edits of
        all kinds."""
        self._holder, self._store, self._segmenter = holder, store, segmenter
        self._colours, self._follower, self._examples = colours, follower, examples
        self._defaults = defaults or default_beware_list()
        self._calendar_s = calendar_s
        stored = store.beware_versions(limit=MAX_UNDO + 1)[::-1]
        earlier = (
            (new.what or "an edit", _Lists(before=old.list, after=new.list))
            for old, new in itertools.pairwise(stored)
        )
        self._edits = EditStack[_Lists](number=number, earlier=earlier)

    def retired(self) -> AbstractContextManager[None]:
        """Refuse every edit from now on, unless the block fails; no edit is halfway within it."""
        return self._edits.retired()

    @property
    def list(self) -> BewareList:
        """The list in force."""
        return self._holder.intent.beware

    @property
    def history(self) -> EditHistory:
        """Edits that can be undone and redone."""
        return self._edits.history

    @property
    def colours(self) -> ColourRules:
        """Colour rules from clicks."""
        return self._colours

    @property
    def examples(self) -> Examples:
        """Classes by example."""
        return self._examples

    def finder(self, entry: BewareClass) -> LabelSource:
        """Return which part of the segmenter detects an entry of the list."""
        return self._segmenter.source_of(entry)

    def edit(
        self,
        name: str,
        changes: Mapping[str, object],
        *,
        expected_version: int | None = None,
        by: str = OPERATOR,
    ) -> BewareList:
        """Change fields of one class."""
        with self._edits.editing():
            return self._step(_edited(self._expected(expected_version), name, changes), by)

    def add(self, entry: Mapping[str, object], *, by: str = OPERATOR) -> BewareList:
        """Add a class."""
        with self._edits.editing():
            return self._step(self.list.added(entry), by)

    def remove(
        self,
        name: str,
        *,
        expected_version: int | None = None,
        force: bool = False,
        by: str = OPERATOR,
    ) -> BewareList:
        """Remove a class."""
        with self._edits.editing():
            return self._step(self._expected(expected_version).removed(name), by, force=force)

    def order(self, names: Sequence[str], *, by: str = OPERATOR) -> BewareList:
        """Change the order of the classes."""
        with self._edits.editing():
            return self._step(self.list.ordered(names), by)

    def replace(
        self,
        beware: BewareList,
        *,
        expected_version: int | None = None,
        force: bool = False,
        by: str = OPERATOR,
    ) -> BewareList:
        """Replace the list in force."""
        with self._edits.editing():
            present = self._expected(expected_version)
            present.check_new_limits(beware.classes)
            return self._step(present.replaced(beware.classes), by, force=force)

    def import_toml(
        self,
        text: str,
        *,
        expected_version: int | None = None,
        force: bool = False,
        by: str = OPERATOR,
    ) -> BewareList:
        """Replace the list in force by that of a TOML document."""
        with self._edits.editing():
            wanted = _imported(self._expected(expected_version), text)
            return self._step(wanted, by, force=force, what="import of a file")

    def take_ready_made(self, name: str, *, by: str = OPERATOR) -> BewareList:
        """Replace the list in force by a ready-made one."""
        with self._edits.editing():
            return self._step(self._ready_made(name), by, what="ready-made list")

    def versions(self) -> tuple[BewareVersionSummary, ...]:
        """Return the stored versions, newest first."""
        return self._store.beware_summaries()

    def version(self, version: int) -> BewareVersion:
        """Return a stored version; raises `NotKnown`."""
        stored = self._store.beware_version(version)
        if stored is None:
            raise NotKnown(f"the beware list has no version {version}")
        return stored

    def restore(self, version: int, *, force: bool = False, by: str = OPERATOR) -> BewareList:
        """Bring back a stored version, as the next one."""
        with self._edits.editing():
            wanted = self._restored(version)
            return self._step(wanted, by, force=force, what=f"back to version {version}")

    def drafted(self, draft: BewareDraft) -> BewareList:
        """Return the list after an edit, without applying it."""
        beware = self.list
        if draft.version is not None:
            beware = self._restored(draft.version)
        if draft.toml is not None:
            beware = _imported(beware, draft.toml)
        if draft.ready_made is not None:
            beware = self._ready_made(draft.ready_made)
        for name, fields in draft.changes.items():
            beware = beware.removed(name) if fields is None else _edited(beware, name, fields)
        drafted = beware if draft.add is None else beware.added(draft.add)
        self._check_colours(self.list, drafted)
        return drafted

    def _restored(self, version: int) -> BewareList:
        return self.list.replaced(self.version(version).list.classes)

    def _ready_made(self, name: str) -> BewareList:
        lists = {"default": self._defaults, **ready_made()}
        if name not in lists:
            raise NotKnown(f"no ready-made list is called {name!r}, only {', '.join(lists)}")
        return self.list.adopted(lists[name].classes)

    def undo(self, *, by: str = OPERATOR, number: int | None = None) -> str:
        """Restore the list before the newest edit, as a new version."""
        return self._edits.undo(lambda edit: self._take_back(edit, by), number=number)

    def redo(self, *, by: str = OPERATOR) -> str:
        """Repeat the edit that was undone last, as a new version."""
        return self._edits.redo(lambda edit: self._repeat(edit, by))

    def _take_back(self, edit: Edit[_Lists], by: str) -> None:
        wanted = self.list.replaced(edit.step.before.classes)
        self._apply(wanted, by, f"undo: {edit.text}", put_back=edit.step.removed)

    def _repeat(self, edit: Edit[_Lists], by: str) -> _Lists:
        wanted = self.list.replaced(edit.step.after.classes)
        removed = self._apply(wanted, by, f"redo: {edit.text}")
        return dataclasses.replace(edit.step, removed=removed)

    def _expected(self, version: int | None) -> BewareList:
        beware = self.list
        if version is not None and version != beware.version:
            raise Outdated(
                f"the beware list is at version {beware.version}, the edit was made on {version}"
            )
        return beware

    def _step(
        self, beware: BewareList, by: str, *, force: bool = False, what: str = ""
    ) -> BewareList:
        before = self.list
        if not beware.classes and not force:
            raise NeedsForce(
                "the robot would keep away from nothing: the beware list would be empty"
            )
        self._check_colours(before, beware)
        told = changes_between(before, beware)
        more = f" and {len(told) - MAX_TOLD} more" if len(told) > MAX_TOLD else ""
        details = "; ".join(told[:MAX_TOLD]) + more
        text = ": ".join(filter(None, (what, details))) or "no change"
        removed = self._apply(beware, by, text)
        self._edits.add(text, _Lists(before=before, after=beware, removed=removed))
        return beware

    def _check_colours(self, before: BewareList, beware: BewareList) -> None:
        rules = {entry.colour for entry in before.classes}
        self._colours.check(entry for entry in beware.classes if entry.colour not in rules)

    def _apply(
        self, beware: BewareList, by: str, what: str, *, put_back: Removed | None = None
    ) -> Removed:
        """Store a list, put it in force and let the map follow; returns what that removes from the
        map. The first edit stores the list before it, too, so that this one can be brought back."""
        before, now_s = self.list, self._calendar_s()
        if self._store.beware() is None:
            self._store.save_beware(before, unix_s=now_s, by="", what="list of a new site")
        self._store.save_beware(beware, unix_s=now_s, by=by, what=what)
        self._holder.change(lambda state: dataclasses.replace(state, beware=beware))
        return self._follower.follow(before, beware, put_back)


def _imported(beware: BewareList, text: str) -> BewareList:
    """Return a list with the entries of a TOML document instead of its own."""
    return beware.adopted(parse_beware_list(text, "the file").classes)


def _edited(beware: BewareList, name: str, changes: Mapping[str, object]) -> BewareList:
    """Return a list with changed fields of one class, its name among them."""
    fields = dict(changes)
    new = fields.pop("name", name)
    if not isinstance(new, str):
        raise BadConfiguration(f"beware list: {name}: name: expected text, got {new!r}")
    renamed = beware if new == name else beware.renamed(name, new)
    if not fields:
        return renamed if renamed is not beware else beware.edited(name)
    return dataclasses.replace(renamed.edited(new, **fields), version=beware.version + 1)
