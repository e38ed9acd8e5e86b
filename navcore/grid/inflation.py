"""Inflation by a disc on bit planes, only where cells have changed; equal bit for bit to
`navcore.grid.grid.inflate`."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined, lean, nested
from navcore.geometry.arrays import Indices, Words
from navcore.grid.bitplane import (
    ALL,
    ONE,
    PAD,
    BitPlane,
    BitPlanes,
    complement,
    highest,
    joined_left,
    lowest,
    pack,
)
from navcore.grid.free_space import FREE, REBUILD_SHARE, FreeSpace, refresh, write_word
from navcore.grid.grid import BoolGrid
from navcore.grid.growth import Growth

CHUNK_WORDS = 1024
"""Number of words that are inflated together, so that they stay in the first-level cache."""


class InflatedGrid:
    """Layers of occupied cells, each inflated by a disc of its own radius, and the remaining free
    space."""

    def __init__(self, rows: int, cols: int) -> None:
        self.space = FreeSpace(rows, cols)
        """Cells that the robot's centre may be in; all at first."""
        self._radii: tuple[int, ...] = ()
        self._raw: BitPlanes = np.zeros((0, *self.space.across.shape[1:]), dtype=np.uint64)
        self._fresh = self._raw.copy()
        self._halves: Indices = np.zeros((0, 1), dtype=np.int64)
        complement(self.space.across[FREE], rows, cols)
        self.space.rebuild()

    def update(self, masks: Mapping[int, BoolGrid]) -> None:
        """Update to the occupied cells, a bool (rows, cols) grid for each radius in cells; other
        radii are dropped.

        Costs one pass over the cells, and then only the changes.
        """
        self._add_layers(tuple(masks))
        for layer, radius in enumerate(self._radii):
            if radius in masks:
                self._check(masks[radius])
                pack(masks[radius], self._fresh[layer])
            else:
                self._fresh[layer] = 0
        self._apply_fresh()
        self._keep_only(masks)

    def replace(self, planes: Mapping[int, BitPlane]) -> None:
        """Update to the occupied cells, a plane for each radius in cells, which is copied; other
        radii are dropped."""
        self._add_layers(tuple(planes))
        for layer, radius in enumerate(self._radii):
            self._fresh[layer] = planes.get(radius, 0)
        self._apply_fresh()
        self._keep_only(planes)

    def grow(self, growth: Growth) -> None:
        """Continue on a larger grid with the same occupied cells; `space` is a new object."""
        old, self.space = self.space, FreeSpace(growth.new.rows, growth.new.cols)
        grown = np.zeros((len(self._radii), *self.space.across.shape[1:]), dtype=np.uint64)
        for layer, plane in enumerate(self._raw):
            grown[layer] = growth.plane(plane)
        self._raw, self._fresh = grown, np.zeros_like(grown)
        self._rebuild()
        self.space.adopt(old, growth)

    @property
    def reach(self) -> int:
        """Distance in cells that a change has an effect on: the largest radius in use."""
        return int(self._halves.shape[1]) - 1

    def set_cells(self, radius: int, cells: Indices, occupied: bool) -> None:
        """Occupy or clear (N, 2) cells (row, col) of the grid in the layer of a radius."""
        if radius not in self._radii:
            self._add_layers((radius,))
        layer, space = self._radii.index(radius), self.space
        if not occupy(
            self._raw, layer, self._halves, cells, occupied, space.rows, space.cols, *space.written
        ):
            self._rebuild()

    def _apply_fresh(self) -> None:
        most = self._raw.shape[1] * self._raw.shape[2] // REBUILD_SHARE
        words = (
            differing_words(self._raw, self._fresh, most)
            if self._radii
            else np.empty((0, 2), np.int64)
        )
        self._raw, self._fresh = self._fresh, self._raw
        self._update_words(words)

    def _add_layers(self, radii: tuple[int, ...]) -> None:
        """Add a layer for each of these radii that has none."""
        new = tuple(radius for radius in radii if radius not in self._radii)
        if new:
            self._radii += new
            self._raw = np.concatenate(
                [self._raw, np.zeros((len(new), *self._raw.shape[1:]), dtype=np.uint64)]
            )
            self._fresh = np.zeros_like(self._raw)
            self._halves = half_widths(self._radii)

    def _keep_only(self, radii: Container[int]) -> None:
        """Drop the layers, now empty, of other radii: the largest radius sets the cost of a
        change."""
        used = [layer for layer, radius in enumerate(self._radii) if radius in radii]
        if 0 < len(used) < len(self._radii):
            self._radii = tuple(self._radii[layer] for layer in used)
            self._raw, self._fresh = self._raw[used], self._fresh[used]
            self._halves = half_widths(self._radii)

    def _check(self, mask: BoolGrid) -> None:
        if mask.shape != (self.space.rows, self.space.cols):
            raise ValueError(
                f"mask: expected the grid's shape ({self.space.rows}, {self.space.cols}), "
                f"got {mask.shape}; make a new InflatedGrid for another grid"
            )

    def _update_words(self, words: Indices) -> None:
        space = self.space
        if len(words) * REBUILD_SHARE > space.sentinel.size:
            self._rebuild()
        elif len(words):
            update_around(self._raw, self._halves, words, space.rows, space.cols, *space.written)

    def _rebuild(self) -> None:
        space = self.space
        free = space.across[FREE]
        free[:] = 0
        inflate_into(
            self._raw, self._halves, free, 0, 0, PAD, PAD + space.rows, 1, free.shape[1] - 1
        )
        complement(free, space.rows, space.cols)
        space.rebuild()


