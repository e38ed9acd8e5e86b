"""`evaluate localisation`: how well the robot knows its place, in a new map, in a saved one, and
after it was switched on anywhere in a saved map."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console as Terminal
from rich.table import Table

from app.evaluation.localisation import (
    Drive,
    figures,
    follow,
    keyframes_of,
    odometry_of,
    record,
    scans_of,
    summarise,
)
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration
from navcore.files import write_whole
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.localisation.localiser import Localiser
from navcore.localisation.place_map import place_map_of
from navcore.localisation.relocalisation import RelocalisationState, Relocaliser, search_task
from navcore.localisation.scan import Keyframe, Scan
from navcore.localisation.scan_map import ScanMap
from navcore.mapping.pose_ids import PoseIds
from navcore.mission.beware_list import BewareList
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.schema import Scenario

OTHER_DAY = 1000
"""Added to the seed of the second drive: chairs stand elsewhere, other people are about."""
RIGHT_M, RIGHT_RAD = 0.15, math.radians(2.0)
"""Largest error of a place that counts as right."""
GIVEN_UP_M = 10.0
"""Distance in metres after which a search without an answer counts as refused."""
ROWS = ("rms_m", "p95_m", "final_m", "yaw_p95_deg", "rpe_m", "nees", "odometry_rms_m", "p99_ms")
"""Figures that are printed."""


def evaluate_localisation(
    scenario: Scenario,
    *,
    grade: OdometryGrade,
    episodes: int,
    seed: int,
    out: Path,
    beware: BewareList,
    config: NavigatorConfig | None = None,
) -> dict[str, Any]:
    """Drive a world twice, let `episodes` runs of odometry follow each drive, and print and write
    `summary.json`; the second drive has its goals in reverse order.

    Raises `BadConfiguration` for a world without goals of its own.
    """
    if not scenario.goals:
        raise BadConfiguration(f"scenario {scenario.name!r} has no goals to drive to")
    config = config or NavigatorConfig()
    rules = config.localisation
    first = record(scenario, beware, seed=seed)
    second = record(scenario, beware, seed=seed + OTHER_DAY, goals=tuple(reversed(scenario.goals)))
    slope = config.points.max_slope
    scans = [scans_of(drive, slope, rules) for drive in (first, second)]
    seeds = range(seed, seed + episodes)

    def pose_ids() -> PoseIds:
        return PoseIds(config.map.pose_spacing_m, config.map.pose_spacing_deg)

    saved = keyframes_of(first, scans[0], pose_ids(), rules)
    new_map, in_saved = [], []
    for number in seeds:
        odometry = odometry_of(first, grade, number, first.true_poses[0])
        new_map.append(figures(follow(Localiser(pose_ids(), rules), first, odometry, scans[0])))
        again = Localiser(pose_ids(), rules)
        again.load(saved)
        odometry = odometry_of(second, grade, number, second.true_poses[0])
        in_saved.append(figures(follow(again, second, odometry, scans[1])))
    summary = {
        "scenario": scenario.name,
        "odometry": str(grade),
        "seed": seed,
        "episodes": episodes,
        "distance_m": [round(drive.distance_m, 1) for drive in (first, second)],
        "new_map": summarise(new_map),
        "saved_map": summarise(in_saved),
        "relocalisation": _relocalised(
            second, scans[1], saved, grade, config, count=episodes, seed=seed
        ),
    }
    _print(summary)
    write_whole(out / "summary.json", json.dumps(summary, indent=1).encode())
    return summary


def _relocalised(
    drive: Drive,
    scans: Sequence[Scan],
    saved: Sequence[Keyframe],
    grade: OdometryGrade,
    config: NavigatorConfig,
    *,
    count: int,
    seed: int,
) -> dict[str, Any]:
    """Switch the robot on at `count` places of a drive without a place, and count the answers."""
    rules = config.localisation.relocalisation
    surfaces = ScanMap(config.localisation.match)
    surfaces.replace(saved)
    known = surfaces.surfaces
    place_map = place_map_of(known[:, :2], known[:, 2:4] * known[:, 5:], rules.search)
    right, wrong, metres = 0, 0, []
    starts = np.linspace(0, max(len(drive) - 50, 1), count, endpoint=False).astype(int)
    for number, start in enumerate(starts.tolist()):
        odometry = odometry_of(drive, grade, seed + number, Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))
        relocaliser, driven_m = Relocaliser(place_map, rules), 0.0
        for k in range(start, len(drive)):
            if k > start:
                driven_m += odometry[k].distance_to(odometry[k - 1].x_m, odometry[k - 1].y_m)
            relocaliser.observe(scans[k], odometry[k], drive.frames[k].stamp_ns)
            if (task := relocaliser.next_task()) is not None:
                result = search_task(task, place_map, rules)
                if result is not None:
                    relocaliser.take(result)
            proposal = relocaliser.proposal
            if proposal.state is RelocalisationState.ACCEPTED and proposal.T_map_odom is not None:
                found, true = proposal.T_map_odom @ odometry[k], drive.true_poses[k]
                is_right = bool(
                    found.distance_to(true.x_m, true.y_m) <= RIGHT_M
                    and abs(wrap_angle(found.yaw_rad - true.yaw_rad)) <= RIGHT_RAD
                )
                right, wrong = right + is_right, wrong + (not is_right)
                metres.append(driven_m)
                break
            if driven_m > GIVEN_UP_M:
                break
    return {
        "starts": len(starts),
        "right": right,
        "wrong": wrong,
        "refused": len(starts) - right - wrong,
        "median_m": float(np.median(metres)) if metres else None,
    }


def _print(summary: dict[str, Any]) -> None:
    title = f"{summary['scenario']}, {summary['odometry']} odometry, {summary['episodes']} runs"
    table = Table(title=title)
    table.add_column("map")
    for name in ROWS:
        table.add_column(name, justify="right")
    for which in ("new_map", "saved_map"):
        for kind in ("median", "worst"):
            cells = (f"{summary[which][kind][name]:.3g}" for name in ROWS)
            table.add_row(f"{which.replace('_', ' ')}, {kind}", *cells)
    terminal = Terminal(width=None if sys.stdout.isatty() else 130)
    terminal.print(table)
    found = summary["relocalisation"]
    terminal.print(
        f"relocalisation: {found['right']} right, {found['refused']} refused, {found['wrong']} "
        f"wrong of {found['starts']}, after {_metres(found['median_m'])} (median)"
    )


def _metres(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f} m"
