"""Inflation by the disc on packed bits, and only where cells have changed; equal bit for bit to
`navcore.grid.inflate`."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled, inlined, lean
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
from navcore.grid.free_space import FREE, MANY, FreeSpace, refresh, write_word
from navcore.grid.grid import BoolGrid

AT_ONCE = 1024
"""So many words are inflated together: they stay in the cache next to the processor."""


class InflatedGrid:
    """Occupied cells in layers, each inflated by a disc of its own radius, and the space that they
    leave free."""

    def __init__(self, rows: int, cols: int) -> None:
        self.space = FreeSpace(rows, cols)
        """Where the robot's centre may be; everywhere at first."""
        self._radii: tuple[int, ...] = ()
        self._raw: BitPlanes = np.zeros((0, *self.space.across.shape[1:]), dtype=np.uint64)
        self._fresh = self._raw.copy()
        self._halves: Indices = np.zeros((0, 1), dtype=np.int64)
        complement(self.space.across[FREE], rows, cols)
        self.space.rebuild()

    def update(self, masks: Mapping[int, BoolGrid]) -> None:
        """Follow the occupied cells: a bool (rows, cols) grid for each radius in cells; a radius
        not named has none.

        Costs one look at every cell and then only what the changes cost.
        """
        self._make_room(tuple(masks))
        for layer, radius in enumerate(self._radii):
            if radius in masks:
                self._check(masks[radius])
                pack(masks[radius], self._fresh[layer])
            else:
                self._fresh[layer] = 0
        self._take_fresh()
        self._drop_all_but(masks)

    def replace(self, planes: Mapping[int, BitPlane]) -> None:
        """The same for packed cells (`navcore.search.bits`), which are copied."""
        self._make_room(tuple(planes))
        for layer, radius in enumerate(self._radii):
            self._fresh[layer] = planes.get(radius, 0)
        self._take_fresh()
        self._drop_all_but(planes)

    @property
    def reach(self) -> int:
        """How far about a change is looked, in cells: the widest radius in use."""
        return int(self._halves.shape[1]) - 1

    def set_cells(self, radius: int, cells: Indices, occupied: bool) -> None:
        """Occupy or clear the (N, 2) cells (row, col) of the layer of a radius, all of them on the
        grid."""
        if radius not in self._radii:
            self._make_room((radius,))
        layer, space = self._radii.index(radius), self.space
        if not occupy(
            self._raw, layer, self._halves, cells, occupied, space.rows, space.cols, *space.written
        ):
            self._follow_all()

    def _take_fresh(self) -> None:
        most = self._raw.shape[1] * self._raw.shape[2] // MANY
        words = (
            differing_words(self._raw, self._fresh, most)
            if self._radii
            else np.empty((0, 2), np.int64)
        )
        self._raw, self._fresh = self._fresh, self._raw
        self._follow(words)

    def _make_room(self, radii: tuple[int, ...]) -> None:
        """Have a layer for each of these radii."""
        new = tuple(radius for radius in radii if radius not in self._radii)
        if new:
            self._radii += new
            self._raw = np.concatenate(
                [self._raw, np.zeros((len(new), *self._raw.shape[1:]), dtype=np.uint64)]
            )
            self._fresh = np.zeros_like(self._raw)
            self._halves = half_widths(self._radii)

    def _drop_all_but(self, radii: Container[int]) -> None:
        """Give up the layers, empty by now, of other radii: the widest one says how far every
        change is followed."""
        used = [layer for layer, radius in enumerate(self._radii) if radius in radii]
        if 0 < len(used) < len(self._radii):
            self._radii = tuple(self._radii[layer] for layer in used)
            self._raw, self._fresh = self._raw[used], self._fresh[used]
            self._halves = half_widths(self._radii)

    def _check(self, mask: BoolGrid) -> None:
        if mask.shape != (self.space.rows, self.space.cols):
            raise ValueError(
                f"mask: expected the grid's shape ({self.space.rows}, {self.space.cols}), got {mask.shape}; "
                "make a new InflatedGrid for another grid"
            )

    def _follow(self, words: Indices) -> None:
        space = self.space
        if len(words) * MANY > space.sentinel.size:
            self._follow_all()
        elif len(words):
            follow(self._raw, self._halves, words, space.rows, space.cols, *space.written)

    def _follow_all(self) -> None:
        space = self.space
        free = space.across[FREE]
        free[:] = 0
        inflate_into(
            self._raw, self._halves, free, 0, 0, PAD, PAD + space.rows, 1, free.shape[1] - 1
        )
        complement(free, space.rows, space.cols)
        space.rebuild()


def inflated(planes: Mapping[int, BitPlane], rows: int, cols: int) -> BitPlane:
    """The union of packed cells, each plane inflated by the disc of its radius in cells, from
    scratch; one plane at least."""
    raw = np.stack(list(planes.values()))
    out: BitPlane = np.zeros(raw.shape[1:], dtype=np.uint64)
    inflate_into(raw, half_widths(tuple(planes)), out, 0, 0, PAD, PAD + rows, 1, out.shape[1] - 1)
    # What reaches beyond the grid on its right is cut off.
    complement(out, rows, cols)
    complement(out, rows, cols)
    return out


