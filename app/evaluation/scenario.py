"""Evaluation of one world: many seeded episodes, driven, judged, summarised and plotted."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console as Terminal

from app.episode.ablations import Ablation
from app.episode.task import Task, episode_of
from app.evaluation.campaign import Campaign, write_summary
from app.evaluation.summary import summarise, tables_of
from app.runtime.provenance import command_line
from app.runtime.segmentation import Perception, colour_perception, compose
from app.runtime.segmenter_choice import SegmenterChoice
from navcore.config.navigator import NavigatorConfig, config_for
from navcore.mission.beware_list import BewareList
from navcore.robot.profile import load_profile

NEEDS_NO_SEGMENTER = (Ablation.NO_SEMANTICS, Ablation.ORACLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Settings that all episodes of a campaign share."""

    task: Task
    """World, goals, zones, ablation and time limit."""
    robot: str
    """Name of the robot profile."""
    beware: BewareList
    """Classes that the robot must avoid."""
    out: Path
    """Folder of reports and figures."""
    config: NavigatorConfig
    """Navigation parameters."""
    drawn: frozenset[int] = frozenset()
    """Seeds whose figures are drawn besides those of failed episodes."""


def evaluate_scenario(
    task: Task,
    *,
    seeds: Sequence[int],
    workers: int,
    out: Path,
    beware: BewareList,
    perception: Perception | None = None,
    robot: str = "husky",
    draw_first: int = 1,
    config: NavigatorConfig | None = None,
) -> dict[str, Any]:
    """Drive one episode per seed, print tables, and write `summary.json` and figures.

    Returns the summary. `config` defaults to the configuration of the robot. The figures of the
    first `draw_first` episodes and of all failed ones are written to `out/figures/seed-…`.
    """
    perception = perception or colour_perception()
    # Each worker composes the same segmenter again, with the chosen engine and one thread.
    choice = dataclasses.replace(perception.choice, threads=1)
    profile = load_profile(robot)
    segmenter = str(task.ablation) if task.ablation in NEEDS_NO_SEGMENTER else perception.identity
    config, drawn = config or config_for(profile), frozenset(seeds[:draw_first])
    common = Evaluation(task=task, robot=robot, beware=beware, out=out, config=config, drawn=drawn)
    campaign = Campaign(
        key="seed",
        rules=(task, beware.classes, profile, config, segmenter),
        holds="another world, task, ablation, odometry, robot, configuration, beware list, "
        "segmenter or time limit",
        drive=partial(_drive, common=common, perception=perception),
        drive_alone=partial(_drive_alone, common=common, choice=choice),
    )
    reports = campaign.run(seeds, workers=workers, out=out)
    mission = "random" if task.random else "given"
    summary = {"command": command_line(), "mission": mission, **summarise(reports)}
    write_summary(summary, out)
    _draw(reports, common)
    terminal = Terminal(width=None if sys.stdout.isatty() else 140)
    for table in tables_of(summary):
        terminal.print(table)
    terminal.print(f"episodes.jsonl, summary.json and figures are in {out}")
    return summary


def _draw(reports: Sequence[dict[str, Any]], common: Evaluation) -> None:
    from app.evaluation.plots import all_drives, progress, save
    from sim.scenario.variation import randomise

    folder = common.out / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    world = randomise(common.task.scenario, int(reports[0]["seed"]))
    save(progress(reports, f"{world.name}, {len(reports)} episodes"), folder / "progress")
    save(all_drives(reports, world), folder / "drives")


def _drive_alone(seed: int, *, common: Evaluation, choice: SegmenterChoice) -> dict[str, Any]:
    return _drive(seed, common=common, perception=compose(choice))


def _drive(seed: int, *, common: Evaluation, perception: Perception) -> dict[str, Any]:
    from app.episode.keyframes import Keyframes
    from app.evaluation.plots import plot_episode

    profile = load_profile(common.robot)
    episode = episode_of(
        common.task,
        seed,
        robot=profile,
        beware=common.beware,
        perception=perception,
        config=common.config,
    )
    try:
        keyframes = Keyframes(episode)
        report = episode.run()
        if seed in common.drawn or not report["success"]:
            plot_episode(report, episode, keyframes, common.out / "figures" / f"seed-{seed:04d}")
        return report
    finally:
        episode.close()
