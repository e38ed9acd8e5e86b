"""Maps and queries of the MovingAI benchmark (Sturtevant, "Benchmarks for Grid-Based Pathfinding",
2012).

x is a column, y a row, and row 0 is the file's first line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navcore.errors import BadConfiguration
from navcore.files import read_whole
from navcore.formats.map_image import MAX_BYTES, MAX_PIXELS, MAX_SIDE
from navcore.grid.grid import BoolGrid, Cell

PASSABLE, IMPASSABLE = b".GS", b"@OTW"
"""Letters of free cells (ground, ground, swamp) and blocked cells (out of bounds twice, trees, and
water, which cannot be entered from ground)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """Path query: one line of a `.scen` file."""

    bucket: int
    """Number of the group of queries of about the same length."""
    map_name: str
    """Path of the map in the benchmark."""
    rows: int
    """Height of the map in cells."""
    cols: int
    """Width of the map in cells."""
    start: Cell
    """Start cell (row, col)."""
    goal: Cell
    """Goal cell (row, col)."""
    length: float
    """Length of the shortest path in cells; a diagonal step is √2 and needs both orthogonal
    neighbours free."""


def load_map(path: Path) -> BoolGrid:
    """Return (rows, cols), True for blocked cells; raises `BadConfiguration` with the line and the
    error."""
    lines = read_whole(path, at_most=MAX_BYTES).splitlines()
    if _value(lines, 0, b"type", path) != "octile":
        raise BadConfiguration(
            f"{path.name}, line 1: expected 'type octile', got {_shown(lines, 0)}"
        )
    rows, cols = (_side(lines, at, key, path) for at, key in ((1, b"height"), (2, b"width")))
    if rows * cols > MAX_PIXELS:
        raise BadConfiguration(
            f"{path.name}: {cols} × {rows} cells, at most {MAX_PIXELS} are allowed"
        )
    if len(lines) < 4 or lines[3].strip() != b"map":
        raise BadConfiguration(f"{path.name}, line 4: expected 'map', got {_shown(lines, 3)}")
    body = lines[4 : 4 + rows]
    if len(body) < rows or any(line.strip() for line in lines[4 + rows :]):
        raise BadConfiguration(f"{path.name}: expected {rows} lines of map, got {len(lines) - 4}")
    for at, line in enumerate(body):
        if len(line) != cols:
            raise BadConfiguration(
                f"{path.name}, line {at + 5}: expected {cols} letters, got {len(line)}"
            )
    return _blocked(b"".join(body), rows, cols, path)


def load_scenario(path: Path) -> tuple[Query, ...]:
    """Return the queries of a `.scen` file; raises `BadConfiguration` with the line and the column
    of the error."""
    lines = read_whole(path, at_most=MAX_BYTES).splitlines()
    if _value(lines, 0, b"version", path) not in ("1", "1.0"):
        raise BadConfiguration(f"{path.name}, line 1: expected 'version 1', got {_shown(lines, 0)}")
    return tuple(
        _query(line, f"{path.name}, line {at}")
        for at, line in enumerate(lines[1:], start=2)
        if line.strip()
    )


def _blocked(letters: bytes, rows: int, cols: int, path: Path) -> BoolGrid:
    terrain = np.full(256, 2, dtype=np.uint8)
    terrain[list(PASSABLE)], terrain[list(IMPASSABLE)] = 0, 1
    kinds = terrain[np.frombuffer(letters, dtype=np.uint8)].reshape(rows, cols)
    if (kinds == 2).any():
        row, col = (int(number) for number in np.argwhere(kinds == 2)[0])
        letter = chr(letters[row * cols + col])
        raise BadConfiguration(
            f"{path.name}, line {row + 5}: unknown terrain {letter!r} in column {col}; known: "
            ".GS@OTW"
        )
    return kinds.view(np.bool_)


def _query(line: bytes, where: str) -> Query:
    words = (
        line.decode("utf-8", "replace").split("\t")
        if b"\t" in line
        else line.decode("utf-8", "replace").split()
    )
    if len(words) != 9:
        raise BadConfiguration(f"{where}: expected 9 columns, got {len(words)}")
    names = ("bucket", "width", "height", "start x", "start y", "goal x", "goal y")
    texts = (words[0], *words[2:8])
    bucket, cols, rows, start_x, start_y, goal_x, goal_y = (
        _whole(text, f"{where}: {name}") for name, text in zip(names, texts, strict=True)
    )
    for name, x, y in (("start", start_x, start_y), ("goal", goal_x, goal_y)):
        if x >= cols or y >= rows:
            raise BadConfiguration(
                f"{where}: {name} ({x}, {y}) lies outside the map, {cols} × {rows} cells"
            )
    return Query(
        bucket=bucket,
        map_name=words[1],
        rows=rows,
        cols=cols,
        start=(start_y, start_x),
        goal=(goal_y, goal_x),
        length=_length(words[8], where),
    )


def _length(text: str, where: str) -> float:
    try:
        length = float(text)
    except ValueError:
        length = math.nan
    if not (math.isfinite(length) and length >= 0):
        raise BadConfiguration(
            f"{where}: length: expected a number of at least 0, got {text!r:.40}"
        )
    return length


def _whole(text: str, where: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise BadConfiguration(f"{where}: expected a whole number of at least 0, got {text!r:.40}")
    return int(text)


def _value(lines: list[bytes], at: int, key: bytes, path: Path) -> str:
    """Return the value of a key in a line of the header."""
    words = lines[at].split() if at < len(lines) else []
    if len(words) != 2 or words[0] != key:
        raise BadConfiguration(
            f"{path.name}, line {at + 1}: expected {key.decode()!r} and a value, got "
            f"{_shown(lines, at)}"
        )
    return words[1].decode("utf-8", "replace")


def _side(lines: list[bytes], at: int, key: bytes, path: Path) -> int:
    side = _whole(_value(lines, at, key, path), f"{path.name}, line {at + 1}: {key.decode()}")
    if not 1 <= side <= MAX_SIDE:
        raise BadConfiguration(
            f"{path.name}, line {at + 1}: {key.decode()} {side} is out of range, allowed 1 to "
            f"{MAX_SIDE}"
        )
    return side


def _shown(lines: list[bytes], at: int) -> str:
    return (
        f"{lines[at][:40].decode('utf-8', 'replace')!r}"
        if at < len(lines)
        else "the end of the file"
    )
