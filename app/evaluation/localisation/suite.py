"""`evaluate localisation`: how well the robot knows its place, in a new map, in a saved one, after
it was switched on, carried away or disturbed, and in wrong maps."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console as Terminal
from rich.table import Table

from app.episode.second_day import OTHER_DAY
from app.evaluation.localisation.carried_away import carried_away
from app.evaluation.localisation.drives import kept_drive
from app.evaluation.localisation.figures import figures, summarise
from app.evaluation.localisation.recording import Recording, mirrored
from app.evaluation.localisation.replay import Replay, follow, keyframes_of
from app.evaluation.localisation.trials import SavedMap, days, disturbed, half_turn, started_in
from app.runtime.record.provenance import command_line, machine, version
from app.runtime.start.segmentation import colour_perception
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration
from navcore.files import write_whole
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.beware_list import BewareList
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario
from sim.scenario.schema import Scenario

PLACES = 5
"""Places at which the robot is switched on or carried away, for each episode."""
DAYS = 10
"""Days in one site."""
WORSE_M = 0.02
"""How much worse than odometry alone a run may be, metres, root mean square."""
ROWS = ("rms_m", "p95_m", "final_m", "yaw_p95_deg", "rpe_m", "nees", "odometry_rms_m", "p99_ms")
"""Figures that are printed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """What is driven, how often, and where recorded drives are kept."""

    grade: OdometryGrade
    """Grade of the odometry."""
    episodes: int
    """Number of runs of odometry for each drive."""
    seed: int
    """Seed of the first drive and of the first run of odometry."""
    drives: Path
    """Folder of the recorded drives."""
    beware: BewareList
    """Beware list of the operator."""
    config: NavigatorConfig
    """Configuration of the navigation."""

    def recording(self, world: Scenario, *, other_day: bool = False) -> Recording:
        """Return the drive of a world; that of the other day has the goals in reverse order."""
        drive = kept_drive(
            self.drives,
            world,
            self.beware,
            seed=self.seed + (OTHER_DAY if other_day else 0),
            config=self.config,
            backwards=other_day,
        )
        return Recording(drive=drive, grade=self.grade, seed=self.seed)

    def pose_ids(self) -> PoseIds:
        """Return the pose IDs of a new map."""
        return PoseIds(self.config.map.pose_spacing_m, self.config.map.pose_spacing_deg)

    def saved(self, run: Recording) -> SavedMap:
        """Return the map of a drive."""
        ids = self.pose_ids()
        keyframes = keyframes_of(run.drive, ids, self.config.localisation)
        return SavedMap(keyframes=keyframes, poses=ids.array())

    def tracked(self, run: Recording, saved: SavedMap | None) -> list[dict[str, float]]:
        """Return the figures of each run along a drive, in a saved map or a new one."""
        rows = []
        for number in range(self.episodes):
            odometry = run.odometry(number, run.drive.true_poses[0])
            replay = (
                Replay(self.config)
                if saved is None
                else Replay(self.config, saved.keyframes, saved.poses)
            )
            rows.append(figures(follow(replay, run.drive, odometry)))
        return rows


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
    `summary.json`; recorded drives are kept beside `out` and replayed by later calls.

    Raises `BadConfiguration` for a world without goals of its own.
    """
    if not scenario.goals:
        raise BadConfiguration(f"scenario {scenario.name!r} has no goals to drive to")
    suite = Suite(
        grade=grade,
        episodes=episodes,
        seed=seed,
        drives=out.parent / "drives",
        beware=beware,
        config=config or NavigatorConfig(),
    )
    first = suite.recording(scenario)
    second = suite.recording(scenario, other_day=True)
    saved = suite.saved(first)
    summary = {
        "command": command_line(),
        "scenario": scenario.name,
        "segmenter": colour_perception().identity,
        "odometry": str(grade),
        "versions": [version()],
        "machines": [machine()],
        "episodes": episodes,
        "seeds": list(range(seed, seed + episodes)),
        "distance_m": [round(run.drive.distance_m, 1) for run in (first, second)],
        "new_map": summarise(suite.tracked(first, None)),
        "saved_map": summarise(suite.tracked(second, saved)),
        **_found(suite, scenario, second, saved),
        "carried_away": _carried(suite, second, saved),
        "disturbed": disturbed(second, saved, suite.config, min(episodes, PLACES)),
        "days": days((first, second), suite.config, DAYS),
    }
    _print(summary)
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / "summary.json", json.dumps(summary, indent=1).encode())
    return summary


def _found(
    suite: Suite, scenario: Scenario, run: Recording, saved: SavedMap
) -> dict[str, dict[str, Any]]:
    """Return how often the place is found in the saved map, and in wrong ones."""
    other = load_scenario("indoor" if scenario.name == "office" else "office")
    elsewhere = replace(saved, keyframes=suite.saved(suite.recording(other)).keyframes)
    wrong = {
        "mirrored": replace(saved, keyframes=tuple(mirrored(saved.keyframes))),
        other.name: elsewhere,
    }
    started = partial(started_in, run, config=suite.config, count=PLACES * suite.episodes)
    return {
        "switched_on": started(saved, searches=True),
        "wrong_map": {
            name: started(one, is_here=False, searches=True) for name, one in wrong.items()
        },
        "started_in": {
            "the saved map": started(saved),
            "turned by 180°": started(saved, motion=half_turn(saved)),
            **{name: started(one, is_here=False) for name, one in wrong.items()},
        },
    }


def _carried(suite: Suite, run: Recording, saved: SavedMap) -> dict[str, dict[str, Any]]:
    count = PLACES * suite.episodes
    return {
        "saved_map": carried_away(run, saved, suite.config, count),
        "new_map": carried_away(run, None, suite.config, count),
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
    for line in lines(summary):
        terminal.print(line)


def lines(summary: dict[str, Any]) -> list[str]:
    """Return the figures beside the table, one a line."""
    return [
        *(_consistency(name, summary[name]["by_run"]) for name in ("new_map", "saved_map")),
        *(
            f"switched on, map {name}: {_answers(found)}"
            for name, found in {
                "the saved map": summary["switched_on"],
                **summary["wrong_map"],
            }.items()
        ),
        *(
            f"started as odometry says, map {name}: {_answers(found)}"
            for name, found in summary["started_in"].items()
        ),
        *(
            f"carried away, {name.replace('_', ' ')}: {found['noticed']} of {found['carried']} "
            f"noticed ({found['in_time']} in time) after {_metres(found['median_m'])}, "
            f"{found['right_again']} right again, {found['unnoticed']} unnoticed; "
            f"{found['false_alarms']} false alarms in {found['not_carried']}"
            for name, found in summary["carried_away"].items()
        ),
        *(
            f"disturbed, {name}: {found['right']} right, {found['lost']} lost, {found['wrong']} "
            f"wrong at the end of {found['runs']}; odometry alone {found['odometry_m']:.2f} m off"
            for name, found in summary["disturbed"].items()
        ),
        f"{summary['days']['days']} days: places crept by {summary['days']['crept_m']:.3f} m, rms "
        + " ".join(f"{value:.3f}" for value in summary["days"]["rms_m"])
        + f" m, {summary['days']['keyframes'][0]} to {summary['days']['keyframes'][-1]} keyframes",
    ]


def _consistency(name: str, by_run: dict[str, list[float]]) -> str:
    worse = sum(value > WORSE_M for value in by_run["worse_than_odometry_m"])
    sure = sum(value >= 3.0 for value in by_run["overconfident_s"])
    right, wrong = (int(sum(by_run[f"loops_{kind}"])) for kind in ("right", "wrong"))
    runs = len(by_run["nees"])
    return (
        f"{name.replace('_', ' ')}: {worse} of {runs} runs worse than odometry by more than "
        f"{100 * WORSE_M:.0f} cm, {sure} with NEES above 30 for 3 s; loops {right} right, "
        f"{wrong} wrong"
    )


def _answers(found: dict[str, Any]) -> str:
    return (
        f"{found['right']} right, {found['refused']} refused, {found['wrong']} wrong of "
        f"{found['starts']}, after {_metres(found['median_m'])}; {found['misled']} misled on the "
        f"way, {found['misled_m']:.1f} m at most"
    )


def _metres(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f} m"
