"""The table of points adds what a slow and plain rule says, whatever a cell holds already."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.mapping.points.cell_set import distinct
from navcore.mapping.points.point_links import Records
from navcore.mapping.points.point_table import POINT, PointTable
from tests.kernels import from_python
from tests.navcore.laws import law

call_distinct = from_python(distinct)

CELLS, CLASSES, LEVELS = 6, 2, 3
SEEDS = st.integers(0, 2**32 - 1)


def points(rng: np.random.Generator, count: int) -> Records:
    """Return points that share cells, some off the grid and some uncertain, told apart by x."""
    new = np.zeros(count, dtype=POINT)
    new["x"] = rng.random(count)
    new["cell"] = rng.integers(-1, CELLS, count)
    new["class_id"] = rng.integers(0, CLASSES, count)
    new["level"] = rng.integers(0, LEVELS, count)
    new["confidence"] = np.where(rng.random(count) < 0.7, 1.0, rng.random(count))
    return new


def plainly_added(held: list[np.void], new: Records, one_per_cell: bool) -> list[np.void]:
    for one in new:
        alike = [
            other
            for other in held
            if 0 <= other["cell"] == one["cell"]
            and other["class_id"] == one["class_id"]
            and (one_per_cell or other["level"] == one["level"])
        ]
        if alike:
            best = max(alike, key=lambda other: float(other["confidence"]))
            best["confidence"] = max(best["confidence"], one["confidence"])
        else:
            held.append(one.copy())
    return held


@law(40)
@given(seed=SEEDS, one_per_cell=st.booleans())
def test_a_voxel_takes_one_point_of_a_class_and_the_highest_confidence(
    seed: int, one_per_cell: bool
) -> None:
    rng = np.random.default_rng(seed)
    table, expected = PointTable(CELLS), list[np.void]()
    table.append(points(rng, 8))  # several in one voxel, as after a correction of poses
    expected = [one.copy() for one in table.live]
    for _ in range(3):
        new = points(rng, int(rng.integers(0, 20)))
        table.add(new, one_per_cell=one_per_cell)
        expected = plainly_added(expected, new, one_per_cell)
    assert len(expected) == table.count
    for field in ("x", "cell", "class_id", "level", "confidence"):
        assert [one[field] for one in expected] == table.live[field].tolist()


@law(40)
@given(seed=SEEDS, count=st.integers(0, 300))
def test_each_cell_is_found_once_in_the_order_of_its_first_occurrence(
    seed: int, count: int
) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, int(rng.choice([3, 100, 9_000_000])), count)
    assert call_distinct(cells).tolist() == list(dict.fromkeys(cells.tolist()))
