"""MovingAI maps and queries: the terrain of every letter, and errors named by line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from navcore.errors import BadConfiguration
from navcore.formats.moving_ai import load_map, load_scenario
from navcore.planning.path import Path as GridPath
from navcore.planning.planner import plan
from tests.navcore.planning.test_planner import map_data

HEAD = "type octile\nheight 2\nwidth 7\nmap\n"
QUERY = "3\tmaps/a b.map\t7\t2\t0\t1\t2\t0\t2.41421356"


def stored(folder: Path, text: str, name: str = "a.map") -> Path:
    (folder / name).write_bytes(text.encode())
    return folder / name


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_ground_and_swamp_can_be_entered_and_all_else_cannot(tmp_path: Path, end: str) -> None:
    blocked = load_map(stored(tmp_path, (HEAD + ".GS@OTW\nW......\n").replace("\n", end)))
    assert blocked.tolist() == [[False] * 3 + [True] * 4, [True] + [False] * 6]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1: expected 'type' and a value, got the end of the file"),
        ("type tile\n", "line 1: expected 'type octile', got 'type tile'"),
        ("type octile\nwidth 7\n", "line 2: expected 'height' and a value, got 'width 7'"),
        (
            "type octile\nheight -2\n",
            "line 2: height: expected a whole number of at least 0, got '-2'",
        ),
        ("type octile\nheight 0\nwidth 7\nmap\n", "line 2: height 0 is out of range"),
        ("type octile\nheight 99999999\nwidth 7\nmap\n", "line 2: height 99999999 is out of range"),
        ("type octile\nheight 60000\nwidth 60000\nmap\n", "60000 × 60000 cells"),
        ("type octile\nheight 2\nwidth 7\n.......\n", "line 4: expected 'map'"),
        (HEAD + ".......\n", "expected 2 lines of map, got 1"),
        (HEAD + ".......\n" * 3, "expected 2 lines of map, got 3"),
        (HEAD + ".......\n......\n", "line 6: expected 7 letters, got 6"),
        (HEAD + ".......\n..x....\n", "line 6: unknown terrain 'x' in column 2"),
    ],
)
def test_a_map_that_is_wrong_is_refused_by_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(BadConfiguration) as refusal:
        load_map(stored(tmp_path, text))
    assert words in str(refusal.value)


def test_a_query_has_its_columns_as_x_and_its_rows_as_y(tmp_path: Path) -> None:
    (query,) = load_scenario(stored(tmp_path, f"version 1\n{QUERY}\n\n", "a.scen"))
    assert (query.bucket, query.map_name, query.rows, query.cols) == (3, "maps/a b.map", 2, 7)
    assert (query.start, query.goal, query.length) == ((1, 0), (0, 2), 2.41421356)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("version 2\n", "line 1: expected 'version 1', got 'version 2'"),
        ("version 1\n1\t2\n", "line 2: expected 9 columns, got 2"),
        (f"version 1\n{QUERY.replace('2.41421356', 'nan')}\n", "line 2: length: expected a number"),
        (f"version 1\n{QUERY.replace('3', 'x', 1)}\n", "line 2: bucket: expected a whole number"),
        (
            f"version 1\n{QUERY}\n{QUERY.replace('	1	2	0', '	2	2	0')}\n",
            "line 3: start (0, 2) lies outside the map",
        ),
    ],
)
def test_a_query_that_is_wrong_is_refused_by_line_and_column(
    tmp_path: Path, text: str, words: str
) -> None:
    with pytest.raises(BadConfiguration) as refusal:
        load_scenario(stored(tmp_path, text, "a.scen"))
    assert words in str(refusal.value)


@pytest.mark.parametrize(
    ("folder", "name"),
    [("dao", "arena2"), ("cities", "Berlin_0_1024"), ("random", "random512-35-0")],
)
def test_published_queries_have_their_published_lengths_on_the_maps_read_here(
    folder: str, name: str
) -> None:
    blocked = load_map(map_data("movingai", folder, f"{name}.map"))
    queries = load_scenario(map_data("movingai", folder, f"{name}.map.scen"))
    for query in (queries[at] for at in np.linspace(0, len(queries) - 1, 4).astype(int)):
        assert (query.rows, query.cols) == blocked.shape
        outcome = plan(blocked, query.start, query.goal)
        assert isinstance(outcome, GridPath)
        assert outcome.length == pytest.approx(query.length, abs=1e-2)
