"""Edits of the map by the operator: posted to the thread of the map, told, undone and redone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.console.site.map_editor import MAX_UNDO_BYTES, MapEditor
from app.insight.detections import DetectionGallery
from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.errors import BadGeometry, NotKnown, Refused
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.erasing import Erasable
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.labels import Labels
from tests.navcore.scene import SPEC, picture

MAT = BewareClass(name="mat", class_id=7)
LIST = BewareList(classes=(MAT,))
FLOOR = picture()

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
        self.at_once = False

    def edit_map(self, edit: Callable[[PointMap], None]) -> None:
        self.posted.append(edit)
        if self.at_once:
            self.tick()

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
def gallery() -> DetectionGallery:
    """Two mats on the floor in one image, and a gallery that has seen them."""
    gallery = DetectionGallery()
    gallery.update(1.0, FLOOR, mats(), LIST, moves=gallery.moves)
    return gallery


@pytest.fixture
def editor(holder: Holder, gallery: DetectionGallery, told: list[str]) -> MapEditor:
    return editor_of(holder, gallery, told)


def editor_of(
    holder: Holder,
    gallery: DetectionGallery,
    told: list[str],
    max_undo_bytes: int = MAX_UNDO_BYTES,
) -> MapEditor:
    return MapEditor(
        holder,
        point_map=holder.map,
        detections=lambda: gallery,
        beware=lambda: LIST.edited("mat", label="Matte"),
        tell=lambda text, place: told.append(text),
        max_undo_bytes=max_undo_bytes,
    )


def mats(confidence: float = 0.9) -> Labels:
    """Label two mats, left and right of the robot."""
    class_ids = np.zeros(FLOOR.depth_m.shape, dtype=np.uint8)
    class_ids[85:100, 20:40] = class_ids[85:100, 120:140] = MAT.class_id
    return Labels(
        class_ids=class_ids, confidence=np.full(class_ids.shape, confidence, dtype=np.float32)
    )


def seen(holder: Holder, labels: Labels) -> int:
    """Return the number of cells of mats after one more image."""
    labels = holder.map.rejections.without(FLOOR, labels)
    observation = observe(FLOOR, labels, LIST, SPEC, ObservationConfig())
    holder.map.insert(observation, FLOOR, labels)
    return mat_cells(holder)


def mat_cells(holder: Holder) -> int:
    return int(layer_grid(holder.map, LIST, ()).beware[MAT.class_id].sum())


def test_a_rejected_detection_is_free_at_once_and_stays_so_unless_a_look_is_surer(
    editor: MapEditor, holder: Holder, gallery: DetectionGallery, told: list[str]
) -> None:
    both = seen(holder, mats())
    editor.reject(1, all_of_class=False, by="Ana")
    assert gallery.all()[-1].verdict == "rejected" and gallery.counts() == {MAT.class_id: 1}
    holder.tick()
    one = mat_cells(holder)
    assert 0 < one < both
    assert told[-1].startswith("Ana: “Matte” at") and told[-1].endswith("cells are free.")
    assert [seen(holder, mats()) for _ in range(5)] == [one] * 5
    assert seen(holder, mats(0.99)) > one
    (place,) = editor.rejected
    assert place.class_name == "mat" and place.confidence == pytest.approx(0.9)


def test_a_rejection_is_undone_with_points_memory_and_verdict(
    editor: MapEditor, holder: Holder, gallery: DetectionGallery
) -> None:
    both = seen(holder, mats())
    editor.reject(2, all_of_class=True, by="Ana")
    holder.tick()
    assert mat_cells(holder) == 0 and len(editor.rejected) == 2 and not gallery.counts()
    assert not gallery.update(2.0, FLOOR, mats(), LIST, moves=gallery.moves)  # an image from before
    with pytest.raises(Refused, match="rejected already"):
        editor.reject(2, all_of_class=False, by="Ana")
    editor.undo(by="Bo")
    holder.tick()
    assert mat_cells(holder) == both and not editor.rejected
    assert gallery.counts() == {MAT.class_id: 2}
    editor.redo(by="Bo")
    holder.tick()
    assert mat_cells(holder) == 0 and len(editor.rejected) == 2


def test_what_was_called_wrong_before_is_among_those_of_which_none_is_one(
    editor: MapEditor, holder: Holder, gallery: DetectionGallery
) -> None:
    both = seen(holder, mats())
    gallery.mark(1, "wrong")
    editor.reject(1, all_of_class=True, by="Ana")
    holder.tick()
    assert mat_cells(holder) == 0 and {one.verdict for one in gallery.all()} == {"rejected"}
    editor.undo(by="Ana")
    holder.tick()
    assert mat_cells(holder) == both
    assert {one.id: one.verdict for one in gallery.all()} == {1: "wrong", 2: None}


def test_what_a_kept_map_holds_is_rejected_at_its_place_without_a_detection(
    holder: Holder, told: list[str]
) -> None:
    both, holder.at_once = seen(holder, mats()), True
    editor = editor_of(holder, DetectionGallery(), told)  # as after a start in a kept map
    cells = np.argwhere(layer_grid(holder.map, LIST, ()).beware[MAT.class_id])
    x_m, y_m = SPEC.centres(cells)[0].tolist()
    with pytest.raises(Refused, match="nothing of “Matte” on the map at"):
        editor.reject_at(MAT.class_id, (x_m + 5.0, y_m), all_of_class=False, by="Ana")
    editor.reject_at(MAT.class_id, (x_m, y_m + 0.1), all_of_class=False, by="Ana")
    one = mat_cells(holder)
    assert 0 < one < both and told[-1].endswith("cells are free.")
    assert [seen(holder, mats()) for _ in range(5)] == [one] * 5
    assert seen(holder, mats(0.99)) > one
    editor.undo(by="Bo")
    editor.reject_at(MAT.class_id, (x_m, y_m), all_of_class=True, by="Ana")
    assert mat_cells(holder) == 0
    assert "none of 2 places of “Matte” is one" in told[-1]


def test_rejecting_a_place_marks_the_detections_there(
    editor: MapEditor, holder: Holder, gallery: DetectionGallery
) -> None:
    seen(holder, mats())
    first, holder.at_once = gallery.extent(1), True
    editor.reject_at(MAT.class_id, first.sighting.place, all_of_class=False, by="Ana")
    assert [one.verdict for one in sorted(gallery.all(), key=lambda one: one.id)] == [
        "rejected",
        None,
    ]
    editor.undo(by="Bo")
    holder.tick()
    assert not editor.rejected and gallery.counts() == {MAT.class_id: 2}


def test_a_place_is_looked_up_in_the_thread_that_may_be_growing_the_map(
    editor: MapEditor, holder: Holder, gallery: DetectionGallery, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen(holder, mats())
    place = gallery.extent(1).sighting.place
    monkeypatch.setattr("app.console.map_reading.WAIT_S", 0.01)
    with pytest.raises(Refused, match="no image"):
        editor.reject_at(MAT.class_id, place, all_of_class=False, by="Ana")
    assert gallery.extent(1).sighting.verdict is None


def test_a_rejection_can_be_forgotten_and_remembered_again(
    editor: MapEditor, holder: Holder
) -> None:
    both = seen(holder, mats())
    editor.reject(1, all_of_class=True, by="Ana")
    holder.tick()
    for place in editor.rejected:
        editor.forget(place.id, by="Ana")
    with pytest.raises(NotKnown, match="nothing was rejected under the id 77"):
        editor.forget(77, by="Ana")
    holder.tick()
    assert not editor.rejected
    assert [seen(holder, mats()) for _ in range(3)][-1] == both
    for _ in range(2):
        editor.undo(by="Ana")
    holder.tick()
    assert len(editor.rejected) == 2
    editor.undo(by="Ana")
    holder.tick()
    assert not editor.rejected and mat_cells(holder) == both


def test_a_rejected_object_that_is_seen_with_more_confidence_is_a_new_detection(
    editor: MapEditor, holder: Holder, gallery: DetectionGallery
) -> None:
    seen(holder, mats())
    editor.reject(1, all_of_class=True, by="Ana")
    assert [
        one.id for one in gallery.update(2.0, FLOOR, mats(0.98), LIST, moves=gallery.moves)
    ] == [3, 4]


def test_nothing_is_rejected_before_there_is_a_map(editor: MapEditor) -> None:
    with pytest.raises(Refused, match="no map yet"):
        editor.reject(1, all_of_class=False, by="Ana")
    with pytest.raises(NotKnown):
        editor.reject(9, all_of_class=False, by="Ana")


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
    with pytest.raises(Refused, match="no edit to undo"):
        editor.undo(by="Ana")
    editor.erase(AREA, Erasable.BOTH, by="Ana")
    assert editor.undo(by="Bo") == "erasing of obstacles and beware points around (2.0, 0.0)"
    assert holder.tick() == 400
    assert told[-1].startswith("Bo took back: erasing")
    assert (editor.history.undo, editor.history.redo is None) == (None, False)
    editor.redo(by="Ana")
    assert holder.tick() == 0
    editor.undo(by="Ana")
    assert holder.tick() == 400
    editor.erase(AREA, Erasable.GEOMETRY, by="Ana")
    with pytest.raises(Refused, match="no edit to redo"):
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
    holder: Holder, gallery: DetectionGallery
) -> None:
    editor = editor_of(holder, gallery, [], max_undo_bytes=100)
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
        with pytest.raises(Refused, match="another site now"):
            edit()
    assert len(holder.posted) == 1
