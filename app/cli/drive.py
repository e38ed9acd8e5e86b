"""`bewarenav drive`: one mission without a console."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console as Terminal
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from app.cli.options import (
    AblationOption,
    BewareOption,
    CameraOption,
    GnssOption,
    LatencyOption,
    NavigationOption,
    OdometryOption,
    PriorOption,
    RandomOption,
    RobotOption,
    SavedMapOption,
    ScannerOption,
    ScenarioOption,
    SeedOption,
    SegmenterOptions,
    YieldingOption,
    ZonesOption,
    beware_list,
    camera_stream,
    point,
    prepare,
    robot_profile,
)
from app.episode.ablations import Ablation
from navcore.errors import BadConfiguration
from navcore.files import is_there, write_whole
from sim.robot.odometry_grade import OdometryGrade

if TYPE_CHECKING:
    from app.episode.episode import Episode
    from app.replay.recording import RecordingWriter
    from navcore.navigator import TickResult


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSettings:
    """The options of the command."""

    scenario: ScenarioOption = "office"
    goal: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y", help="A goal in metres of the map frame; repeat for more."),
    ] = None
    seed: SeedOption = 0
    max_time: Annotated[
        float, typer.Option(metavar="S", min=1.0, help="Time limit in simulated seconds.")
    ] = 600.0
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the episode report here.")
    ] = None
    plots: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write plots of the episode here.")
    ] = None
    record: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Record images and poses here, as `replay` reads them."),
    ] = None
    beware: BewareOption = None
    segmentation: SegmenterOptions = field(default_factory=SegmenterOptions)
    prior: PriorOption = None
    kept: SavedMapOption = None
    navigation: NavigationOption = None
    random: RandomOption = False
    zones: ZonesOption = None
    ablation: AblationOption = Ablation.NONE
    odometry: OdometryOption = OdometryGrade.TYPICAL
    gnss: GnssOption = None
    camera: CameraOption = None
    robot: RobotOption = "husky"
    scanner: ScannerOption = False
    latency: LatencyOption = "live"
    yielding: YieldingOption = False


def drive(settings: DriveSettings) -> None:
    """Drive a mission without a console, as fast as the machine allows; exit code 0 only without
    any violation."""
    from app.episode.keyframes import Keyframes
    from app.episode.latency import latency_of
    from app.episode.task import Task, check_goals, episode_of
    from app.evaluation.plots import plot_episode
    from app.replay.recording import RecordingWriter
    from app.runtime.record.map_persistence import load_map, save_map
    from app.runtime.start.preparation import prepared_perception
    from navcore.config.navigator import load_config
    from navcore.config.perception.perception import DEFAULT_PERCEPTION
    from navcore.formats import nav2_map
    from navcore.mapping.storage import map_file
    from sim.scenario.load import load_scenario

    robot = robot_profile(settings.robot, scanner=settings.scanner)
    camera = camera_stream(settings.camera, robot.stream)
    goals = tuple(point(text, "--goal") for text in settings.goal or [])
    files = [file for file in (settings.report, settings.kept) if file is not None]
    folders = [folder for folder in (settings.plots, settings.record) if folder is not None]
    for folder in [*(file.parent for file in files), *folders]:
        prepare(folder)
    if settings.prior is not None:
        nav2_map.load(settings.prior)
    for file in files:
        if is_there(file) and file.is_dir():
            raise BadConfiguration(f"{file} is a folder; give the name of a file")
    if settings.kept is not None and is_there(settings.kept):
        map_file.load(settings.kept)
    writer = None if settings.record is None else RecordingWriter(settings.record)
    task = Task(
        scenario=load_scenario(settings.scenario, robot),
        goals=goals,
        random=settings.random,
        zones=settings.zones,
        ablation=settings.ablation,
        odometry=settings.odometry,
        gnss=settings.gnss,
        camera=camera,
        latency=latency_of(settings.latency),
        yielding=settings.yielding,
        max_time_s=settings.max_time,
    )
    check_goals(task.world)
    beware = beware_list(settings.beware, task.scenario)
    config = None if settings.navigation is None else load_config(settings.navigation, robot)
    tuning = DEFAULT_PERCEPTION if config is None else config.perception
    # Last, because this takes seconds, and the checks above take none.
    perception = prepared_perception(
        settings.segmentation.choice(camera=camera), sensor=robot.depth_sensor, config=tuning
    )
    episode = episode_of(
        task, settings.seed, robot=robot, beware=beware, perception=perception, config=config
    )
    try:
        keyframes, world = Keyframes(episode), episode.controller.navigator.map
        if writer is not None:
            _record(episode, writer)
        load_map(world, beware, prior=settings.prior, kept=settings.kept)
        episode.controller.navigator.adopt_map()
        result = _run(episode)
        if settings.report is not None:
            write_whole(settings.report, json.dumps(result, indent=1).encode())
        held = episode.controller.navigator.held_map
        save_map(world, beware, settings.kept, held)
        if settings.kept is not None and held is not None:
            typer.echo(
                f"{settings.kept} is without what was seen last: the robot was not sure of its "
                "place in this map",
                err=True,
            )
        if settings.plots is not None:
            plot_episode(result, episode, keyframes, settings.plots)
    finally:
        episode.close()
    typer.echo(_in_words(result))
    sys.exit(0 if result["success"] else 1)


def _record(episode: Episode, writer: RecordingWriter) -> None:
    """Write the images of an episode, in the map as the robot has placed them."""
    note = episode.on_decision

    def note_and_write(t_s: float, decision: TickResult) -> None:
        note(t_s, decision)
        writer.add(decision.frame)

    episode.on_decision = note_and_write


def _run(episode: Episode) -> dict[str, Any]:
    """Run an episode behind a progress bar; return its report."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Terminal(stderr=True)) as bar:
        shown = bar.add_task("starting", total=1.0)
        return episode.run(
            lambda progress: bar.update(
                shown, description=progress.text(), completed=progress.share
            )
        )


def _in_words(result: dict[str, Any]) -> str:
    return (
        f"{'success' if result['success'] else 'FAILED'}: "
        f"{result['goals_reached']} of {len(result['goals'])} goals, "
        f"{result['collisions']} collisions, {result['beware_intrusions']} beware, "
        f"{result['zone_intrusions']} zone and {result['ground_intrusions']} ground intrusions, "
        f"{result['distance_m']:.1f} m in "
        f"{result['sim_time_s']:.0f} s, {result['wall_time_s']:.0f} s of real time"
    )
