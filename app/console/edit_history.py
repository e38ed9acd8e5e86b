"""One undo and redo for the edits of zones, beware list, map and path settings, in the order in
which they were made."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Protocol

from navcore.errors import Refused
from web.interface.drafts import EditHistory


class Editor(Protocol):
    """Editor of one editor."""

    @property
    def history(self) -> EditHistory:
        """Its next undo and redo."""

    def undo(self, *, by: str) -> str:
        """Undo its newest edit and return its description."""

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

    def undo(self, *, by: str) -> str:
        """Undo the newest edit and return its description."""
        with self._lock:
            editor = self._newest()
            if editor is None:
                raise Refused("there is no edit to undo")
            return editor.undo(by=by)

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