def inflated(planes: Mapping[int, BitPlane], rows: int, cols: int) -> BitPlane:
    """Return the union of at least one plane, each inflated by the disc of its radius in cells."""
    raw = np.stack(list(planes.values()))
    out: BitPlane = np.zeros(raw.shape[1:], dtype=np.uint64)
    inflate_into(raw, half_widths(tuple(planes)), out, 0, 0, PAD, PAD + rows, 1, out.shape[1] - 1)
    # Two complements clear the bits beyond the right border of the grid.
    complement(out, rows, cols)
    complement(out, rows, cols)
    return out


def half_widths(radii: tuple[int, ...]) -> Indices:
    """Return (layers, largest radius + 1) half the width of each disc in cells by the distance in
    rows from its centre; −1 beyond the disc."""
    rows = np.full((len(radii), max(radii) + 1), -1, dtype=np.int64)
    for layer, radius in enumerate(radii):
        rows[layer, : radius + 1] = [math.isqrt(radius**2 - away**2) for away in range(radius + 1)]
    return rows


@compiled
def differing_words(old: BitPlanes, new: BitPlanes, most: int) -> Indices:
    """Return the (N, 2) lines and words in which any layer differs, in order, at most `most` +
    1."""
    found = np.empty((most + 1, 2), dtype=np.int64)
    count = 0
    for line in range(PAD, old.shape[1] - PAD):
        for word in range(1, old.shape[2] - 1):
            differs = np.uint64(0)
            for layer in range(old.shape[0]):
                differs |= old[layer, line, word] ^ new[layer, line, word]
            if differs == 0:
                continue
            found[count, 0], found[count, 1] = line, word
            count += 1
            if count > most:
                return found
    return found[:count]


@compiled
def occupy(
    raw: BitPlanes,
    layer: int,
    halves: Indices,
    cells: Indices,
    occupied: bool,
    rows: int,
    cols: int,
    across: BitPlanes,
    along: BitPlanes,
    sentinel: BitPlane,
    freed: Indices,
    notes: Indices,
) -> bool:
    """Set or clear (N, 2) cells of a layer and update the free space; return False for so many
    cells that everything must be rebuilt."""
    words = set_bits(raw[layer], cells, occupied)
    if len(words) * REBUILD_SHARE > sentinel.size:
        return False
    if len(words):
        update_around(raw, halves, words, rows, cols, across, along, sentinel, freed, notes)
    return True


