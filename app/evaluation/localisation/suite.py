"""`evaluate localisation`: how well the robot knows its place, in a new map, in a saved one, after
it was switched on, carried away or disturbed, and in wrong maps."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console as Terminal
from rich.table import Table

from app.episode.second_day import OTHER_DAY
from app.evaluation.localisation.carried_away import carried_away
from app.evaluation.localisation.drives import Drive, kept_drive
from app.evaluation.localisation.figures import figures, summarise
from app.evaluation.localisation.pushed import pushed
from app.evaluation.localisation.recording import Recording
from app.evaluation.localisation.replay import Replay, follow, keyframes_of
from app.evaluation.localisation.trials import SavedMap, days, disturbed, half_turn, started_in
from app.evaluation.localisation.turns import kept_turn
from app.evaluation.origin import origin_here
from app.evaluation.suites import Suite
from app.fleet.engine import Engine, Lost, in_order
from app.runtime.start.segmentation import colour_perception
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration, BewareNavError
from navcore.files import write_whole
from navcore.mapping.points.pose_ids import PoseIds
from navcore.mission.beware_list import BewareList
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario
from sim.scenario.schema import Scenario
from sim.scenario.variation import another_day, randomise

PLACES = 5
"""Places at which the robot is switched on or carried away, for each episode."""
DAYS = 10
"""Days in one site."""
WORSE_M = 0.02
"""How much worse than odometry alone a run may be, metres, root mean square."""
SAVED, MIRRORED, TURNED = "the saved map", "mirrored", "turned by 180°"
"""Maps in which a robot is switched on; others are named after their worlds."""
ROWS = ("rms_m", "p95_m", "final_m", "yaw_p95_deg", "rpe_m", "nees", "odometry_rms_m", "p99_ms")
"""Figures that are printed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalisationSuite:
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

    def world(self, scenario: Scenario, *, other_day: bool = False) -> Scenario:
        """Return what the first seed makes of a scenario, with its rooms, woods and hills; on the
        other day what people move stands a little elsewhere."""
        first, given = randomise(scenario, self.seed), len(scenario.furniture)
        if not other_day:
            return first
        # About where the file has it, as on the first day, so that a day is no farther off.
        furniture = (*scenario.furniture, *first.furniture[given:])
        items = (*scenario.items, *first.items[len(scenario.items) :])
        tidy = dataclasses.replace(first, furniture=furniture, items=items)
        return another_day(tidy, self.seed + OTHER_DAY)

    def recording(self, scenario: Scenario, *, other_day: bool = False) -> Recording:
        """Return the drive of a scenario; that of the other day has the goals in reverse order."""
        drive = kept_drive(
            self.drives,
            self.world(scenario, other_day=other_day),
            self.beware,
            seed=self.seed + (OTHER_DAY if other_day else 0),
            config=self.config,
            backwards=other_day,
        )
        mapped = self.recording(scenario).drive if other_day else None
        return Recording(drive=drive, grade=self.grade, seed=self.seed, mapped=mapped)

    def turn(self, scenario: Scenario, run: Recording, start: int) -> Drive:
        """Return the turn of the robot at a frame of the other day's drive."""
        return kept_turn(
            self.drives,
            self.world(scenario, other_day=True),
            self.beware,
            seed=self.seed + OTHER_DAY,
            config=self.config,
            drive=run.drive,
            start=start,
        )

    @property
    def places(self) -> int:
        """Number of places at which the robot is switched on or carried away."""
        return PLACES * self.episodes

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """A world that was driven through on two days, and the map of the first."""

    suite: LocalisationSuite
    """What is measured, and how often."""
    scenario: Scenario
    """The scenario of the world."""
    first: Recording
    """The drive of the first day."""
    second: Recording
    """The drive of the second day."""
    saved: SavedMap
    """The map of the first day."""

    @staticmethod
    def of(suite: LocalisationSuite, scenario: Scenario) -> Site:
        """Return a world with its drives, which are recorded where none are kept."""
        first = suite.recording(scenario)
        return Site(
            suite=suite,
            scenario=scenario,
            first=first,
            second=suite.recording(scenario, other_day=True),
            saved=suite.saved(first),
        )

    def map(self, which: str) -> SavedMap:
        """Return the map of the first day, or a wrong one."""
        if which == SAVED:
            return self.saved
        if which == MIRRORED:
            return self.saved.mirrored()
        return self.suite.saved(self.suite.recording(load_scenario(which)))

    def started(self, which: str, *, turns: bool = False, **how: Any) -> dict[str, Any]:
        """Return how a robot that is switched on along the second drive finds its place in a map,
        after one turn on the spot if it `turns`."""
        return started_in(
            self.second,
            self.map(which),
            self.suite.config,
            self.suite.places,
            is_here=which == SAVED,
            turn_at=partial(self.suite.turn, self.scenario, self.second) if turns else None,
            **how,
        )


