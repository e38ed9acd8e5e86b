"""The operator's edits of the beware list: stored, then in force; every edit can be undone."""

from __future__ import annotations

import dataclasses
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Protocol

from app.runtime.operator_state import StateHolder
from navcore.errors import Outdated, Refused
from navcore.mission.beware_list import BewareClass, BewareList, default_beware_list
from navcore.perception.labels import LabelSource, Segmenter

MAX_UNDO = 100


class BewareStore(Protocol):
    """Storage of beware lists; `app.storage.Store` is one."""

    def beware_versions(self) -> tuple[BewareList, ...]:
        """Return every list that was ever saved, newest first."""

    def save_beware(self, beware: BewareList) -> None:
        """Store the list in force; earlier lists are kept."""


class BewareEditor:
    """Satisfies the console's port `BewareEdits`. Safe from any thread: one edit at a time."""

    def __init__(
        self,
        holder: StateHolder,
        *,
        store: BewareStore,
        segmenter: Segmenter,
        defaults: BewareList | None = None,
    ) -> None:
        """`defaults`: list of a new site, by default the shipped one."""
        self._holder, self._store, self._segmenter = holder, store, segmenter
        self._defaults = defaults or default_beware_list()
        self._earlier = deque(reversed(store.beware_versions()[1:]), maxlen=MAX_UNDO)
        self._editing = threading.Lock()
        self._is_retired = False

    @contextmanager
    def retired(self) -> Iterator[None]:
        """Refuse every edit from now on, unless the block fails; no edit is halfway within it."""
        with self._editing:
            yield
            self._is_retired = True

    @property
    def list(self) -> BewareList:
        """The list in force."""
        return self._holder.intent.beware

    @property
    def can_undo(self) -> bool:
        """Whether an earlier list is known."""
        return bool(self._earlier)

    def finder(self, entry: BewareClass) -> LabelSource:
        """Return which part of the segmenter detects an entry of the list."""
        return self._segmenter.source_of(entry)

    def edit(
        self, name: str, changes: Mapping[str, object], *, expected_version: int | None = None
    ) -> BewareList:
        """Change fields of one class."""
        with self._editing:
            return self._change(self._expected(expected_version).edited(name, **changes))

    def replace(self, beware: BewareList, *, expected_version: int | None = None) -> BewareList:
        """Replace the list in force."""
        with self._editing:
            return self._change(self._expected(expected_version).replaced(beware.classes))

    def restore_defaults(self) -> BewareList:
        """Replace the list in force by that of a new site."""
        with self._editing:
            return self._change(self.list.replaced(self._defaults.classes))

    def undo(self) -> BewareList:
        """Restore the list before the newest edit, as a new version."""
        with self._editing:
            if not self._earlier:
                raise Refused("there is no edit of the beware list to undo")
            beware = self._apply(self.list.replaced(self._earlier[-1].classes))
            self._earlier.pop()
            return beware

    def _expected(self, version: int | None) -> BewareList:
        beware = self.list
        if version is not None and version != beware.version:
            raise Outdated(
                f"the beware list is at version {beware.version}, the edit was made on {version}"
            )
        return beware

    def _change(self, beware: BewareList) -> BewareList:
        before = self.list
        self._apply(beware)
        self._earlier.append(before)
        return beware

    def _apply(self, beware: BewareList) -> BewareList:
        if self._is_retired:
            raise Refused("the site has been changed meanwhile; load the beware list again")
        self._store.save_beware(beware)
        self._holder.change(lambda state: dataclasses.replace(state, beware=beware))
        return beware