@nested
def set_bits(plane: BitPlane, cells: npt.NDArray[np.int64], occupied: bool) -> Indices:
    """Set or clear (N, 2) cells; return the (N, 2) changed lines and words in order of the
    cells."""
    changed = np.empty((len(cells), 2), dtype=np.int64)
    count = 0
    for index in range(len(cells)):
        line, word = cells[index, 0] + PAD, (cells[index, 1] + PAD) >> 6
        bit = ONE << np.uint64(cells[index, 1] & 63)
        if ((plane[line, word] & bit) != 0) == occupied:
            continue
        plane[line, word] ^= bit
        changed[count, 0], changed[count, 1] = line, word
        count += 1
    return changed[:count]


@compiled
def update_around(
    raw: BitPlanes,
    halves: Indices,
    words: Indices,
    rows: int,
    cols: int,
    across: BitPlanes,
    along: BitPlanes,
    sentinel: BitPlane,
    freed: Indices,
    notes: Indices,
) -> None:
    """Recompute the free cells around changed words, in rectangles of neighbouring words."""
    reach = halves.shape[1] - 1
    overlap = (reach + 63) >> 6
    first, last, left, right = words[0, 0], words[0, 0] + 1, words[0, 1], words[0, 1] + 1
    for index in range(1, len(words) + 1):
        if index < len(words):
            line, word = words[index, 0], words[index, 1]
            if first - reach <= line <= last + reach and left - 1 <= word <= right:
                first, last = min(first, line), max(last, line + 1)
                left, right = min(left, word), max(right, word + 1)
                continue
        top, bottom = max(first - reach, PAD), min(last + reach, PAD + rows)
        west, east = max(left - overlap, 1), min(right + overlap, across.shape[2] - 1)
        _recompute(
            raw, halves, cols, across, along, sentinel, freed, notes, top, bottom, west, east
        )
        if index < len(words):
            first, last, left, right = line, line + 1, word, word + 1


@nested
def _recompute(
    raw: BitPlanes,
    halves: Indices,
    cols: int,
    across: BitPlanes,
    along: BitPlanes,
    sentinel: BitPlane,
    freed: Indices,
    notes: Indices,
    top: int,
    bottom: int,
    west: int,
    east: int,
) -> None:
    """Recompute the free cells of lines top … bottom−1 and words west … east−1."""
    out = np.zeros((bottom - top, east - west), dtype=np.uint64)
    inflate_into(raw, halves, out, top, west, top, bottom, west, east)
    first, last, left, right = bottom, top, 64 * east, 64 * west
    for line in range(top, bottom):
        for word in range(west, east):
            value = ~out[line - top, word - west] & on_grid(word, cols)
            if across[FREE, line, word] != value:
                changed = write_word(across, along, sentinel, freed, notes, line, word, value)
                first, last = min(first, line), line + 1
                left = min(left, 64 * word + lowest(changed))
                right = max(right, 64 * word + highest(changed) + 1)
    if first < last:
        refresh(across, along, first, last, left, right)


@inlined
def on_grid(word: int, cols: int) -> np.uint64:
    """Return the cells of a word between the paddings that are on the grid."""
    beyond = 64 * word - cols
    return (
        ALL if beyond <= 0 else ALL >> np.uint64(min(beyond, 63)) if beyond < 64 else np.uint64(0)
    )