def half_widths(radii: tuple[int, ...]) -> Indices:
    """(layers, largest radius + 1) how many cells the disc reaches to the side at each distance in
    rows; -1 beyond it."""
    rows = np.full((len(radii), max(radii) + 1), -1, dtype=np.int64)
    for layer, radius in enumerate(radii):
        rows[layer, : radius + 1] = [math.isqrt(radius**2 - away**2) for away in range(radius + 1)]
    return rows


@compiled
def differing_words(old: BitPlanes, new: BitPlanes, most: int) -> Indices:
    """(N, 2) lines and words at which any layer differs, in order; no more than one beyond `most`."""
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
    """Set or clear (N, 2) cells of a layer and follow that; False if it is so many that all is to
    be made anew."""
    words = set_bits(raw[layer], cells, occupied)
    if len(words) * MANY > sentinel.size:
        return False
    if len(words):
        follow(raw, halves, words, rows, cols, across, along, sentinel, freed, notes)
    return True


@compiled
def set_bits(plane: BitPlane, cells: npt.NDArray[np.int64], occupied: bool) -> Indices:
    """Set or clear (N, 2) cells; returns the (N, 2) lines and words that changed, in order of the
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
def follow(
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
    """Make the free cells anew around the changed words, in rectangles of words that lie close
    together."""
    reach = halves.shape[1] - 1
    aside = (reach + 63) >> 6
    first, last, left, right = words[0, 0], words[0, 0] + 1, words[0, 1], words[0, 1] + 1
    for index in range(1, len(words) + 1):
        if index < len(words):
            line, word = words[index, 0], words[index, 1]
            if first - reach <= line <= last + reach and left - 1 <= word <= right:
                first, last = min(first, line), max(last, line + 1)
                left, right = min(left, word), max(right, word + 1)
                continue
        top, bottom = max(first - reach, PAD), min(last + reach, PAD + rows)
        west, east = max(left - aside, 1), min(right + aside, across.shape[2] - 1)
        _renew(raw, halves, cols, across, along, sentinel, freed, notes, top, bottom, west, east)
        if index < len(words):
            first, last, left, right = line, line + 1, word, word + 1


@compiled
def _renew(
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
    """Make the free cells of lines top … bottom-1 and words west … east-1 anew from the occupied
    ones."""
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
    """Which cells of a word between the paddings lie on the grid."""
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
    """Set in lines top … bottom-1 and words west … east-1 the cells of every disc; `out` begins at
    (line_0, word_0)."""
    aside = (halves.shape[1] + 62) >> 6
    left, right = max(west - aside, 0), min(east + aside, raw.shape[2])
    stride = right - left + 2 * aside
    at_once = min(max(AT_ONCE // stride, 1), bottom - top)
    lines, spare = (
        np.zeros(at_once * stride + 2, dtype=np.uint64),
        np.zeros(at_once * stride + 2, dtype=np.uint64),
    )
    for layer in range(raw.shape[0]):
        for first in range(top, bottom, at_once):
            last = min(first + at_once, bottom)
            cells, half = raw[layer], halves[layer]
            _inflate_rows(
                cells,
                half,
                first,
                last,
                left,
                right,
                aside,
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
    aside: int,
    lines: Words,
    spare: Words,
    out: BitPlane,
    line_0: int,
    word_0: int,
    west: int,
    east: int,
) -> None:
    """Set in rows first … last-1 and words west … east-1 the cells of every disc of what is
    occupied in words left … right-1.

    A disc is as wide as it is at its middle only there, and narrower the farther away in rows. So
    the occupied cells are collected from the middle row outwards, and what has been collected is
    widened by as much as the disc is narrower at the next. Many rows go through each step together,
    for words that have just been written are slow to read; between two rows lie twice `aside` words
    for what is widened beyond their ends.
    """
    stride, found = right - left + 2 * aside, False
    size = (last - first) * stride + 2
    for word in range(size):
        lines[np.uint64(word)] = np.uint64(0)
    for away in range(len(halves)):
        if halves[away] < 0:
            break
        for row in range(first, last):
            above, below = max(row - away, 0), min(row + away, raw.shape[0] - 1)
            found |= collect(
                raw, above, below, left, right, lines, 1 + (row - first) * stride + aside
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
                1 + (row - first) * stride + aside + west - left,
                out,
                row - line_0,
                west - word_0,
                east - word_0,
            )


@inlined
def collect(
    raw: BitPlane, above: int, below: int, left: int, right: int, lines: Words, at: int
) -> bool:
    """Add words left … right-1 of two rows of a layer to a line; whether any of their cells is
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
    """Write the lines widened to both sides by 1 to 63 cells."""
    up, rest = np.uint64(by), np.uint64(64 - by)
    for number in range(1, size - 1):
        at, before, after = np.uint64(number), np.uint64(number - 1), np.uint64(number + 1)
        here = lines[at]
        wider[at] = (
            here | joined_left(here, lines[before], up) | joined_left(lines[after], here, rest)
        )


@inlined
def merge(lines: Words, at: int, out: BitPlane, row: int, left: int, right: int) -> None:
    """Add a line to words left … right-1 of a row of the result."""
    for word in range(right - left):
        out[np.uint64(row), np.uint64(left + word)] |= lines[np.uint64(at + word)]
