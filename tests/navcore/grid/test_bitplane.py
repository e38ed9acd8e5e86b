"""Packed planes equal the grids they were packed from."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from navcore.grid.bitplane import empty_plane, highest, lowest, mirrored, pack, transpose, unpack
from navcore.grid.grid import BoolGrid
from tests.kernels import from_python
from tests.navcore.grid.random_grids import grids
from tests.navcore.laws import law

call_transpose = from_python(transpose)


@numba.njit(cache=True)
def described(word: np.uint64) -> tuple[int, int, np.uint64]:
    return lowest(word), highest(word), mirrored(word)


@law(100)
@given(st.integers(1, 2**64 - 1))
def test_the_machine_instructions_do_what_their_names_say(word: int) -> None:
    low, high, turned = described(np.uint64(word))
    assert (low, high) == ((word & -word).bit_length() - 1, word.bit_length() - 1)
    assert int(turned) == int(f"{word:064b}"[::-1], 2)


@law(60)
@given(grids())
def test_unpacking_a_packed_grid_gives_the_grid(mask: BoolGrid) -> None:
    plane = empty_plane(*mask.shape)
    pack(mask, plane)
    np.testing.assert_array_equal(unpack(plane, *mask.shape), mask)
    assert int(np.bitwise_count(plane).sum()) == int(mask.sum()), "the padding is empty"


@law(60)
@given(grids())
def test_the_transposed_plane_is_the_plane_of_the_transposed_grid(mask: BoolGrid) -> None:
    plane, turned, expected = (
        empty_plane(*shape) for shape in (mask.shape, mask.T.shape, mask.T.shape)
    )
    pack(mask, plane)
    call_transpose(plane, turned)
    pack(mask.T, expected)
    np.testing.assert_array_equal(turned, expected)


def test_any_byte_but_zero_counts_as_set() -> None:
    mask: npt.NDArray[np.uint8] = np.arange(256, dtype=np.uint8).reshape(2, 128)
    plane = empty_plane(2, 128)
    pack(mask.view(np.bool_), plane)
    assert int(np.bitwise_count(plane).sum()) == 255