PARTS: dict[str, Callable[[Site, str], Any]] = {
    "new_map": lambda site, _: summarise(site.suite.tracked(site.first, None)),
    "saved_map": lambda site, _: summarise(site.suite.tracked(site.second, site.saved)),
    "switched_on": lambda site, _: site.started(SAVED, searches=True),
    "looked_round": lambda site, which: site.started(which, searches=True, turns=True),
    "wrong_map": lambda site, which: site.started(which, searches=True),
    "started_in": lambda site, which: (
        site.started(SAVED, motion=half_turn(site.saved))
        if which == TURNED
        else site.started(which)
    ),
    "carried_away": lambda site, which: carried_away(
        site.second,
        site.saved if which == "saved_map" else None,
        site.suite.config,
        site.suite.places,
    ),
    "pushed": lambda site, _: pushed(site.second, site.suite.config, site.suite.places),
    "disturbed": lambda site, _: disturbed(
        site.second, site.saved, site.suite.config, min(site.suite.episodes, PLACES)
    ),
    "days": lambda site, _: days((site.first, site.second), site.suite.config, DAYS),
}
"""Parts of the summary, each measured by itself; many are measured in several maps."""


def _say(line: str) -> None:
    print(line.strip(), file=sys.stderr, flush=True)


def _measured(suite: LocalisationSuite, scenario: Scenario, part: tuple[str, str]) -> Any:
    """Return one part of the summary in one map."""
    name, which = part
    return PARTS[name](Site.of(suite, scenario), which)


def evaluate_localisation(
    scenario: Scenario,
    *,
    grade: OdometryGrade,
    episodes: int,
    seed: int,
    out: Path,
    beware: BewareList,
    config: NavigatorConfig | None = None,
    engine: Engine,
) -> dict[str, Any]:
    """Drive a world twice, let `episodes` runs of odometry follow each drive, and print and write
    `summary.json`; recorded drives are kept beside `out` and replayed by later calls.

    Raises `BadConfiguration` for a world without goals of its own.
    """
    if not scenario.goals:
        raise BadConfiguration(f"scenario {scenario.name!r} has no goals to drive to")
    suite = LocalisationSuite(
        grade=grade,
        episodes=episodes,
        seed=seed,
        drives=out.parent / "drives",
        beware=beware,
        config=config or NavigatorConfig(),
    )
    site = Site.of(suite, scenario)
    other = "indoor" if scenario.name == "office" else "office"
    suite.recording(load_scenario(other))  # before workers look for it
    starts = list(site.second.starts(suite.places))
    for number, start in enumerate(starts, start=1):
        suite.turn(scenario, site.second, start)
        _say(f"turn {number} of {len(starts)} is recorded")
    summary: dict[str, Any] = {
        **origin_here(
            Suite.LOCALISATION, segmenter=colour_perception().identity, scenario=scenario.name
        ),
        "odometry": str(grade),
        "episodes": episodes,
        "seeds": list(range(seed, seed + episodes)),
        "distance_m": [round(run.drive.distance_m, 1) for run in (site.first, site.second)],
    }
    maps = {
        "looked_round": (SAVED, MIRRORED, other),
        "wrong_map": (MIRRORED, other),
        "started_in": (SAVED, TURNED, MIRRORED, other),
        "carried_away": ("saved_map", "new_map"),
    }
    tasks = [(name, which) for name in PARTS for which in maps.get(name, ("",))]
    results = in_order(engine, partial(_measured, suite, scenario), tasks, ahead=len(tasks))
    with closing(results):
        for number, ((name, which), result) in enumerate(zip(tasks, results, strict=True), start=1):
            if isinstance(result, Lost):
                raise BewareNavError(f"{name} {which}: {result.cause}")
            if which:
                summary.setdefault(name, {})[which] = result
            else:
                summary[name] = result
            _say(f"{number} of {len(tasks)} parts are measured: {name.replace('_', ' ')} {which}")
    _print(summary)
    out.mkdir(parents=True, exist_ok=True)
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
            f"switched on and turned round, map {name}: {_answers(found)}"
            for name, found in summary["looked_round"].items()
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
        *_pushes(summary["pushed"]),
        *(
            f"disturbed, {name}: {found['right']} right, {found['lost']} lost, {found['wrong']} "
            f"wrong at the end of {found['runs']}; odometry alone {found['odometry_m']:.2f} m off"
            for name, found in summary["disturbed"].items()
        ),
        f"{summary['days']['days']} days: rms "
        + " ".join(f"{value:.3f}" for value in summary["days"]["rms_m"])
        + f" m, {summary['days']['keyframes'][0]} to {summary['days']['keyframes'][-1]} keyframes",
    ]


def _pushes(found: dict[str, Any]) -> list[str]:
    columns = (found[key] for key in ("lengths_m", "told", "left_m", "worst_m"))
    return [
        f"pushed by {length_m:.1f} m, new map: {told} of {found['pushes']} noticed, {left_m:.2f} m "
        f"left of it in the median, {worst_m:.2f} m at worst; {found['false']} false alarms in "
        f"{found['not_pushed']}"
        for length_m, told, left_m, worst_m in zip(*columns, strict=True)
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
