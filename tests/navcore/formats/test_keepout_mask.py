"""Keep-out masks: zones made of a mask give the same mask, cell by cell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadGeometry
from navcore.formats.keepout_mask import closed_cells, polygons_of
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mission.zone import Zone, ZoneKind, check_polygon
from tests.navcore.laws import law

SPEC = GridSpec.centred(size_m=(3.0, 2.0), resolution_m=0.05)


def zones_of(mask: BoolGrid) -> list[Zone]:
    return [
        Zone(id=str(i), name="z", polygon=check_polygon(ring))
        for i, ring in enumerate(polygons_of(mask, SPEC))
    ]


@law(25)
@given(st.integers(0, 2**32 - 1))
def test_a_mask_of_boxes_and_holes_becomes_zones_that_close_exactly_its_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    for value in (True, True, True, False, True, False):
        top, left = rng.integers(0, SPEC.rows - 2), rng.integers(0, SPEC.cols - 2)
        mask[top : top + rng.integers(1, 16), left : left + rng.integers(1, 20)] = value
    np.testing.assert_array_equal(closed_cells(zones_of(mask), SPEC), mask)


def test_the_floor_within_a_fence_stays_free() -> None:
    """Control: outer outlines alone would close the floor within."""
    fence = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    fence[5:35, 5:50] = True
    fence[8:32, 8:47] = False
    assert len(zones_of(fence)) > 1
    assert not closed_cells(zones_of(fence), SPEC)[20, 25]


def test_the_mask_holds_margins_and_neither_limits_nor_what_is_off() -> None:
    square = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3))
    plain, wide = (
        Zone(id="a", name="a", polygon=square),
        Zone(id="b", name="b", polygon=square, margin_m=0.1),
    )
    slow = Zone(id="c", name="c", polygon=square, kind=ZoneKind.SPEED_LIMIT, max_speed_mps=0.2)
    off = Zone(id="d", name="d", polygon=square, enabled=False)
    assert 0 < closed_cells([plain], SPEC).sum() < closed_cells([wide], SPEC).sum()
    assert not closed_cells([slow, off], SPEC).any()


def test_a_mask_of_specks_is_refused() -> None:
    specks = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    specks[::2, ::2] = True
    with pytest.raises(BadGeometry, match="instead of a keep-out mask"):
        polygons_of(specks, SPEC)


@pytest.mark.long
@pytest.mark.parametrize("across", [False, True])
def test_a_comb_becomes_zones_in_both_directions_and_a_finer_one_is_refused(across: bool) -> None:
    def comb(side: int, pitch: int) -> tuple[BoolGrid, GridSpec]:
        mask = np.zeros((side, side), dtype=np.bool_)
        mask[:, :3] = True
        mask[::pitch, :-1] = True
        spec = GridSpec.centred(size_m=(side * 0.05, side * 0.05), resolution_m=0.05)
        return np.ascontiguousarray(mask.T if across else mask), spec

    mask, spec = comb(520, 2)
    zones = [
        Zone(id=str(i), name="z", polygon=check_polygon(ring))
        for i, ring in enumerate(polygons_of(mask, spec))
    ]
    assert 1 < len(zones) < 20
    np.testing.assert_array_equal(closed_cells(zones, spec), mask)
    dense = np.zeros((160, 160), dtype=np.bool_)
    dense[::2] = dense[:, ::2] = True  # a mesh: every gap is a hole
    with pytest.raises(BadGeometry, match="instead of a keep-out mask"):
        polygons_of(dense, GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.05))
