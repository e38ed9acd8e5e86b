"""`evaluate localisation`: how well the robot knows its place, in a new map, in a saved one, and
after it was switched on anywhere in a saved map."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console as Terminal
from rich.table import Table

from app.evaluation.localisation import (
    figures,
    follow,
    keyframes_of,
    record,
    scans_of,
    summarise,
)
from app.evaluation.relocalisation import (
    Recording,
    carried_away,
    mirrored,
    place_map,
    switched_on,
)
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration
from navcore.files import write_whole
from navcore.localisation.scans.scan import Keyframe
from navcore.localisation.tracking.localiser import Localiser
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.beware_list import BewareList
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario
from sim.scenario.schema import Scenario

OTHER_DAY = 1000
"""Added to the seed of the second drive: chairs stand elsewhere, other people are about."""
PLACES = 5
"""Places at which the robot is switched on or carried away, for each episode."""
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

    def recording(world: Scenario, number: int) -> Recording:
        drive = record(world, beware, seed=number, goals=world.goals)
        scans = scans_of(drive, config.points.max_slope, rules)
        return Recording(drive=drive, scans=scans, grade=grade, seed=seed)

    def pose_ids() -> PoseIds:
        return PoseIds(config.map.pose_spacing_m, config.map.pose_spacing_deg)

    first = recording(scenario, seed)
    backwards = replace(scenario, goals=tuple(reversed(scenario.goals)))
    second = recording(backwards, seed + OTHER_DAY)
    known = pose_ids()
    saved = keyframes_of(first.drive, first.scans, known, rules)
    new_map: list[dict[str, float]] = []
    in_saved: list[dict[str, float]] = []
    no_keyframes: tuple[Keyframe, ...] = ()
    for run, keyframes, rows in ((first, no_keyframes, new_map), (second, saved, in_saved)):
        for number in range(episodes):
            ids = pose_ids()
            if keyframes:
                ids.restore(known.array())
            localiser = Localiser(ids, rules)
            localiser.load(keyframes)
            odometry = run.odometry(number, run.drive.true_poses[0])
            rows.append(figures(follow(localiser, run.drive, odometry, run.scans)))
    places = PLACES * episodes
    other = load_scenario("indoor" if scenario.name == "office" else "office")
    elsewhere = recording(other, seed)
    wrong_maps = {
        "mirrored": mirrored(saved),
        other.name: keyframes_of(elsewhere.drive, elsewhere.scans, pose_ids(), rules),
    }
    summary = {
        "scenario": scenario.name,
        "odometry": str(grade),
        "seed": seed,
        "episodes": episodes,
        "distance_m": [round(run.drive.distance_m, 1) for run in (first, second)],
        "new_map": summarise(new_map),
        "saved_map": summarise(in_saved),
        "switched_on": switched_on(
            second, place_map(saved, rules), rules.relocalisation, places, is_here=True
        ),
        "wrong_map": {
            name: switched_on(
                second, place_map(keyframes, rules), rules.relocalisation, places, is_here=False
            )
            for name, keyframes in wrong_maps.items()
        },
        "carried_away": {
            "saved_map": carried_away(second, saved, rules, known, places),
            "new_map": carried_away(second, (), rules, pose_ids(), places),
        },
    }
    _print(summary)
    write_whole(out / "summary.json", json.dumps(summary, indent=1).encode())
    return summary


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
    for name, found in {"the saved map": summary["switched_on"], **summary["wrong_map"]}.items():
        terminal.print(
            f"switched on, map {name}: {found['right']} right, {found['refused']} refused, "
            f"{found['wrong']} wrong of {found['starts']}, after {_metres(found['median_m'])}"
        )
    for name, found in summary["carried_away"].items():
        terminal.print(
            f"carried away, {name.replace('_', ' ')}: {found['noticed']} of {found['carried']} "
            f"noticed ({found['in_time']} in time) after {_metres(found['median_m'])}, "
            f"{found['right_again']} right again, {found['unnoticed']} unnoticed; "
            f"{found['false_alarms']} false alarms in {found['not_carried']}"
        )


def _metres(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f} m"
