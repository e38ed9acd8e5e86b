"""Logs of laser scanners and relations are read; what is none is named."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from app.evaluation.laser_log.carmen_log import load_carmen_log, load_relations
from navcore.errors import BadConfiguration


def scan_line(stamp_s: float, *, count: int = 180, x: float = 0.0, odometry: float = 0.0) -> str:
    """A scan whose rays are as long as their number, in centimetres."""
    ranges = " ".join(f"{(k + 1) / 100}" for k in range(count))
    return f"FLASER {count} {ranges} {x} 0 0.1 {odometry} 0 0.2 {stamp_s} host {stamp_s}"


def odometry_line(stamp_s: float, x: float, yaw: float) -> str:
    """A line of odometry."""
    return f"ODOM {x} 0 {yaw} 0 0 0 {stamp_s} host {stamp_s}"


def written(path: Path, *lines: str) -> Path:
    """Write the lines of a file."""
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_scans_are_read_in_the_order_of_time_with_odometry_between_its_lines(
    tmp_path: Path,
) -> None:
    log = load_carmen_log(
        written(
            tmp_path / "a.log",
            "# a comment",
            odometry_line(1.0, 0.0, 3.1),
            scan_line(2.5, x=2.0),
            scan_line(1.5, x=1.0),
            odometry_line(0.0, 9.0, 9.0),  # an estimate of another program, without a time
            odometry_line(3.0, 2.0, -3.1),
            "NEFF 15",
        )
    )
    assert log.stamps_s.tolist() == [1.5, 2.5]
    assert [pose.x_m for pose in log.logged] == [1.0, 2.0]
    assert [pose.x_m for pose in log.odometry] == pytest.approx([0.5, 1.5])
    # It turns on over ±180° and not back.
    assert log.odometry[0].yaw_rad == pytest.approx(3.1 + (2 * math.pi - 6.2) / 4)
    assert log.ranges_m.shape == (2, 180) and log.ranges_m[0, 9] == pytest.approx(0.1)
    assert log.bearings_rad[0] == pytest.approx(-math.pi / 2)
    assert log.bearings_rad[90] == pytest.approx(0.0)


def test_without_lines_of_odometry_that_of_the_scans_counts(tmp_path: Path) -> None:
    lines = [scan_line(k, count=181, odometry=float(k)) for k in range(3)]
    log = load_carmen_log(written(tmp_path / "a.log", *lines))
    assert [pose.x_m for pose in log.odometry] == [0.0, 1.0, 2.0]
    assert log.bearings_rad[-1] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["hello"], "has 0 FLASER lines"),
        ([scan_line(1.0)], "has 1 FLASER lines"),
        (["FLASER 180 1.0 2.0", scan_line(1.0)], "line 1: expected the number of ranges"),
        (["FLASER many 1.0", scan_line(1.0)], "line 1: expected the number of ranges"),
        ([scan_line(1.0), scan_line(2.0).replace("0.05", "far")], "line 2: could not convert"),
        ([scan_line(1.0), scan_line(2.0).replace("0.05", "nan")], "line 2: a number is not finite"),
        ([scan_line(1.0), scan_line(2.0, count=90)], "different numbers of ranges"),
        (["ODOM 1 2", scan_line(1.0), scan_line(2.0)], "line 1: expected three"),
    ],
)
def test_what_is_no_log_is_named(tmp_path: Path, lines: list[str], said: str) -> None:
    with pytest.raises(BadConfiguration, match=said):
        load_carmen_log(written(tmp_path / "a.log", *lines))


def test_relations_are_those_between_scans_of_the_log_whatever_its_clock(tmp_path: Path) -> None:
    stamps = [10.0 + 1.7 * k + 0.05 * k**2 for k in range(20)]
    log = load_carmen_log(written(tmp_path / "a.log", *map(scan_line, stamps)))
    at = [976052857.3 + stamp for stamp in stamps]
    lines = [f"{at[k]} {at[k + 3]} 1.0 0.5 0 0 0 0.1" for k in range(0, 16, 2)]
    lines.append(f"{at[0]} {at[5] + 0.6} 1.0 0.5 0 0 0 0.1")  # of a scan that the log lacks
    relations = load_relations(written(tmp_path / "a.relations", *lines), log)
    assert [(one.first, one.second) for one in relations] == [(k, k + 3) for k in range(0, 16, 2)]
    assert relations[0].T_first_second.y_m == 0.5


@pytest.mark.parametrize(
    ("line", "said"),
    [("1 2 3", "eight numbers"), ("1 2 0 0 0 0 0 x", "could not convert"), ("", "eight numbers")],
)
def test_what_are_no_relations_is_named(tmp_path: Path, line: str, said: str) -> None:
    log = load_carmen_log(written(tmp_path / "a.log", scan_line(1.0), scan_line(2.0)))
    with pytest.raises(BadConfiguration, match=said):
        load_relations(written(tmp_path / "a.relations", line), log)
