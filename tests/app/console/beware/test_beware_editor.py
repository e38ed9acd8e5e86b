"""Edits of the beware list: stored before they are in force, undone one by one, also after a
restart; every version comes back, and a wrong edit changes nothing."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from app.console.beware.beware_editor import BewareEditor
from app.console.site.site_map import beware_of, keep_list, list_of_start
from app.storage import Store, site_store
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.mission.beware_changes import changes_between
from navcore.mission.beware_list import (
    LARGEST_CLASS_ID,
    BewareList,
    as_toml,
    default_beware_list,
    parse_beware_list,
)
from tests.app.console.state import beware_editor

SHIPPED = default_beware_list()
BLUE = {"name": "blue tape", "colour": {"hue_deg": [200.0, 250.0]}}


def editor_of(store: Store) -> BewareEditor:
    """An editor as the console starts it."""
    return beware_editor(store.site, store.site.beware())


def test_an_edit_of_an_earlier_start_can_be_undone(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = editor_of(store)
    first.edit("cup", {"margin_m": 0.3})
    first.edit("cup", {"margin_m": 0.4})
    again = editor_of(store)
    assert again.undo() == "“cup”: margin 0.3 m → 0.4 m"
    assert again.list.named("cup").margin_m == 0.3
    assert again.list == store.site.beware() and again.list.version == 3
    again.undo()
    assert again.list.classes == SHIPPED.classes
    with pytest.raises(Refused, match="no edit"):
        again.undo()
    again.redo()
    again.redo()
    assert again.list.named("cup").margin_m == 0.4
    store.close()


def test_a_list_that_was_not_stored_is_neither_in_force_nor_undone(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = editor_of(store)
    store.close()
    with pytest.raises(StorageFailed):
        editor.replace(BewareList(classes=()), force=True)
    assert editor.list == SHIPPED and editor.history.undo is None


def test_every_version_says_who_and_what_and_comes_back(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = editor_of(store)
    editor.add(BLUE, by="ana")
    editor.remove("book", by="ben")
    editor.order([entry.name for entry in editor.list.classes][::-1])
    newest, removed, added, first = editor.versions()
    assert (added.by, added.what) == ("ana", "“blue tape” added")
    assert (removed.by, removed.what) == ("ben", "“book” removed")
    assert newest.what == "order changed" and first.classes == len(SHIPPED.classes)
    before = editor.list
    editor.restore(0, by="ana")
    assert editor.list.classes == SHIPPED.classes and editor.list.version == 4
    assert changes_between(before, editor.list)
    labelled = before.edited("blue tape", label="Absperrband")
    without = dataclasses.replace(labelled, classes=labelled.classes[1:])
    assert labelled.classes[0].label and changes_between(labelled, without) == (
        "“Absperrband” removed",
    )
    editor.undo()
    assert editor.list.classes == before.classes
    with pytest.raises(NotKnown, match="no version 77"):
        editor.restore(77)
    store.close()


def test_a_renamed_class_keeps_its_id_and_what_the_network_detects(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = editor_of(store)
    person, cup = SHIPPED.named("person"), SHIPPED.named("cup")
    editor.edit("cup", {"name": "mug", "margin_m": 0.2})
    mug = editor.list.named("mug")
    assert (mug.class_id, mug.detected_as, mug.margin_m) == (cup.class_id, "cup", 0.2)
    assert editor.list.version == 1 and editor.list.names[cup.class_id] == "mug"
    editor.edit("person", {"name": "people"})
    assert editor.list.people_ids == [person.class_id]
    with pytest.raises(BadConfiguration, match="'cup' is a former name of 'mug'"):
        editor.add({"name": "cup"})
    both = as_toml(BewareList(classes=(mug, dataclasses.replace(mug, name="cup", class_id=62))))
    with pytest.raises(BadConfiguration, match="'cup' is a former name of 'mug'"):
        editor.import_toml(both)
    with pytest.raises(BadConfiguration, match="already"):
        editor.edit("mug", {"name": "book"})
    editor.undo()
    editor.undo()
    assert editor.list.classes == SHIPPED.classes
    editor.redo()
    editor.edit("mug", {"name": "cup"})
    assert editor.list.named("cup").network_class is None
    store.close()


def test_a_removed_class_that_is_added_again_has_its_id(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = editor_of(store)
    blue = editor.add(BLUE).named("blue tape")
    assert blue.class_id not in {entry.class_id for entry in SHIPPED.classes}
    editor.remove("blue tape")
    other = editor.add({"name": "other"}).named("other")
    assert other.class_id != blue.class_id
    assert editor.add(BLUE).named("blue tape").class_id == blue.class_id
    store.close()


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (lambda editor: editor.add({"name": "cup"}), "there is a class 'cup' already"),
        (lambda editor: editor.add({"name": " "}), "1 to 80 printable"),
        (lambda editor: editor.add({"name": "x", "margin_m": 9.0}), "margin_m: 9.0 is out of"),
        (lambda editor: editor.order(["cup"]), "every class once"),
        (lambda editor: editor.replace(BewareList(classes=())), "would be empty"),
        (lambda editor: editor.import_toml(""), "would be empty"),
        (lambda editor: editor.import_toml("[[beware]"), "not readable as TOML.*line 1"),
    ],
)
def test_a_wrong_edit_is_refused_in_words_and_changes_nothing(
    edit: object, reason: str, tmp_path: Path
) -> None:
    store = Store(tmp_path)
    editor = editor_of(store)
    assert callable(edit)
    with pytest.raises((BadConfiguration, Refused), match=reason):
        edit(editor)
    assert editor.list == SHIPPED and editor.versions() == () and editor.history.undo is None
    store.close()


def test_ids_run_out_in_words(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = editor_of(store)
    for number in range(LARGEST_CLASS_ID - len(SHIPPED.classes)):
        editor.add({"name": f"class {number}"})
    with pytest.raises(BadConfiguration, match="all 62 class ids are used"):
        editor.add({"name": "one too many"})
    store.close()


def test_an_exported_list_is_imported_with_the_ids_of_the_site(tmp_path: Path) -> None:
    store = Store(tmp_path)
    editor = editor_of(store)
    blue = editor.add(BLUE).named("blue tape").class_id
    text = as_toml(editor.list)
    foreign = text.replace(f"class_id = {blue}", "class_id = 60").replace(
        'name = "cup"', 'name = "glove"'
    )
    imported = editor.import_toml(foreign)
    cup = SHIPPED.named("cup").class_id
    assert imported.named("blue tape").class_id == blue
    assert imported.named("glove").class_id != cup  # that one belongs to the cups on the map
    assert parse_beware_list(as_toml(imported), "file").classes == imported.classes
    store.close()


def test_a_file_from_the_command_line_is_a_version_of_the_site(tmp_path: Path) -> None:
    store = Store(tmp_path)
    given = BewareList(classes=(dataclasses.replace(SHIPPED.named("cup"), margin_m=0.7),))
    for _ in range(2):  # the second time it says the same: no further version
        keep_list(store.site, SHIPPED, list_of_start(store.site, SHIPPED, given))
    assert [one.by for one in store.site.beware_versions()] == ["command line", ""]
    assert beware_of(store.site).classes == given.classes
    editor = editor_of(store)
    editor.undo()
    assert editor.list.classes == SHIPPED.classes
    store.close()


SWAPPED = dataclasses.replace(SHIPPED.named("cup"), min_height_m=0.5, max_height_m=0.1)
"""A class as it could be stored before limits were compared."""


def store_with_swapped(folder: Path) -> Store:
    """A store with a list of that class and another one."""
    store = Store(folder)
    classes = (SWAPPED, SHIPPED.named("book"))
    store.site.save_beware(dataclasses.replace(SHIPPED, classes=classes, version=4))
    return store


@pytest.mark.parametrize(
    "edit",
    [
        lambda editor: editor.edit("cup", {"min_height_m": 0.6}),
        lambda editor: editor.add({"name": "x", "min_size_m": 1.0, "max_size_m": 0.5}),
        lambda editor: editor.replace(
            BewareList(classes=(dataclasses.replace(SWAPPED, min_height_m=0.6),))
        ),
    ],
)
def test_new_limits_that_contradict_each_other_are_refused(edit: object, tmp_path: Path) -> None:
    store = store_with_swapped(tmp_path)
    editor = editor_of(store)
    assert callable(edit)
    with pytest.raises(BadConfiguration, match=r"min_\w+: .* is above max_"):
        edit(editor)
    assert editor.list.version == 4
    store.close()


def test_stored_limits_that_contradict_each_other_hold_up_no_other_edit(tmp_path: Path) -> None:
    store = store_with_swapped(tmp_path)
    editor = editor_of(store)
    assert beware_of(store.site).named("cup") == SWAPPED
    editor.edit("cup", {"enabled": False, "margin_m": 1.0, "label": "Tasse"})
    editor.edit("cup", {"name": "mug"})
    editor.replace(dataclasses.replace(editor.list, classes=editor.list.classes[:1]))
    editor.edit("mug", {"min_height_m": 0.05})
    editor.remove("mug", force=True)
    for _ in range(5):
        editor.undo()
    assert editor.list.classes == (SWAPPED, SHIPPED.named("book"))
    editor.redo()
    assert editor.restore(4).named("cup") == SWAPPED
    store.close()


def test_the_newest_lists_are_kept_and_a_version_is_found_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(site_store, "MAX_LISTS", 5)
    store = Store(tmp_path)
    store.sites.make("other").save_beware(SHIPPED)
    editor = editor_of(store)
    for number in range(8):
        editor.edit("cup", {"margin_m": number / 10})
    with monkeypatch.context() as unread:
        unread.delattr(site_store, "from_table")  # listing parses no list
        kept = [one.version for one in editor.versions()]
    assert kept == [editor.list.version - back for back in range(5)]
    assert editor.version(kept[-1]).list.named("cup").margin_m == 0.3
    with pytest.raises(NotKnown, match="no version 0"):
        editor.restore(0)
    assert store.sites.open("other").beware() == SHIPPED
    store.close()
