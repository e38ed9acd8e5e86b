"""Many seeded episodes of one world."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from app.campaign import Campaign, conclude, mean_of
from app.episode import Episode
from app.segmenter import Perception, colour_perception, compose
from app.segmenter_choice import SegmenterChoice
from navcore.beware import BewareList
from navcore.config import config_for
from navcore.robot import load_profile
from sim.scenario import load_scenario

COLUMNS = (
    *("seed", "success", "goals_reached", "collisions", "beware_intrusions", "zone_intrusions", "min_clearance_m"),
    *("distance_m", "spl", "sim_time_s", "wall_time_s", "replans"),
)


def evaluate_scenario(
    scenario: str,
    *,
    seeds: Iterable[int],
    workers: int,
    out: Path,
    max_time_s: float,
    beware: BewareList,
    perception: Perception | None = None,
    robot: str = "husky",
) -> dict[str, Any]:
    """Drive one episode a seed, keep each as it ends, print a table, write `summary.json`; returns the summary."""
    perception = perception or colour_perception()
    # Each worker makes the same segmenter again, with the engine that was found, and keeps to one thread.
    choice = dataclasses.replace(perception.choice, threads=1)
    profile = load_profile(robot)
    run = _Run(scenario=scenario, robot=robot, max_time_s=max_time_s, beware=beware)
    campaign = Campaign(
        key="seed",
        rules=(load_scenario(scenario), beware.classes, max_time_s, profile, config_for(profile), perception.identity),
        holds="another world, robot, beware list, segmenter or time limit",
        drive=partial(_drive, run=run, perception=perception),
        drive_alone=partial(_drive_alone, run=run, choice=choice),
    )
    reports = campaign.run(list(seeds), workers=workers, out=out)
    summary = summarise(scenario, reports)
    conclude(reports, summary, columns=COLUMNS, title=scenario, out=out)
    return summary


def summarise(scenario: str, reports: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of a campaign."""
    return {
        "scenario": scenario,
        "episodes": len(reports),
        "success_rate": mean_of(reports, lambda report: float(report["success"])),
        "goals_reached": sum(report["goals_reached"] for report in reports),
        "goals": sum(len(report["goals"]) for report in reports),
        "collisions": sum(report["collisions"] for report in reports),
        "beware_intrusions": sum(report["beware_intrusions"] for report in reports),
        "zone_intrusions": sum(report["zone_intrusions"] for report in reports),
        "min_clearance_m": min(report["min_clearance_m"] for report in reports),
        "spl": mean_of(reports, lambda report: report["spl"]),
        "sim_time_s": mean_of(reports, lambda report: report["sim_time_s"]),
        "real_time_factor": mean_of(reports, lambda report: report["sim_time_s"] / report["wall_time_s"]),
        "tick_ms_p99": mean_of(reports, lambda report: report["tick_ms"]["p99"]),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """What every episode of a campaign has in common."""

    scenario: str
    robot: str
    max_time_s: float
    beware: BewareList


def _drive_alone(seed: int, *, run: _Run, choice: SegmenterChoice) -> dict[str, Any]:
    return _drive(seed, run=run, perception=compose(choice))


def _drive(seed: int, *, run: _Run, perception: Perception) -> dict[str, Any]:
    robot = load_profile(run.robot)
    episode = Episode(
        load_scenario(run.scenario),
        seed=seed,
        beware=run.beware,
        config=config_for(robot),
        max_time_s=run.max_time_s,
        perception=perception,
        robot=robot,
    )
    try:
        return episode.run()
    finally:
        episode.close()
