"""The order of the edits of all editors: what is undone is the edit that was asked for."""

from __future__ import annotations

import itertools

import pytest

from app.console.edit_history import AllEdits, EditStack
from navcore.errors import Refused
from web.interface.drafts import EditHistory


class Editor:
    """An editor during whose undo another operator makes an edit, once its history was read."""

    def __init__(self) -> None:
        self.edits = EditStack[str](number=itertools.count(1).__next__)
        self.undone: list[str] = []
        self.waiting: list[str] = []

    @property
    def history(self) -> EditHistory:
        """Its next undo and redo."""
        return self.edits.history

    def undo(self, *, by: str, number: int | None = None) -> str:
        """Undo its newest edit, after the one that has waited."""
        for text in self.waiting:
            self.edits.add(text, text)
        return self.edits.undo(lambda edit: self.undone.append(edit.step), number=number)

    def redo(self, *, by: str) -> str:
        """Repeat nothing."""
        raise NotImplementedError


def test_an_edit_that_is_made_while_another_one_is_undone_is_not_undone() -> None:
    editor = Editor()
    editor.edits.add("own", "own")
    editor.waiting = ["of another operator"]
    with pytest.raises(Refused, match=r"another edit was made since.*of another operator"):
        AllEdits(lambda: (editor,)).undo(by="vera", number=1)
    assert editor.undone == []
    editor.waiting = []
    assert AllEdits(lambda: (editor,)).undo(by="vera", number=2) == "of another operator"
