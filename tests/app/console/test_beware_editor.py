"""Edits of the beware list: stored before they are in force, undone one by one, also after a
restart."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.console.beware_editor import BewareEditor
from app.runtime.operator_state import OperatorState
from app.storage import Store
from navcore.errors import Refused, StorageFailed
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.mission.mission import Mission
from navcore.perception.colour_segmenter import ColourSegmenter
from tests.app.console.state import PlainHolder


def editor_of(store: Store) -> BewareEditor:
    """An editor as the console starts it."""
    beware = store.site.beware() or default_beware_list()
    holder = PlainHolder(OperatorState(mission=Mission(), beware=beware))
    return BewareEditor(holder, store=store.site, segmenter=ColourSegmenter())


def test_an_edit_of_an_earlier_start_can_be_undone(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = editor_of(store)
    first.edit("cup", {"margin_m": 0.3})
    first.edit("cup", {"margin_m": 0.4})
    again = editor_of(store)
    assert again.can_undo and again.undo().named("cup").margin_m == 0.3
    assert again.list == store.site.beware() and again.list.version == 3
    with pytest.raises(Refused, match="no edit"):
        again.undo()
    store.close()


def test_a_list_that_was_not_stored_is_neither_in_force_nor_undone(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = editor_of(store)
    store.close()
    with pytest.raises(StorageFailed):
        editor.replace(BewareList(classes=()))
    assert editor.list == default_beware_list() and not editor.can_undo
