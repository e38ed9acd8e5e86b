"""Zones: what is refused, and that no touched cell is lost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from navcore.errors import BadGeometry
from navcore.grid.grid import BoolGrid, GridSpec
from navcore.mission import zone_cells
from navcore.mission.zone import MAX_CORNERS, Zone, ZoneKind, check_polygon, forbidden_cells
from navcore.mission.zone_cells import rasterise
from tests.navcore.laws import law

SPEC = GridSpec.centred(size_m=(6.0, 4.0), resolution_m=0.1)
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
HAIR = 0.02
"""Depth in cells up to which an overlap with a cell may be lost to rounding."""


@pytest.mark.parametrize(
    ("corners", "word"),
    [
        ([], "0 distinct corners"),
        ([(0, 0)], "1 distinct corners"),
        ([(0, 0), (1, 1)], "2 distinct corners"),
        ([(0, 0), (1, 1), (0, 0), (1, 1), (0, 0)], "2 distinct corners"),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], "crosses itself"),
        ([(0, 0), (1, 0), (2, 0)], "crosses itself|covers"),
        ([(0, 0), (1, 0), (math.nan, 1)], "not finite"),
        ([(0, 0), (1, 0), (1, math.inf)], "not finite"),
        ([(0, 0), (1, 0), (1, 10_001)], r"\(1, 10001\) is out of range"),
        ([(0, 0), (1, 0), (1e200, 1e200)], "out of range|crosses itself"),
        ([(0, 0), (0.001, 0), (0, 0.001)], "covers"),
        ([(0, 0), (1, 0, 0), (1, 1)], "pairs"),
        ([(0, 0), (1,), (1, 1)], "pairs"),
        ([(0.001 * i, 0.0) for i in range(MAX_CORNERS + 1)], f"{MAX_CORNERS + 1} corners"),
    ],
)
def test_a_bad_polygon_is_refused_with_the_reason(
    corners: Sequence[Sequence[float]], word: str
) -> None:
    with pytest.raises(BadGeometry, match=word):
        check_polygon(corners)


def test_a_good_polygon_passes_unchanged_and_a_closing_corner_is_dropped() -> None:
    """Control for the refusals above."""
    assert check_polygon(SQUARE) == SQUARE
    assert check_polygon([*SQUARE, SQUARE[0]]) == SQUARE
    assert check_polygon(SQUARE[::-1]) == SQUARE[::-1]


def overlaps(polygon: Sequence[Sequence[float]], *, deeper_than: float) -> BoolGrid:
    """Return the (rows, cols) cells whose square, shrunk by `deeper_than` cells on every side,
    meets the polygon; by shapely."""
    shape = Polygon(polygon)
    shapely.prepare(shape)
    rows, cols = np.mgrid[: SPEC.rows, : SPEC.cols]
    x, y, d = SPEC.origin_x_m + cols * 0.1, SPEC.origin_y_m + rows * 0.1, deeper_than * 0.1
    return np.asarray(
        shapely.intersects(shape, shapely.box(x + d, y + d, x + 0.1 - d, y + 0.1 - d))
    )


def star(seed: int, corners: int) -> list[tuple[float, float]]:
    """Return a simple polygon: corners around a centre, in order of their angle."""
    rng = np.random.default_rng(seed)
    angles = np.sort((np.arange(corners) + rng.uniform(0.05, 0.95, corners)) / corners * 2 * np.pi)
    radii = rng.uniform(0.05, 1.4, corners)
    x, y = rng.uniform(-1.5, 1.5), rng.uniform(-0.5, 0.5)
    return [
        (float(x + r * math.cos(a)), float(y + r * math.sin(a)))
        for r, a in zip(radii, angles, strict=True)
    ]


@law(150)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
def test_every_cell_that_a_zone_overlaps_by_more_than_a_hair_is_marked(
    seed: int, corners: int
) -> None:
    polygon = check_polygon(star(seed, corners))
    missing = overlaps(polygon, deeper_than=HAIR) & ~rasterise(polygon, SPEC)
    assert not missing.any(), (
        f"{int(missing.sum())} cells, first {np.argwhere(missing)[0]}, of {polygon}"
    )


def test_the_tip_that_a_slanted_edge_puts_into_a_cell_is_marked() -> None:
    polygon = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.06), (0.0, 0.06)]
    missing = overlaps(polygon, deeper_than=HAIR) & ~rasterise(polygon, SPEC)
    assert not missing.any(), f"{int(missing.sum())} cells, first {np.argwhere(missing)[0]}"


@law(100)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
def test_no_cell_that_a_zone_keeps_away_from_is_marked(seed: int, corners: int) -> None:
    """Control: marking the whole map would pass the law above."""
    polygon = star(seed, corners)
    assert not (rasterise(polygon, SPEC) & ~overlaps(polygon, deeper_than=-1.0)).any()


def test_a_sliver_thinner_than_a_cell_is_marked_from_end_to_end() -> None:
    sliver = [(-2.0, 0.031), (2.0, 0.031), (2.0, 0.039), (-2.0, 0.039)]
    row = SPEC.cell(0.0, 0.035)[0]
    assert rasterise(sliver, SPEC)[row, 10:50].all()
    assert int(rasterise(sliver, SPEC)[row + 3].sum()) == 0


def test_the_test_of_lost_cells_sees_a_lost_cell() -> None:
    """Control: a plain fill, by the centres of cells alone, loses touched cells."""
    polygon = star(3, 5)
    by_centre = np.array(
        [
            [Polygon(polygon).contains(shapely.Point(SPEC.centre(r, c))) for c in range(SPEC.cols)]
            for r in range(SPEC.rows)
        ]
    )
    assert (overlaps(polygon, deeper_than=HAIR) & ~by_centre).any()


def test_only_the_bounding_box_of_a_small_zone_on_a_large_map_is_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn, draw = [], zone_cells._drawn

    def noted(*of: Any) -> BoolGrid:
        drawn.append(draw(*of))
        return drawn[-1]

    monkeypatch.setattr(zone_cells, "_drawn", noted)
    large = GridSpec.centred(size_m=(150.0, 150.0), resolution_m=0.05)
    whole = rasterise(((10.0, 10.0), (11.0, 10.0), (10.5, 11.0)), large)
    assert whole.shape == (large.rows, large.cols)
    (cells,) = drawn
    assert cells.size < 1000
    assert whole.sum() == cells.sum() > 150


@law(100)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
def test_what_lies_in_a_stay_inside_zone_as_a_whole_is_all_that_it_permits(
    seed: int, corners: int
) -> None:
    polygon = star(seed, corners)
    zone = Zone(id="s", name="site", polygon=tuple(polygon), kind=ZoneKind.STAY_INSIDE)
    shape = Polygon(polygon)
    rows, cols = np.mgrid[: SPEC.rows, : SPEC.cols]
    x, y = SPEC.origin_x_m + cols * 0.1, SPEC.origin_y_m + rows * 0.1
    hair = 1e-9
    held = shapely.covers(shape, shapely.box(x - hair, y - hair, x + 0.1 + hair, y + 0.1 + hair))
    nearly = shapely.covers(shape, shapely.box(x + hair, y + hair, x + 0.1 - hair, y + 0.1 - hair))
    permitted = ~forbidden_cells(zone, SPEC)
    assert not (held & ~permitted).any() and not (permitted & ~nearly).any()


@law(20)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_a_zone_too_large_to_be_drawn_at_once_is_the_same_in_parts(seed: int, whole: bool) -> None:
    rng = np.random.default_rng(seed)
    polygon = np.array(star(seed, 9)) * 60.0
    spec = GridSpec(
        resolution_m=0.05,
        rows=1500,
        cols=1400,
        origin_x_m=float(rng.uniform(-80, 10)),
        origin_y_m=float(rng.uniform(-80, 10)),
    )
    cells = rasterise(polygon.tolist(), spec, whole=whole)
    small = rasterise(polygon.tolist(), spec.part(500, 300, 900, 1000), whole=whole)
    np.testing.assert_array_equal(small, cells[500:900, 300:1000])
    shape = Polygon(polygon)
    shapely.prepare(shape)
    for row, col in rng.integers(0, [spec.rows, spec.cols], (400, 2)).tolist():
        x_m, y_m = spec.centre(row, col)
        inner, outer = (
            shapely.box(*(np.array([x_m, y_m] * 2) + side * np.array([-1, -1, 1, 1])))
            for side in (0.024, 0.026)
        )
        if whole:
            assert cells[row, col] or not shape.covers(outer)
            assert not cells[row, col] or shape.covers(inner)
        else:
            assert cells[row, col] or not shape.intersects(inner)
            assert not cells[row, col] or shape.distance(shapely.Point(x_m, y_m)) < 0.1


@law(60)
@given(st.integers(0, 2**32 - 1))
def test_a_part_of_a_map_gets_the_cells_of_a_zone_that_the_whole_map_gets_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    origin = rng.uniform(-20, 0, 2)
    spec = GridSpec(
        resolution_m=0.05, rows=500, cols=600, origin_x_m=origin[0], origin_y_m=origin[1]
    )
    ends = np.sort(rng.uniform(0, 1, (2, 2)) * [30, 25], axis=0) + origin  # a long, oblique strip
    across = rng.uniform(0.05, 2.0) * np.array([1.0, -1.0])
    strip = np.array([ends[0], ends[0] + across, ends[1] + across, ends[1]])
    whole = rasterise(strip.tolist(), spec)
    top, bottom = np.sort(rng.choice(501, 2, replace=False)).tolist()
    left, right = np.sort(rng.choice(601, 2, replace=False)).tolist()
    part = rasterise(strip.tolist(), spec.part(top, left, bottom, right))
    np.testing.assert_array_equal(part, whole[top:bottom, left:right])
