"""The operator's zones: undo and redo, named sets, expiry, and the preview of a draft."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.console.mission import expiry_dates
from app.console.mission.expiry_dates import ExpiryDates
from app.console.mission.path_preview import compare
from app.console.mission.zone_editor import ZoneEditor
from app.runtime.control.operator_state import OperatorState
from app.storage import Store
from navcore.errors import BadGeometry, NotKnown, Outdated, Refused, StorageFailed
from navcore.grid.grid import GridSpec, OccupancyGrid, inflate_layers
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Mission
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_shapes import Circle
from navcore.planning import path
from navcore.planning.planner import plan
from tests.app.console.state import PlainHolder
from web.interface.drafts import EditHistory, PathPreview, Preview, ZoneDraft

SPEC = GridSpec.centred(size_m=(10.0, 6.0), resolution_m=0.1)
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
CIRCLE = Circle(centre=(-2.0, 0.0), radius_m=0.5)
SLOW = ZoneDraft(
    name="slow", polygon=SQUARE, kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.3, colour="#00ff00"
)
ROUND = ZoneDraft(name="round", polygon=CIRCLE.outline(), drawn=CIRCLE, margin_m=0.2)


class Desk(PlainHolder):
    """An editor on a store in a folder, with a clock that is set by hand."""

    def __init__(self, folder: Path) -> None:
        self.now_s = 1e9
        """Time, by a clock that goes on steadily."""
        self.set_by_s = 0.0
        """By how much the calendar clock was set."""
        self.store = Store(folder)
        zones = self.store.site.zones()
        super().__init__(
            OperatorState(mission=Mission(), beware=default_beware_list(), zones=zones)
        )
        self.dates = ExpiryDates(
            calendar_s=lambda: self.now_s + self.set_by_s, steady_s=lambda: self.now_s
        )
        self.editor = ZoneEditor(self, store=self.store.site, dates=self.dates)

    @property
    def bound(self) -> tuple[Zone, ...]:
        """The zones in force."""
        return self.intent.zones


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    opened = Desk(tmp_path)
    yield opened
    opened.store.close()


def test_every_field_of_a_zone_survives_a_restart(desk: Desk, tmp_path: Path) -> None:
    slow, ring = desk.editor.add_all([SLOW, ROUND])
    assert (slow.kind, slow.max_speed_mps, slow.colour, ring.drawn) == (
        ZoneKind.SPEED_LIMIT,
        0.3,
        "#00ff00",
        CIRCLE,
    )
    desk.store.close()
    again = Desk(tmp_path)
    assert again.bound == (slow, ring)
    again.store.close()


def test_edits_are_undone_and_redone_one_by_one_in_the_store_too(desk: Desk) -> None:
    (zone,) = desk.editor.add_all([ROUND])
    desk.editor.replace(zone.id, SLOW, expected_version=1)
    desk.editor.delete(zone.id, expected_version=2)
    seen = []
    for step in (
        desk.editor.undo,
        desk.editor.undo,
        desk.editor.undo,
        desk.editor.redo,
        desk.editor.redo,
        desk.editor.redo,
    ):
        step()
        assert desk.bound == desk.editor.stored == desk.store.site.zones()
        seen.append([one.name for one in desk.bound])
    assert seen == [["slow"], ["round"], [], ["round"], ["slow"], []]
    with pytest.raises(Refused, match="redo"):
        desk.editor.redo()


def test_what_edits_bring_back_is_where_a_correction_of_the_map_has_it(desk: Desk) -> None:
    def placed(zone: Zone) -> Zone:
        polygon = tuple((x + 0.5, y) for x, y in zone.polygon)
        return dataclasses.replace(zone, polygon=polygon, drawn=None)

    (kept,) = desk.editor.add_all([SLOW])
    (gone,) = desk.editor.add_all([ROUND])
    desk.editor.delete(gone.id)
    desk.editor.replace(kept.id, dataclasses.replace(SLOW, name="slower"))
    ((before, after),) = desk.editor.move(placed)
    assert (before.polygon, after.polygon) == (kept.polygon, placed(kept).polygon)
    there = {"slow": placed(kept).polygon, "slower": placed(kept).polygon}
    there |= {"round": placed(gone).polygon}

    def is_there(*names: str) -> bool:
        return {zone.name: zone.polygon for zone in desk.bound} == {n: there[n] for n in names}

    assert is_there("slower")
    desk.editor.undo()
    assert is_there("slow")
    desk.editor.undo()
    assert is_there("slow", "round")
    desk.editor.redo()
    desk.editor.redo()
    assert is_there("slower")


def test_zones_move_with_the_map_even_while_the_store_refuses_and_are_stored_later(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.editor.add_all([SLOW])
    (before,) = desk.bound

    def placed(zone: Zone) -> Zone:
        polygon = tuple((x + 0.5, y) for x, y in zone.polygon)
        return dataclasses.replace(zone, polygon=polygon, drawn=None)

    def full(*_: object) -> None:
        raise StorageFailed("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(desk.store.site, "change_zones", full)
        desk.editor.move(placed)
        (bound,) = desk.bound
        assert bound.polygon == placed(before).polygon and bound.version == before.version + 1
        assert desk.store.site.zones() == (before,)
        with pytest.raises(StorageFailed):  # the thread that calls it logs that once
            desk.editor.expire()
        with pytest.raises(StorageFailed):  # an edit of the operator is refused as before
            desk.editor.add_all([ROUND])
    desk.editor.expire()
    assert desk.store.site.zones() == desk.bound == (bound,)


def test_a_new_edit_clears_redo_and_versions_only_grow(desk: Desk) -> None:
    (zone,) = desk.editor.add_all([ROUND])
    changed = desk.editor.replace(zone.id, SLOW, expected_version=1)
    desk.editor.undo()
    assert desk.editor.history == EditHistory(undo="import of 1 zone", redo="change of 'slow'")
    assert desk.bound[0].version > changed.version
    desk.editor.add_all([SLOW])
    assert desk.editor.history == EditHistory(undo="import of 1 zone", redo=None)


def test_many_zones_are_stored_together_or_not_at_all(desk: Desk) -> None:
    crossed = ZoneDraft(name="bad", polygon=((0, 0), (1, 1), (1, 0), (0, 1)))
    with pytest.raises(BadGeometry, match="crosses itself"):
        desk.editor.add_all([SLOW, crossed])
    assert desk.bound == desk.store.site.zones() == ()
    desk.store.close()
    with pytest.raises(StorageFailed):
        desk.editor.add_all([SLOW])
    assert desk.bound == () and desk.editor.history.undo is None


def test_a_set_is_kept_by_name_used_as_one_edit_and_forgotten(desk: Desk) -> None:
    desk.editor.add_all([SLOW, ROUND])
    before = desk.bound
    desk.editor.save_set("night")
    desk.editor.delete(before[0].id, expected_version=None)
    desk.editor.add_all([SLOW])
    desk.editor.use_set("night")
    assert {one.id for one in desk.bound} == {one.id for one in before}
    assert {one.id for one in desk.store.site.zones()} == {one.id for one in before}
    desk.editor.undo()
    assert [one.name for one in desk.bound] == ["round", "slow"]
    desk.editor.delete_set("night")
    for gone in (desk.editor.use_set, desk.editor.delete_set):
        with pytest.raises(NotKnown, match="night"):
            gone("night")


def test_a_zone_binds_until_its_time_is_over_and_its_end_is_logged(
    desk: Desk, caplog: pytest.LogCaptureFixture
) -> None:
    desk.editor.add_all([ZoneDraft(name="wet", polygon=SQUARE, expires_in_s=60.0), ROUND])
    desk.now_s += 59.0
    desk.editor.expire()
    assert all(one.enabled for one in desk.bound)
    desk.now_s += 2.0
    with caplog.at_level(logging.WARNING):
        desk.editor.expire()
    assert [(one.name, one.enabled, one.expires_at_s) for one in desk.store.site.zones()] == [
        ("wet", False, None),
        ("round", True, None),
    ]
    assert "'wet' has expired" in caplog.text
    past = ZoneDraft(name="past", polygon=SQUARE, expires_at_s=desk.now_s - 1)
    with pytest.raises(BadGeometry, match="'past': its expiry"):
        desk.editor.add(past)
    (taken,) = desk.editor.add_all(
        [past]
    )  # an export holds what is over by now, and can be imported all the same
    assert not taken.enabled and taken.expires_at_s is None


def test_a_zone_for_some_time_holds_that_long_though_the_calendar_clock_is_set(
    desk: Desk,
) -> None:
    """As by NTP after a start without a battery, and by hand."""
    desk.editor.add_all([ZoneDraft(name="wet", polygon=SQUARE, expires_in_s=60.0)])
    desk.editor.save_set("wet")
    for set_by_s in (1e8, -1e8):
        desk.set_by_s = set_by_s
        desk.editor.expire()
        assert desk.bound[0].enabled
        desk.editor.save_set("wet")
        assert desk.editor.sets()["wet"][0].expires_at_s == pytest.approx(60.0)
    desk.now_s += 61.0
    desk.editor.expire()
    assert not desk.bound[0].enabled


def test_a_zone_for_some_time_keeps_it_at_another_site_and_over_a_restart(
    desk: Desk, tmp_path: Path
) -> None:
    wet = ZoneDraft(name="wet", polygon=SQUARE, expires_in_s=60.0)
    (zone,) = desk.editor.add_all([wet])
    assert zone.expires_at_s is not None
    for set_by_s in (1e8, -1e8):
        desk.set_by_s = set_by_s
        # The robot comes back to the site, and the next session begins with what is stored.
        desk.editor = ZoneEditor(desk, store=desk.store.site, dates=desk.dates)
        desk.editor.expire()
        (stored,) = desk.store.site.zones()
        assert stored.enabled
        assert stored.expires_at_s == pytest.approx(zone.expires_at_s + set_by_s)
    desk.store.close()
    again = Desk(tmp_path)
    again.set_by_s = desk.set_by_s
    for past_s, is_on in ((59.0, True), (61.0, False)):
        again.now_s = desk.now_s + past_s
        again.editor.expire()
        assert again.bound[0].enabled is is_on
    again.store.close()


def test_as_many_dates_are_known_as_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expiry_dates, "MAX_DATES", 3)
    now_s = [0.0]
    dates = ExpiryDates(calendar_s=lambda: 1e9 + 5 * now_s[0], steady_s=lambda: now_s[0])
    made = [dates.after(left_s) for left_s in (10.0, 40.0, 30.0, 20.0)]
    now_s[0] = 1.0
    assert [dates.left_s(at_s) for at_s in made] == [5.0, 39.0, 29.0, 19.0]


def test_a_zone_until_a_date_ends_by_the_calendar_clock(desk: Desk) -> None:
    until = ZoneDraft(name="wet", polygon=SQUARE, expires_at_s=desk.now_s + 3600.0)
    desk.editor.add_all([until])
    desk.set_by_s = 3601.0
    desk.editor.expire()
    assert not desk.bound[0].enabled


def test_a_zone_whose_end_the_store_does_not_take_goes_on_binding(desk: Desk) -> None:
    desk.editor.add_all([ZoneDraft(name="wet", polygon=SQUARE, expires_in_s=1.0)])
    desk.store.close()
    desk.now_s += 5.0
    with pytest.raises(StorageFailed):
        desk.editor.expire()
    assert desk.bound[0].enabled


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"kind": ZoneKind.SPEED_LIMIT}, "needs max_speed_mps"),
        ({"max_speed_mps": 0.3}, "needs max_speed_mps"),
        ({"kind": ZoneKind.SPEED_LIMIT, "max_speed_mps": 0.0}, "out of range"),
        ({"margin_m": 3.0}, "margin"),
        ({"colour": "red"}, "#rrggbb"),
    ],
)
def test_rules_that_make_no_sense_are_refused(
    desk: Desk, changes: dict[str, object], word: str
) -> None:
    with pytest.raises(BadGeometry, match=word):
        desk.editor.add_all([ZoneDraft(name="n", polygon=SQUARE, **changes)])  # type: ignore[arg-type]


# Previews, on an open floor from (-4, 0) to (4, 0)


def zone(name: str, x: float, low: float, high: float, **more: object) -> Zone:
    corners = ((x, low), (x + 0.4, low), (x + 0.4, high), (x, high))
    return Zone(id=name, name=name, polygon=corners, **more)  # type: ignore[arg-type]


def preview(
    zones: tuple[Zone, ...], draft: Zone | None = None, replaces: str | None = None
) -> Preview:
    nothing = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    grid = OccupancyGrid(spec=SPEC, geometric=nothing, beware={}, zones=nothing)

    def planned(under: OccupancyGrid, _: tuple[Zone, ...]) -> PathPreview:
        blocked = inflate_layers(under, vehicle_width_m=0.6, safety_margin_m=0.1)
        outcome = plan(blocked, SPEC.cell(-4.0, 0.0), SPEC.cell(4.0, 0.0))
        if isinstance(outcome, path.Path):
            points = SPEC.centres(outcome.cells)
            return PathPreview(
                outcome=outcome, points=points, length_m=outcome.length * 0.1, time_s=outcome.length
            )
        return PathPreview(outcome=outcome, points=np.empty((0, 2)), length_m=None, time_s=None)

    return compare(grid, zones, planned, draft=draft, replaces=replaces)


def length(preview: PathPreview | None) -> float:
    assert preview is not None and preview.length_m is not None
    return preview.length_m


def test_a_preview_of_an_edited_zone_does_not_count_its_stored_outline() -> None:
    stored, moved = zone("wet", 0.0, -2.9, 1.0), zone("wet", 0.0, 2.0, 2.9)
    edited = preview((stored,), moved, replaces="wet")
    assert length(edited.path) == pytest.approx(8.0, abs=0.2)
    assert length(edited.present) > 9.0
    # The control: as a second zone beside the stored one the same draft would close the path.
    assert isinstance(preview((stored,), moved).path.outcome, path.NoPath)


def test_what_cuts_the_goal_off_is_named_and_what_does_not_is_not() -> None:
    across, beside = zone("across", 0.0, -2.9, 2.9), zone("beside", -2.0, -2.9, 1.0)
    cut = preview((beside,), across)
    assert isinstance(cut.path.outcome, path.NoPath) and cut.cut_by == ("across",)
    assert length(cut.present) > 8.0
    assert preview((beside, across), zone("harmless", 2.0, -2.9, -2.5)).cut_by == ("across",)
    assert preview((beside, across)).cut_by == ("across",)
    halves = (zone("north", 0.0, -0.2, 2.9), zone("south", 0.0, -2.9, 0.2), beside)
    assert set(preview(halves).cut_by) == {"north", "south"}
    assert (
        preview(
            (beside,), zone("slow", 0.0, -2.9, 2.9, kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.2)
        ).cut_by
        == ()
    )


def test_an_edit_of_an_outdated_version_is_refused_though_the_zone_was_deleted_and_restored(
    desk: Desk,
) -> None:
    zone = desk.editor.add(ROUND)
    held = desk.editor.replace(zone.id, dataclasses.replace(ROUND, name="held")).version
    desk.editor.save_set("day")
    for _ in range(2):
        desk.editor.undo()
    desk.editor.redo()
    desk.editor.replace(zone.id, dataclasses.replace(ROUND, name="by another operator"))
    with pytest.raises(Outdated):
        desk.editor.replace(zone.id, ROUND, expected_version=held)
    desk.editor.delete(zone.id)
    desk.editor.use_set("day")
    desk.editor.replace(zone.id, dataclasses.replace(ROUND, name="by another operator"))
    with pytest.raises(Outdated):
        desk.editor.replace(zone.id, ROUND, expected_version=held)


def test_a_set_stores_the_remaining_time_of_its_zones_and_not_their_date(desk: Desk) -> None:
    desk.editor.add(dataclasses.replace(ROUND, expires_in_s=3600.0))
    desk.now_s += 600.0
    desk.editor.save_set("night")
    desk.now_s += 24 * 3600.0
    desk.editor.use_set("night")
    desk.editor.expire()
    (zone,) = desk.bound
    assert zone.enabled and zone.expires_at_s == pytest.approx(desk.now_s + 3000.0)
