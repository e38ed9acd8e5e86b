"""Published maps that planners are measured on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.bench.planning.queries import published
from navcore.errors import BadConfiguration

MAP = "type octile\nheight 2\nwidth 3\nmap\n.G@\nTS.\n"
QUERIES = "version 1\n0\ta.map\t3\t2\t0\t0\t1\t1\t1.41421356\n0\ta.map\t3\t2\t0\t0\t1\t0\t1\n"


def test_a_published_map_is_read_with_its_queries(tmp_path: Path) -> None:
    folder = tmp_path / "movingai" / "rooms"
    folder.mkdir(parents=True)
    (folder / "a.map").write_text(MAP)
    (folder / "a.map.scen").write_text(QUERIES)
    (problem,) = published(tmp_path)
    np.testing.assert_array_equal(problem.blocked, [[False, False, True], [True, False, False]])
    assert problem.queries == (((0, 0), (1, 1), 1.41421356), ((0, 0), (0, 1), 1.0))
    assert (problem.name, problem.decimals) == ("a", 8)
    (folder / "a.map").write_text(MAP.replace("T", "?"))
    with pytest.raises(BadConfiguration, match="unknown terrain"):
        next(published(tmp_path))