@compiled
def inflate_into(
    raw: BitPlanes,
    halves: Indices,
    out: BitPlane,
    line_0: int,
    word_0: int,
    top: int,
    bottom: int,
    west: int,
    east: int,
) -> None:
    """Set the cells of every disc in lines top … bottom−1 and words west … east−1; `out` begins at
    (line_0, word_0)."""
    overlap = (halves.shape[1] + 62) >> 6
    left, right = max(west - overlap, 0), min(east + overlap, raw.shape[2])
    stride = right - left + 2 * overlap
    chunk = min(max(CHUNK_WORDS // stride, 1), bottom - top)
    lines, spare = (
        np.zeros(chunk * stride + 2, dtype=np.uint64),
        np.zeros(chunk * stride + 2, dtype=np.uint64),
    )
    for layer in range(raw.shape[0]):
        for first in range(top, bottom, chunk):
            last = min(first + chunk, bottom)
            cells, half = raw[layer], halves[layer]
            _inflate_rows(
                cells,
                half,
                first,
                last,
                left,
                right,
                overlap,
                lines,
                spare,
                out,
                line_0,
                word_0,
                west,
                east,
            )


@lean
def _inflate_rows(
    raw: BitPlane,
    halves: Indices,
    first: int,
    last: int,
    left: int,
    right: int,
    overlap: int,
    lines: Words,
    spare: Words,
    out: BitPlane,
    line_0: int,
    word_0: int,
    west: int,
    east: int,
) -> None:
    """Set in rows first … last−1 and words west … east−1 the discs of the occupied cells in words
    left … right−1.

    A disc is widest in its middle row and narrower with the distance from it. So the occupied cells
    are collected from the middle row outwards, and the collected ones are widened by the difference
    to the next distance. Many rows go through each step together, because words that have just been
    written are slow to read; twice `overlap` words between two rows take what is widened beyond
    their ends.
    """
    stride, found = right - left + 2 * overlap, False
    size = (last - first) * stride + 2
    for word in range(size):
        lines[np.uint64(word)] = np.uint64(0)
    for away in range(len(halves)):
        if halves[away] < 0:
            break
        for row in range(first, last):
            above, below = max(row - away, 0), min(row + away, raw.shape[0] - 1)
            found |= collect(
                raw, above, below, left, right, lines, 1 + (row - first) * stride + overlap
            )
        done, by = 0, halves[away] - (max(halves[away + 1], 0) if away + 1 < len(halves) else 0)
        while found and done < by:
            # A line widened by n can be widened by another 2n + 1 at once without leaving gaps.
            step = min(2 * done + 1, by - done, 63)
            widen(lines, spare, size, step)
            lines, spare, done = spare, lines, done + step
    if found:
        for row in range(first, last):
            merge(
                lines,
                1 + (row - first) * stride + overlap + west - left,
                out,
                row - line_0,
                west - word_0,
                east - word_0,
            )


@inlined
def collect(
    raw: BitPlane, above: int, below: int, left: int, right: int, lines: Words, at: int
) -> bool:
    """Add words left … right−1 of two rows of a layer to a line; return whether any cell is
    occupied."""
    found = np.uint64(0)
    for word in range(right - left):
        both = (
            raw[np.uint64(above), np.uint64(left + word)]
            | raw[np.uint64(below), np.uint64(left + word)]
        )
        lines[np.uint64(at + word)] |= both
        found |= both
    return bool(found != 0)


@inlined
def widen(lines: Words, wider: Words, size: int, by: int) -> None:
    """Write the lines widened by 1 to 63 cells to both sides."""
    up, rest = np.uint64(by), np.uint64(64 - by)
    for number in range(1, size - 1):
        at, before, after = np.uint64(number), np.uint64(number - 1), np.uint64(number + 1)
        here = lines[at]
        wider[at] = (
            here | joined_left(here, lines[before], up) | joined_left(lines[after], here, rest)
        )


@inlined
def merge(lines: Words, at: int, out: BitPlane, row: int, left: int, right: int) -> None:
    """Add a line to words left … right−1 of a row of the result."""
    for word in range(right - left):
        out[np.uint64(row), np.uint64(left + word)] |= lines[np.uint64(at + word)]
