"""Evaluation of one world: many seeded episodes, driven, judged, summarised and plotted."""

from __future__ import annotations

import dataclasses
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from rich.console import Console as Terminal

from app.episode.ablations import Ablation
from app.episode.task import Task, episode_of
from app.evaluation.campaign import HERE, Campaign, Conclusion, Fleet, writing
from app.evaluation.origin import origin_of_drives
from app.evaluation.suites import Suite
from app.evaluation.summary import summarise, tables_of
from app.runtime.record.provenance import command_line
from app.runtime.start.segmentation import Perception, colour_perception, compose
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.config.navigator import NavigatorConfig, config_for
from navcore.errors import BewareNavError
from navcore.mission.beware_list import BewareList
from navcore.robot.profile import HUSKY, RobotProfile
from sim.scenario.schema import Scenario

NEEDS_NO_SEGMENTER = (Ablation.NO_SEMANTICS, Ablation.ORACLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Settings that all episodes of a campaign share."""

    task: Task
    """World, goals, zones, ablation and time limit."""
    robot: RobotProfile
    """Body, limits and sensors of the robot."""
    beware: BewareList
    """Classes that the robot must avoid."""
    config: NavigatorConfig
    """Navigation parameters."""
    drawn: frozenset[int] = frozenset()
    """Seeds whose figures are drawn besides those of failed episodes."""


def evaluate_scenario(
    task: Task,
    *,
    seeds: Sequence[int],
    out: Path,
    beware: BewareList,
    fleet: Fleet = HERE,
    perception: Perception | None = None,
    robot: RobotProfile = HUSKY,
    draw_first: int = 1,
    config: NavigatorConfig | None = None,
) -> dict[str, Any]:
    """Drive one episode per seed, print tables, and write `summary.json` and figures.

    Returns the summary. `config` defaults to the configuration of the robot. The figures of the
    first `draw_first` episodes and of all failed ones are written to `out/figures/seed-…`.
    """
    config, drawn = config or config_for(robot), frozenset(seeds[:draw_first])
    perception = perception or colour_perception(config=config.perception)
    # Each worker composes the same segmenter again, with the chosen engine and one thread.
    choice = dataclasses.replace(perception.choice, threads=1)
    segmenter = str(task.ablation) if task.ablation in NEEDS_NO_SEGMENTER else perception.identity
    common = Evaluation(task=task, robot=robot, beware=beware, config=config, drawn=drawn)
    campaign = Campaign(
        suite=Suite.RANDOM if task.random else Suite.GIVEN,
        key="seed",
        rules=(task, beware.classes, robot, config, segmenter),
        holds="another world, task, ablation, odometry, robot, configuration, beware list, "
        "segmenter or time limit",
        drive=partial(_drive, common=common, perception=perception),
        drive_alone=partial(_drive_alone, common=common, choice=choice),
        report_of=attrgetter("report"),
        after=partial(_write_figures, folder=out / "figures"),
    )
    reports = campaign.run(seeds, fleet=fleet, out=out)
    summary = CONCLUSIONS[campaign.suite].write(command_line(), reports, out)
    with writing(out):
        _draw(reports, task.scenario, out / "figures")
    return summary


def _summary(suite: Suite, command: str, reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    world = reports[0]["scenario"]
    return origin_of_drives(suite, command, reports, scenario=world) | summarise(reports)


def _show(_: Sequence[dict[str, Any]], summary: dict[str, Any]) -> None:
    terminal = Terminal(width=None if sys.stdout.isatty() else 140)
    for table in tables_of(summary):
        terminal.print(table)


CONCLUSIONS: Mapping[str, Conclusion] = {
    suite: Conclusion(summarise=partial(_summary, suite), show=_show)
    for suite in (Suite.RANDOM, Suite.GIVEN)
}
"""What is made of missions whose start and goal each seed draws, and of those of a world."""


def _draw(reports: Sequence[dict[str, Any]], scenario: Scenario, folder: Path) -> None:
    from app.evaluation.plots import all_drives, progress, save
    from sim.scenario.variation import randomise

    # Of episodes that were kept with the project only the last value of each series is left.
    whole = [report for report in reports if len(report["series"]["t_s"]) > 1]
    if not whole:
        return
    missing = f", {len(reports) - len(whole)} more without series" * (len(whole) < len(reports))
    world = randomise(scenario, int(whole[0]["seed"]))
    folder.mkdir(parents=True, exist_ok=True)
    title = f"{world.name}, {len(whole)} episodes{missing}"
    save(progress(whole, title), folder / "progress")
    where = f"{title}; obstacles of seed {whole[0]['seed']}"
    save(all_drives(whole, world, where), folder / "drives")


@dataclass(frozen=True, slots=True)
class DrivenEpisode:
    """What came of an episode, as a value: its worker may be another machine."""

    report: dict[str, Any]
    """Report of the episode."""
    figures: dict[str, bytes]
    """Contents of its figures by file name; empty where none were drawn."""
    failure: str | None = None
    """Why its figures could not be drawn; None where they were, or none were wanted."""


def _write_figures(driven: DrivenEpisode, *, folder: Path) -> None:
    """Write the figures of an episode into a folder of its seed; raises `BadConfiguration`, and
    `BewareNavError` for an episode whose figures could not be drawn."""
    seed = driven.report["seed"]
    if driven.failure is not None:
        raise BewareNavError(f"the figures of seed {seed} cannot be drawn: {driven.failure}")
    if driven.figures:
        own = folder / f"seed-{seed:04d}"
        with writing(own):
            own.mkdir(parents=True, exist_ok=True)
            for name, content in driven.figures.items():
                (own / name).write_bytes(content)


def _drive_alone(seed: int, *, common: Evaluation, choice: SegmenterChoice) -> DrivenEpisode:
    perception = compose(choice, sensor=common.robot.depth_sensor, config=common.config.perception)
    return _drive(seed, common=common, perception=perception)


def _drive(seed: int, *, common: Evaluation, perception: Perception) -> DrivenEpisode:
    from app.episode.keyframes import Keyframes
    from app.evaluation.plots import plot_episode

    episode = episode_of(
        common.task,
        seed,
        robot=common.robot,
        beware=common.beware,
        perception=perception,
        config=common.config,
    )
    try:
        keyframes = Keyframes(episode)
        report = episode.run()
        if seed not in common.drawn and report["success"]:
            return DrivenEpisode(report, {})
        try:
            with tempfile.TemporaryDirectory() as folder:
                plot_episode(report, episode, keyframes, Path(folder))
                figures = {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}
        except Exception as error:  # told once the report of many minutes is recorded
            return DrivenEpisode(report, {}, failure=f"{type(error).__name__}: {error}")
        return DrivenEpisode(report, figures)
    finally:
        episode.close()
