"""Edits of the beware list: stored before they are in force, undone one by one, also after a
restart."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.console.beware_editor import BewareEditor
from app.storage import Store
from navcore.errors import Refused, StorageFailed
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter


class Desk(BewareEditor):
    """A desk over a store, as the console starts it."""

    def __init__(self, store: Store) -> None:
        self.in_force = store.beware() or default_beware_list()
        super().__init__(
            present=lambda: self.in_force,
            save=store.save_beware,
            put=lambda beware: setattr(self, "in_force", beware),
            finds=ColourSegmenter().finds,
            earlier=reversed(store.beware_versions()[1:]),
        )


def test_an_edit_of_an_earlier_start_can_be_undone(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = Desk(store)
    first.edit("cup", {"margin_m": 0.3})
    first.edit("cup", {"margin_m": 0.4})
    again = Desk(store)
    assert again.can_undo and again.undo().named("cup").margin_m == 0.3
    assert again.in_force == store.beware() and again.in_force.version == 3
    with pytest.raises(Refused, match="no edit"):
        again.undo()
    store.close()


def test_a_list_that_was_not_stored_is_neither_in_force_nor_undone(tmp_path: Path) -> None:
    store = Store(tmp_path)
    desk = Desk(store)
    store.close()
    with pytest.raises(StorageFailed):
        desk.replace(BewareList(classes=()))
    assert desk.in_force == default_beware_list() and not desk.can_undo
