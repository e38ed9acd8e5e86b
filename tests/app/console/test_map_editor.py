"""Edits of the map by the operator: posted to the thread of the map, told, undone and redone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.console import map_editor
from app.console.map_editor import MapEditor
from navcore.config.mapping import MappingConfig
from navcore.errors import BadGeometry, Refused
from navcore.mapping.erasing import Erasable
from navcore.mapping.point_map import PointMap
from tests.navcore.scene import SPEC

AREA = ((1.0, -1.0), (3.0, -1.0), (3.0, 1.0), (1.0, 1.0))


class Holder:
    """A map of 400 occupied cells that is edited when the test says so."""

    def __init__(self) -> None:
        self.map = PointMap(SPEC, MappingConfig())
        occupied = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
        row, col = SPEC.cell(1.05, -0.95)
        occupied[row : row + 20, col : col + 20] = True
        self.map.load_prior(occupied)
        self.posted: list[Callable[[PointMap], None]] = []

    def edit_map(self, edit: Callable[[PointMap], None]) -> None:
        self.posted.append(edit)

    def tick(self) -> int:
        """Do what was posted; return the number of occupied cells."""
        posted, self.posted = self.posted, []
        for edit in posted:
            edit(self.map)
        return int(self.map.layers.bools(0).sum())


@pytest.fixture
def holder() -> Holder:
    return Holder()


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def editor(holder: Holder, told: list[str]) -> MapEditor:
    return MapEditor(holder, spec=lambda: SPEC, tell=lambda text, place: told.append(text))


def test_erasing_is_done_by_the_thread_of_the_map_and_told_with_the_user(
    editor: MapEditor, holder: Holder, told: list[str]
) -> None:
    editor.erase(AREA, Erasable.GEOMETRY, by="Ana")
    assert not told
    assert holder.tick() == 0
    assert told == ["Ana erased 400 cells of obstacles."]
    assert editor.history.undo == "erasing of obstacles around (2.0, 0.0)"


def test_an_erasure_is_undone_and_redone_also_before_it_is_done(
    editor: MapEditor, holder: Holder, told: list[str]
) -> None:
    with pytest.raises(Refused, match="no edit of the map to undo"):
        editor.undo(by="Ana")
    editor.erase(AREA, Erasable.BOTH, by="Ana")
    assert editor.undo(by="Bo") == "erasing of obstacles and beware points around (2.0, 0.0)"
    assert holder.tick() == 400
    assert told[-1].startswith("Bo undid the erasing")
    assert (editor.history.undo, editor.history.redo is None) == (None, False)
    editor.redo(by="Ana")
    assert holder.tick() == 0
    editor.undo(by="Ana")
    assert holder.tick() == 400
    editor.erase(AREA, Erasable.GEOMETRY, by="Ana")
    with pytest.raises(Refused, match="no edit of the map to redo"):
        editor.redo(by="Ana")


@pytest.mark.parametrize(
    ("corners", "says"),
    [
        (AREA[:2], "area has 2 distinct corners"),
        ((*AREA[:2], AREA[3], AREA[2]), "outline of the area crosses itself"),
        (((0.0, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0)), "at most 2500 m² are erased"),
        (tuple((x + 500.0, y) for x, y in AREA), "beside the map"),
    ],
)
def test_a_bad_area_is_refused_in_words_and_nothing_is_posted(
    editor: MapEditor, holder: Holder, corners: tuple[tuple[float, float], ...], says: str
) -> None:
    with pytest.raises(BadGeometry, match=says):
        editor.erase(corners, Erasable.BOTH, by="Ana")
    assert not holder.posted
    assert editor.history.undo is None


def test_what_takes_too_much_memory_can_not_be_undone_any_more(
    editor: MapEditor, holder: Holder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(map_editor, "MAX_UNDO_BYTES", 100)
    editor.erase(AREA, Erasable.BOTH, by="Ana")
    holder.tick()
    editor.erase(AREA, Erasable.GEOMETRY, by="Ana")
    holder.tick()
    editor.undo(by="Ana")
    with pytest.raises(Refused):
        editor.undo(by="Ana")


def test_edits_of_a_site_that_was_left_are_refused(editor: MapEditor, holder: Holder) -> None:
    editor.erase(AREA, Erasable.BOTH, by="Ana")
    with editor.retired():
        pass
    for edit in (
        lambda: editor.erase(AREA, Erasable.BOTH, by="Ana"),
        lambda: editor.undo(by="Ana"),
    ):
        with pytest.raises(Refused, match="site has been changed"):
            edit()
    assert len(holder.posted) == 1
