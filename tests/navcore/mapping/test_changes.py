"""Changes against the accepted map: found by area, and taken over only area by area."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from navcore.config.changes import ChangesConfig
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mapping.changes import CellMap, ChangeKind, accept, changed_areas

SPEC = GridSpec.centred(size_m=(8.0, 6.0), resolution_m=0.1)
EXACT = ChangesConfig(tolerance_m=0.0, join_m=0.0, min_cells=1)
grids = arrays.arrays(np.bool_, (12, 16))
SMALL = GridSpec(resolution_m=0.1, rows=12, cols=16, origin_x_m=0.0, origin_y_m=0.0)


def hall(*boxes: tuple[int, int, int, int], known: bool = True) -> CellMap:
    occupied = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    occupied[5, :] = True
    for top, left, bottom, right in boxes:
        occupied[top:bottom, left:right] = True
    return CellMap(spec=SPEC, occupied=occupied, known=np.full_like(occupied, known))


def cells_of(mask: BoolGrid, known: BoolGrid | None = None) -> CellMap:
    return CellMap(spec=SMALL, occupied=mask, known=np.ones_like(mask) if known is None else known)


def test_a_box_that_appeared_and_a_chair_that_is_gone_are_two_areas() -> None:
    accepted, present = hall((30, 10, 34, 14)), hall((20, 50, 28, 60))
    box, chair = changed_areas(accepted, present)
    assert (box.kind, chair.kind) == (ChangeKind.APPEARED, ChangeKind.GONE)
    assert (round(box.area_m2, 3), round(chair.area_m2, 3)) == (0.8, 0.16)
    low, high = box.outline.min(axis=0), box.outline.max(axis=0)
    np.testing.assert_allclose(low, (1.0, -1.0), atol=1e-6)
    np.testing.assert_allclose(high, (2.0, -0.2), atol=1e-6)


def test_a_wall_that_is_seen_a_cell_aside_has_not_changed() -> None:
    accepted = hall()
    aside = CellMap(spec=SPEC, occupied=np.roll(accepted.occupied, 1, axis=0), known=accepted.known)
    assert changed_areas(accepted, aside) == ()
    assert changed_areas(accepted, aside, EXACT)


def test_what_the_robot_has_not_seen_is_not_gone() -> None:
    assert changed_areas(hall((30, 10, 34, 14)), hall(known=False)) == ()


def test_only_the_accepted_area_changes_the_accepted_map() -> None:
    accepted, present = hall((30, 10, 34, 14)), hall((20, 50, 28, 60))
    box, _ = changed_areas(accepted, present)
    merged = accept(accepted, SPEC, [box])
    assert merged.occupied[20:28, 50:60].all() and merged.occupied[30:34, 10:14].all()
    assert [area.kind for area in changed_areas(merged, present)] == [ChangeKind.GONE]
    assert not accepted.occupied[20:28, 50:60].any()


def test_an_area_of_an_older_listing_does_not_cut_off_a_map_that_has_grown_since() -> None:
    (box,) = changed_areas(hall(), hall((20, 50, 28, 60)))
    grown = hall().on(SPEC.part(-256, -256, SPEC.rows, SPEC.cols + 256))
    occupied = grown.occupied.copy()
    occupied[0, 0] = occupied[-1, -1] = True
    merged = accept(CellMap(spec=grown.spec, occupied=occupied, known=grown.known), SPEC, [box])
    assert merged.spec == grown.spec and merged.occupied[256 + 20 : 256 + 28, 256 + 50 : 316].all()
    occupied[256 + 20 : 256 + 28, 256 + 50 : 316] = True
    np.testing.assert_array_equal(merged.occupied, occupied)


@given(before=grids, now=grids, known=grids)
def test_after_all_areas_are_accepted_nothing_has_changed(
    before: BoolGrid, now: BoolGrid, known: BoolGrid
) -> None:
    accepted, present = cells_of(before), cells_of(now, known)
    areas = changed_areas(accepted, present, EXACT)
    merged = accept(accepted, SMALL, areas)
    assert changed_areas(merged, present, EXACT) == ()
    # Every changed cell is in one area, and no other cell is touched.
    changed = (now & ~before) | (before & ~now & known)
    assert sum(len(area.cells) for area in areas) == changed.sum()
    np.testing.assert_array_equal(merged.occupied != before, changed)


@given(before=grids, rows=st.integers(-3, 3), cols=st.integers(-3, 3))
def test_a_map_is_the_same_on_a_larger_grid(before: BoolGrid, rows: int, cols: int) -> None:
    """A map that grew is compared with one that was accepted before."""
    larger = GridSpec(
        resolution_m=0.1,
        rows=24,
        cols=30,
        origin_x_m=0.1 * (cols - 5),
        origin_y_m=0.1 * (rows - 5),
    )
    moved = cells_of(before).on(larger)
    assert moved.occupied.sum() == before.sum() and moved.known.sum() == before.size
    np.testing.assert_array_equal(
        moved.occupied[5 - rows : 17 - rows, 5 - cols : 21 - cols], before
    )
    elsewhere = GridSpec(resolution_m=0.1, rows=3, cols=3, origin_x_m=50.0, origin_y_m=0.0)
    assert not cells_of(before).on(elsewhere).known.any()
