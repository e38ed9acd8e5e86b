"""Undo and redo: the steps of one editor, and one order of the edits of zones, beware list, map and
path settings."""

from __future__ import annotations

import dataclasses
import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from navcore.errors import Refused
from web.interface.drafts import EditHistory
from web.interface.meant_site import require_meant_site
from web.interface.own_edits import note_edit
from web.interface.sites import at_another_site

Step = TypeVar("Step")
"""What an editor has to know of an edit to undo and repeat it."""
MAX_UNDO = 100
"""Largest number of edits of an editor that can be undone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit(Generic[Step]):
    """An edit that can be undone."""

    number: int
    """Number among the edits of all editors; 0 for one of an earlier start of the console."""
    text: str
    """Description."""
    step: Step
    """What was changed."""


class EditStack(Generic[Step]):
    """The edits of one editor that can be undone and repeated. Safe from any thread: an editor
    holds `editing` while it changes something, so there is one edit at a time."""

    def __init__(
        self,
        *,
        number: Callable[[], int] | None = None,
        earlier: Iterable[tuple[str, Step]] = (),
        bytes_used: Callable[[Step], int] = lambda step: 0,
        max_bytes: int = 0,
    ) -> None:
        """`number` counts the edits of all editors; `earlier`: description and step of the edits of
        earlier starts, oldest first. The oldest edits go while the steps use more than `max_bytes`.
        """
        self._number = number or itertools.count(1).__next__
        self._bytes_used, self._max_bytes = bytes_used, max_bytes
        edits = (Edit(number=0, text=text, step=step) for text, step in earlier)
        self._done: deque[Edit[Step]] = deque(edits, maxlen=MAX_UNDO)
        self._undone: list[Edit[Step]] = []
        self._lock = threading.RLock()
        self._is_retired = False

    @contextmanager
    def retired(self) -> Iterator[None]:
        """Refuse every edit from now on, unless the block fails; no edit is halfway within it."""
        with self._lock:
            yield
            self._is_retired = True

    @contextmanager
    def editing(self) -> Iterator[None]:
        """Hold off other edits; raises `OtherSite` when the editor is retired, or the present
        request is meant for another site."""
        with self._lock:
            if self._is_retired:
                raise at_another_site()
            require_meant_site()
            yield

    @property
    def history(self) -> EditHistory:
        """Descriptions of the next undo and redo."""
        return EditHistory.of(self._done, self._undone)

    def add(self, text: str, step: Step) -> None:
        """Add an edit that was made; those that were undone before cannot be repeated any more."""
        number = self._number()
        self._done.append(Edit(number=number, text=text, step=step))
        self._undone = []
        note_edit(number)
        while sum(self._bytes_used(edit.step) for edit in self._done) > self._max_bytes:
            self._done.popleft()

    def follow(self, change: Callable[[Step], Step]) -> None:
        """Change what all edits undo and repeat, because what they are about has moved."""
        with self.editing():
            moved = [dataclasses.replace(edit, step=change(edit.step)) for edit in self._done]
            self._done = deque(moved, maxlen=MAX_UNDO)
            self._undone = [
                dataclasses.replace(edit, step=change(edit.step)) for edit in self._undone
            ]

    def undo(self, take_back: Callable[[Edit[Step]], None], *, number: int | None = None) -> str:
        """Take back the newest edit and return its description; raises `Refused` without one, and
        when it is not the one with the `number`, if that is given.

        An edit that cannot be taken back stays the newest.
        """
        with self.editing():
            if not self._done:
                raise Refused("there is no edit to undo")
            newest = self._done[-1]
            if number not in (None, newest.number):
                raise _another(newest.text)
            take_back(newest)
            self._undone.append(self._done.pop())
            return self._undone[-1].text

    def redo(self, repeat: Callable[[Edit[Step]], Step]) -> str:
        """Repeat the edit that was undone last and return its description; raises `Refused` without
        one. `repeat` returns the step that undoes it then."""
        with self.editing():
            if not self._undone:
                raise Refused("there is no edit to redo")
            edit = self._undone[-1]
            step = repeat(edit)
            self._undone.pop()
            self._done.append(Edit(number=edit.number, text=edit.text, step=step))
            return edit.text


def _another(edit: str | None) -> Refused:
    return Refused(f"another edit was made since, so nothing is undone: {edit}")


class Editor(Protocol):
    """An editor of zones, beware list, map or path settings."""

    @property
    def history(self) -> EditHistory:
        """Its next undo and redo."""

    def undo(self, *, by: str, number: int | None = None) -> str:
        """Undo its newest edit and return its description; `Refused` when it is not the one with
        the `number`, if that is given."""

    def redo(self, *, by: str) -> str:
        """Repeat its edit that was undone last and return its description."""


class AllEdits:
    """Satisfies the console's port `AllEdits`: the newest edit since the start of the console,
    whichever it was of.

    An edit keeps its number when it is undone and repeated. So what may be repeated is the undone
    edit with the smallest number, unless a newer one was made after it.
    """

    def __init__(self, editors: Callable[[], Sequence[Editor]]) -> None:
        """`editors` gives those of the present site."""
        self._editors = editors
        self._lock = threading.Lock()

    @property
    def history(self) -> EditHistory:
        """Descriptions of the next undo and redo."""
        done, undone = self._newest(), self._next()
        undo = done.history if done else EditHistory(undo=None, redo=None)
        redo = undone.history if undone else EditHistory(undo=None, redo=None)
        return EditHistory(
            undo=undo.undo,
            redo=redo.redo,
            undo_number=undo.undo_number,
            redo_number=redo.redo_number,
        )

    def undo(self, *, by: str, number: int | None = None) -> str:
        """Undo the newest edit and return its description; `Refused` when it is not the one with
        the `number`, if that is given."""
        with self._lock:
            editor = self._newest()
            if editor is None:
                raise Refused("there is no edit to undo")
            newest = editor.history
            if number is not None and number != newest.undo_number:
                raise _another(newest.undo)
            return editor.undo(by=by, number=number)

    def redo(self, *, by: str) -> str:
        """Repeat the edit that was undone last and return its description."""
        with self._lock:
            editor = self._next()
            if editor is None:
                raise Refused("there is no edit to redo")
            return editor.redo(by=by)

    def _newest(self) -> Editor | None:
        editors = [editor for editor in self._editors() if editor.history.undo_number]
        return max(editors, key=lambda editor: editor.history.undo_number, default=None)

    def _next(self) -> Editor | None:
        editors = [editor for editor in self._editors() if editor.history.redo_number]
        editor = min(editors, key=lambda editor: editor.history.redo_number, default=None)
        if editor is None:
            return None
        newest = max(other.history.undo_number for other in self._editors())
        return editor if editor.history.redo_number > newest else None
