"""Where and when people were last seen, by places of the map frame.

A person whom the network sees is on the map as their class. An image may err, and people walk on
unseen: where none has been seen or followed for a while, the map holds no person any more.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt

from navcore.geometry.arrays import Indices, Points, sorted_distinct
from navcore.grid.grid import GridSpec

_PLACE_M = 0.5
"""Side of a place in metres."""
_KEY = 1 << 32
"""Factor of a column in a number that stands for a place."""
Places = npt.NDArray[np.int64]
"""(N, 2) places, x and y in units of their side."""


class PeopleSightings:
    """The time of the last sighting at each place where a person was seen lately."""

    def __init__(self, kept_s: float) -> None:
        """Sightings become old after a time in seconds."""
        self._kept_ns = round(1e9 * kept_s)
        self._seen_ns = dict[tuple[int, int], int]()

    def note(self, positions: Points, stamp_ns: int, within_m: float = 0.0) -> None:
        """Note people at (N, 2) positions in metres of the map frame, or anywhere within a distance
        of them."""
        reach = range(-math.ceil(within_m / _PLACE_M), math.ceil(within_m / _PLACE_M) + 1)
        columns, rows = np.floor(positions / _PLACE_M).astype(np.int64).T
        keys = sorted_distinct(columns * _KEY + rows)
        columns = (keys + _KEY // 2) // _KEY
        places = zip(columns.tolist(), (keys - columns * _KEY).tolist(), strict=True)
        for (x, y), dx, dy in itertools.product(places, reach, reach):
            self._seen_ns[x + dx, y + dy] = stamp_ns

    def take_old(self, stamp_ns: int, spec: GridSpec) -> Indices:
        """Forget the sightings that are old by now, or later than now, and return the (N,) distinct
        cells of the grid, row · cols + col, at their places and beside them where no newer one
        is."""
        first_ns = stamp_ns - self._kept_ns
        old = [at for at, seen_ns in self._seen_ns.items() if not first_ns < seen_ns <= stamp_ns]
        if not old:
            return np.empty(0, dtype=np.int64)
        for at in old:
            del self._seen_ns[at]
        beside = itertools.product(old, (-1, 0, 1), (-1, 0, 1))
        around = {(x + dx, y + dy) for (x, y), dx, dy in beside}
        return _cells(np.array(sorted(around - self._seen_ns.keys())).reshape(-1, 2), spec)

    def clear(self) -> None:
        """Forget all sightings."""
        self._seen_ns.clear()


def _cells(places: Places, spec: GridSpec) -> Indices:
    """Return the (N,) cells of the grid at places."""
    count = math.ceil(_PLACE_M / spec.resolution_m)
    within = np.stack(np.meshgrid(*[(np.arange(count) + 0.5) / count] * 2), axis=-1)
    positions = (places[:, None] + within.reshape(1, -1, 2)) * _PLACE_M
    return spec.cells_at(positions.reshape(-1, 2))
