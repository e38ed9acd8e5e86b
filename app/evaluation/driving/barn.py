"""Evaluation on the published BARN and DynaBARN worlds by the challenge's rules, camera only."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from app.episode.episode import Episode, EpisodeSettings
from app.episode.failure_causes import causes_of
from app.evaluation.campaign import HERE, Campaign, Conclusion, Fleet, mean_of, show_reports
from app.evaluation.origin import origin_of_drives
from app.evaluation.suites import BARN_SUITES, Suite
from app.evaluation.summary import rate_interval
from app.runtime.record.provenance import command_line
from navcore.config.navigator import NavigatorConfig, config_for
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import BewareList
from navcore.robot.profile import RobotProfile
from sim.scenario.barn import SCALES, BarnWorld, load_worlds
from sim.simulator import Simulator

MOVED_M = 0.1
"""Distance from the start at which the challenge's clock starts, metres."""
COLUMNS = (
    "world",
    "success",
    "collision",
    "timeout",
    "time_s",
    "score",
    "optimal_s",
    "distance_m",
    "min_clearance_m",
    "wall_time_s",
)
OBSERVE_FIRST_S = 1.5
"""Time the robot observes before it starts to drive, seconds, to detect moving people; the
challenge's clock does not run yet."""
NO_CLASSES = BewareList(classes=())


class ChallengeRules:
    """The challenge's rules: a run ends at the goal, at any contact, or at the time limit."""

    def __init__(self, world: BarnWorld) -> None:
        self._world = world
        self.began_s: float | None = None
        """Simulated time at which the clock started; None before."""
        self.now_s = 0.0
        """Simulated time, seconds."""
        self.at_goal = self.touched = False

    def ended(self, simulator: Simulator) -> bool:
        """Judge the simulator's ground truth; return whether the run is over."""
        pose, (x_m, y_m, _) = simulator.true_pose(), self._world.scenario.start
        self.now_s = simulator.now_ns() / 1e9
        if self.began_s is None and pose.distance_to(x_m, y_m) >= MOVED_M:
            self.began_s = self.now_s
        self.touched = simulator.referee.touched
        self.at_goal = (
            not self.touched
            and pose.distance_to(*self._world.scenario.goals[0]) <= self._world.tolerance_m
        )
        return self.at_goal or self.touched or self.time_s >= self._world.limit_s

    @property
    def time_s(self) -> float:
        """Time on the challenge's clock, seconds; simulated time before the clock has started."""
        return self.now_s - (self.began_s or 0.0)


def evaluate_barn(
    suite: str,
    worlds: Path | None,
    settings: EpisodeSettings,
    *,
    count: int | None,
    seed: int,
    fleet: Fleet = HERE,
    out: Path,
) -> dict[str, Any]:
    """Drive the first `count` worlds of a file, one run each; print a table, write `summary.json`.

    Returns the summary. The beware list of `settings` is emptied: these worlds have nothing of it.
    Raises `BadConfiguration`.
    """
    if worlds is None:
        raise BadConfiguration(
            f"the suite {suite} needs --worlds FILE.json, the file of its worlds"
        )
    profile = settings.robot
    listed = _listed(suite, worlds, profile)[:count]
    config = _fitted(suite, settings.config or config_for(profile))
    settings = replace(settings, beware=NO_CLASSES, config=config)
    drive = partial(drive_world, worlds=worlds, suite=suite, settings=settings, seed=seed)
    campaign = Campaign(
        suite=suite,
        key="world",
        rules=(
            "any contact fails",
            hashlib.sha256(worlds.read_bytes()).hexdigest(),
            profile,
            config,
            seed,
            settings.odometry,
            settings.latency,
            settings.camera,
        ),
        holds="other worlds, another robot, seed, odometry, latency, camera or configuration",
        drive=drive,
        drive_alone=drive,
    )
    reports = campaign.run([world.id for world in listed], fleet=fleet, out=out)
    return CONCLUSIONS[suite].write(command_line(), reports, out)


def summarise(suite: Suite, command: str, reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the summary of a campaign as a JSON object, with Wilson's interval."""
    successes = sum(report["success"] for report in reports)
    return {
        **origin_of_drives(suite, command, reports, key="world"),
        "success_rate": mean_of(reports, lambda report: float(report["success"])),
        "success_rate_ci95": [round(end, 4) for end in rate_interval(successes, len(reports))],
        "collisions": sum(report["collision"] for report in reports),
        "timeouts": sum(report["timeout"] for report in reports),
        "score": mean_of(reports, lambda report: report["score"]),
        "time_s": mean_of(reports, lambda report: report["time_s"]),
        "min_clearance_m": min(report["min_clearance_m"] for report in reports),
        "tick_ms_p99": mean_of(reports, lambda report: report["tick_ms"]["p99"]),
    }


def _show(reports: Sequence[dict[str, Any]], summary: dict[str, Any]) -> None:
    title = f"{summary['suite']}, {summary['robot']}"
    show_reports(reports, summary, columns=COLUMNS, title=title)


CONCLUSIONS: Mapping[str, Conclusion] = {
    suite: Conclusion(summarise=partial(summarise, suite), show=_show) for suite in BARN_SUITES
}
"""What is made of a campaign, by its suite."""


def drive_world(
    number: int, *, worlds: Path, suite: str, settings: EpisodeSettings, seed: int
) -> dict[str, Any]:
    """Drive the world of a number once; return its report with the challenge's verdict."""
    world = next(world for world in _listed(suite, worlds, settings.robot) if world.id == number)
    rules = ChallengeRules(world)
    settings = replace(settings, max_time_s=2 * world.limit_s)
    episode = Episode(world.scenario, settings, seed=seed)
    try:
        report = episode.run(ended=rules.ended, look_first_s=OBSERVE_FIRST_S)
    finally:
        episode.close()
    judged = {**report, "world": number, **verdict(world, rules)}
    return {**judged, "causes": causes_of(judged)}


def verdict(world: BarnWorld, rules: ChallengeRules) -> dict[str, Any]:
    """Return the challenge's verdict on a run as report fields."""
    return {
        "success": rules.at_goal,
        "goals_reached": int(rules.at_goal),
        "collision": rules.touched,
        "timeout": not rules.at_goal and not rules.touched,
        "time_s": round(rules.time_s, 3),
        "optimal_s": round(world.optimal_s, 3),
        "score": round(world.score(success=rules.at_goal, seconds=rules.time_s), 4),
    }


def _fitted(suite: str, config: NavigatorConfig) -> NavigatorConfig:
    """Return the configuration for a suite: DynaBARN's obstacles give way to nothing."""
    return replace(config, people=replace(config.people, non_cooperative=suite == "dynabarn"))


def _listed(suite: str, path: Path, profile: RobotProfile) -> tuple[BarnWorld, ...]:
    """Load the worlds of a file, scaled to the robot; raises `BadConfiguration`."""
    if profile.name not in SCALES:
        raise BadConfiguration(
            f"--robot {profile.name}: the worlds are made for one of: {', '.join(SCALES)}"
        )
    worlds = load_worlds(path, scale=SCALES[profile.name])
    moving = any(world.scenario.movers for world in worlds)
    if moving != (suite == "dynabarn"):
        raise BadConfiguration(
            f"{path}: holds no {suite} worlds, but {'dynabarn' if moving else 'barn'} worlds"
        )
    return worlds
