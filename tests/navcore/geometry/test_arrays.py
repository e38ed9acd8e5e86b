"""Laws of the array helpers."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.arrays import sorted_distinct


@given(st.lists(st.integers(-5, 2**40)))
def test_distinct_numbers_are_those_of_numpy(numbers: list[int]) -> None:
    given_numbers = np.array(numbers, dtype=np.int64)
    assert np.array_equal(sorted_distinct(given_numbers), np.unique(given_numbers))
