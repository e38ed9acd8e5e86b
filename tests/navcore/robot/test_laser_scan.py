"""A laser scan: what it met, how far it sees, and which are refused."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from navcore.errors import BadFrame
from navcore.robot.frame import check_frame
from navcore.robot.laser_scan import LaserScan, check_scan
from tests.navcore.scene import Box, picture, scanned

POST = Box(x=(-2.1, -2.0), y=(-0.1, 0.1), z=(0.0, 1.0))


def of(ranges: Any, *, x_m: float = 0.0, max_range_m: float = 8.0) -> LaserScan:
    return LaserScan(ranges_m=ranges, x_m=x_m, max_range_m=max_range_m)


def test_the_hits_are_where_the_things_are() -> None:
    hits = scanned(POST).hits()
    assert len(hits) > 5
    np.testing.assert_allclose(hits[:, 0], -2.0, atol=1e-5)
    assert np.abs(hits[:, 1]).max() <= 0.1
    ranges = np.full(36, np.inf, dtype=np.float32)
    ranges[9] = 1.5
    np.testing.assert_allclose(of(ranges, x_m=0.2).hits(), [[0.2, 1.5]], atol=1e-9)


def test_a_scan_reaches_up_to_what_stands_in_the_way_and_to_its_range() -> None:
    scan = scanned(POST)
    assert scan.reaches(-1.9, 0.0, 0.0)
    assert scan.reaches(-2.2, 0.0, 0.3)
    assert not scan.reaches(-2.5, 0.0, 0.3)
    assert scan.reaches(-2.5, 1.5, 0.3)
    assert not scan.reaches(0.0, 8.1, 0.3)


@pytest.mark.parametrize(
    ("scan", "words"),
    [
        (of(np.full(12, 1.0, dtype=np.float32)), "at least 36 rays"),
        (of(np.full((6, 6), 1.0, dtype=np.float32)), "at least 36 rays"),
        (of(np.full(36, 1.0)), "float32"),
        (of(np.full(36, math.nan, dtype=np.float32)), "not positive"),
        (of(np.zeros(36, dtype=np.float32)), "not positive"),
        (of(np.full(36, 1.0, dtype=np.float32), x_m=math.inf), "finite"),
        (of(np.full(36, 1.0, dtype=np.float32), max_range_m=0.0), "positive range"),
    ],
)
def test_a_scan_that_cannot_be_used_is_refused_by_what_is_wrong(
    scan: LaserScan, words: str
) -> None:
    with pytest.raises(BadFrame, match=words):
        check_scan(scan)
    with pytest.raises(BadFrame, match=words):
        check_frame(dataclasses.replace(picture(), scan=scan))
