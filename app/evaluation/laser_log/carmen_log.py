"""Logs of laser scans and odometry in CARMEN's format, and relations to judge them by.

`FLASER n r₁ … rₙ x y θ x' y' θ' t host t'`: ranges in metres over the 180° before the robot, from
right to left, a pose that a SLAM program has estimated or odometry's, and odometry's. `ODOM x y θ …
t host t'`: odometry alone. Relations (Kümmerle et al. 2009) are lines `t₁ t₂ Δx Δy Δz Δroll Δpitch
Δyaw`: where the robot was at one stamp, seen from where it was at another, as people have measured
it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navcore.errors import BadConfiguration
from navcore.files import read_whole
from navcore.geometry.arrays import Floats
from navcore.geometry.transform import Pose2, wrap_angle

MOST_BYTES = 500_000_000
"""Largest file in bytes."""
_RANGES = range(30, 2000)
"""Numbers of ranges that a scan may have."""
_SAME_S = 0.02
"""Difference of two stamps in seconds up to which they are of one scan: logs round them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaserLog:
    """Scans of a laser scanner that looks forwards, in the order of time."""

    stamps_s: Floats
    """(N,) stamps in seconds."""
    bearings_rad: Floats
    """(B,) angles of the rays in radians, counter-clockwise from the robot's x axis."""
    ranges_m: Floats
    """(N, B) distances along them in metres."""
    odometry: tuple[Pose2, ...]
    """T_odom_base of each by odometry."""
    logged: tuple[Pose2, ...]
    """T_map_base of each as the log has it: by another SLAM program, or odometry once more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Relation:
    """Where the robot was at one scan, seen from where it was at another, as people measured it."""

    first: int
    """Index of the scan from which was measured."""
    second: int
    """Index of the other."""
    T_first_second: Pose2
    """The measured motion."""


def load_carmen_log(path: Path) -> LaserLog:
    """Return the log of a file; raises `BadConfiguration` for one that is none."""
    scans: list[list[float]] = []
    odometry: list[list[float]] = []
    for number, line in enumerate(_lines(path), start=1):
        kind, *words = line.split()
        if kind == "FLASER":
            scans.append(_scan(words, f"{path}, line {number}"))
        elif kind == "ODOM":
            where = f"{path}, line {number}"
            if len(words) < 6:
                raise BadConfiguration(
                    f"{where}: expected three numbers of a pose, others and a stamp"
                )
            values = _numbers([*words[:3], words[-1]], where)
            if values[3] > 0.0:  # others repeat the estimate of a SLAM program
                odometry.append([values[3], *values[:3]])
    if len(scans) < 2:
        raise BadConfiguration(f"{path}: has {len(scans)} FLASER lines, expected two or more")
    counts = {len(scan) for scan in scans}
    if len(counts) > 1:
        raise BadConfiguration(f"{path}: scans have different numbers of ranges, expected one")
    rows = np.array(scans)
    rows = rows[np.argsort(rows[:, -1], kind="stable")]
    count = rows.shape[1] - 7
    step = math.pi / (count if count % 2 == 0 else count - 1)
    return LaserLog(
        stamps_s=rows[:, -1],
        bearings_rad=-math.pi / 2 + step * np.arange(count),
        ranges_m=rows[:, :count],
        odometry=_at(rows[:, -1], odometry) if odometry else _poses(rows[:, count + 3 : count + 6]),
        logged=_poses(rows[:, count : count + 3]),
    )


def load_relations(path: Path, log: LaserLog) -> tuple[Relation, ...]:
    """Return the relations of a file between scans that a log has, whose clock may have begun at
    another time; raises `BadConfiguration` for a file without any."""
    rows = np.array(
        [_numbers(line.split(), f"{path}, line {n}") for n, line in enumerate(_lines(path), 1)]
    )
    if rows.ndim != 2 or rows.shape[1] != 8:
        raise BadConfiguration(
            f"{path}: expected lines of eight numbers, t1 t2 x y z roll pitch yaw"
        )
    shift_s = _shift(np.unique(rows[:, :2]), log.stamps_s)
    found = []
    for first_s, second_s, x, y, _, _, _, yaw in rows.tolist():
        ends = _index(first_s - shift_s, log.stamps_s), _index(second_s - shift_s, log.stamps_s)
        if ends[0] is None or ends[1] is None or ends[0] == ends[1]:
            continue
        motion = Pose2(x_m=x, y_m=y, yaw_rad=wrap_angle(yaw))
        found.append(Relation(first=ends[0], second=ends[1], T_first_second=motion))
    if not found:
        raise BadConfiguration(f"{path}: no relation is between two scans of the log")
    return tuple(found)


def _lines(path: Path) -> list[str]:
    text = read_whole(path, at_most=MOST_BYTES).decode("utf-8", "replace")
    return [line for line in text.splitlines() if line.strip() and not line.startswith("#")]


def _numbers(words: list[str], where: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise BadConfiguration(f"{where}: {error}") from None
    if not all(map(math.isfinite, values)):
        raise BadConfiguration(f"{where}: a number is not finite")
    return values


def _scan(words: list[str], where: str) -> list[float]:
    """Return ranges, both poses and the stamp of a scan."""
    count = int(words[0]) if words and words[0].isdigit() else 0
    if count not in _RANGES or len(words) < count + 10:
        raise BadConfiguration(
            f"{where}: expected the number of ranges ({_RANGES.start} to {_RANGES.stop - 1}), "
            "that many ranges, two poses, a stamp, a host and a stamp"
        )
    return _numbers([*words[1 : count + 7], words[-1]], where)


def _poses(rows: Floats) -> tuple[Pose2, ...]:
    return tuple(Pose2(x_m=x, y_m=y, yaw_rad=wrap_angle(yaw)) for x, y, yaw in rows.tolist())


def _at(stamps_s: Floats, odometry: list[list[float]]) -> tuple[Pose2, ...]:
    """Return odometry at some stamps, between the lines before and after."""
    rows = np.array(odometry)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    rows[:, 3] = np.unwrap(rows[:, 3])
    return _poses(np.column_stack([np.interp(stamps_s, rows[:, 0], rows[:, k]) for k in (1, 2, 3)]))


def _shift(stamps_s: Floats, scans_s: Floats) -> float:
    """Return the time in seconds by which stamps of relations are ahead of those of scans: the most
    frequent difference."""
    apart = (stamps_s[:, None] - scans_s).ravel()
    counts, edges = np.histogram(
        apart, bins=np.arange(apart.min() - _SAME_S, apart.max() + 2 * _SAME_S, _SAME_S)
    )
    most = int(counts.argmax())
    return float(np.median(apart[(apart >= edges[most]) & (apart <= edges[most + 1])]))


def _index(stamp_s: float, scans_s: Floats) -> int | None:
    nearest = int(np.abs(scans_s - stamp_s).argmin())
    return nearest if abs(scans_s[nearest] - stamp_s) <= _SAME_S else None
