"""The part of a path that no image has shown is named and measured."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.planning.unseen_parts import unseen_m, unseen_parts

SPEC = GridSpec.centred(size_m=(10.0, 4.0), resolution_m=0.1)
LINE = np.column_stack([np.arange(-4.05, 4.0, 0.1), np.full(81, 0.05)])


def test_the_unseen_part_of_a_path_is_counted_in_metres() -> None:
    seen = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    seen[:, : SPEC.cell(1.0, 0.0)[1]] = True
    parts = unseen_parts(LINE, CellMask.of(seen), SPEC)
    assert len(parts) == 1
    ((first, last),) = parts
    assert last == len(LINE) - 1 and LINE[first, 0] == pytest.approx(1.05)
    assert unseen_m(LINE, parts) == pytest.approx(3.0, abs=0.11)


def test_single_cells_between_rows_of_pixels_are_no_unseen_part() -> None:
    seen = np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_)
    seen[:, ::4] = False
    assert unseen_parts(LINE, CellMask.of(seen), SPEC) == ()
    assert unseen_m(LINE, ()) == 0.0


def test_a_path_without_points_has_no_parts_and_points_beyond_the_map_are_unseen() -> None:
    seen = CellMask.of(np.ones((SPEC.rows, SPEC.cols), dtype=np.bool_))
    assert unseen_parts(np.empty((0, 2)), seen, SPEC) == ()
    assert unseen_parts(LINE + 100.0, seen, SPEC) == ((0, len(LINE) - 1),)
