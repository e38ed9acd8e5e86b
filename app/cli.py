"""`bewarenav`: one command line for console, headless missions, evaluation and figures.

Bad input ends with one clear line and exit code 2.
"""

from __future__ import annotations

import json
import logging
import sys
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer
from rich.console import Console as Terminal
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from app.arguments import (
    Ablation,
    AblationOption,
    BenchPart,
    BewareOption,
    KeptOption,
    LevelOption,
    NavigationOption,
    PriorOption,
    RandomOption,
    ZonesOption,
    beware_list,
    point,
    prepare,
)
from app.dataset_cli import dataset_cli
from app.evaluate_cli import compare, evaluate
from app.plan_cli import plan
from app.replay_cli import replay
from app.segment_cli import segment
from app.segmenter_choice import BackendOption, KindOption, SegmenterChoice, WeightsOption
from app.train_cli import train
from app.users_cli import users_cli
from app.weights_cli import weights_cli
from navcore.errors import BewareNavError

cli = typer.Typer(
    help="Operator console and navigation for a robot that understands what it must not touch.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
cli.add_typer(dataset_cli, name="dataset")
cli.add_typer(weights_cli, name="weights")
cli.add_typer(users_cli, name="users")
cli.command()(train)
cli.command()(segment)
cli.command()(plan)
cli.command()(replay)
cli.command()(evaluate)
cli.command()(compare)
ScenarioOption = Annotated[str, typer.Option("--scenario", metavar="NAME|FILE.toml", help="A built-in world or a world file.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same run.")]


def main() -> None:
    """Run the command line; refusals of this project become one line and exit code 2."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    for chatty in ("httpx", "websockets", "viser", "trimesh", "matplotlib"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
    try:
        cli()
    except BewareNavError as error:
        _refuse(str(error))


@cli.command()
def console(
    scenario: ScenarioOption = "office",
    recording: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Play a recording, as for `replay`, instead of the simulated robot.")
    ] = None,
    level: LevelOption = False,
    host: Annotated[str, typer.Option(help="Address to listen on; anything but loopback asks for a login.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535)] = 8000,
    data: Annotated[Path, typer.Option(metavar="DIR", help="Where zones, beware list and runs are kept.")] = Path("data"),
    seed: SeedOption = 0,
    segmenter: KindOption = "auto",
    weights: WeightsOption = None,
    backend: BackendOption = "auto",
    prior: PriorOption = None,
    kept: KeptOption = None,
    navigation: NavigationOption = None,
    login: Annotated[bool, typer.Option("--login", help="Ask for a login on loopback too.")] = False,
    unattended: Annotated[
        Literal["go on", "pause"], typer.Option(help="What a mission does when whoever was in control has gone silent.")
    ] = "go on",
) -> None:
    """Start the operator console with the simulated robot, or before a recording."""
    from app.ports import taken_port

    listener = taken_port(host, port)  # before anything that takes a second
    from app.console import ConsoleOptions, run_console

    if kept is not None:
        prepare(kept.parent)
    options = ConsoleOptions(
        scenario=scenario,
        recording=recording,
        level=level,
        host=host,
        port=port,
        data=data,
        seed=seed,
        choice=SegmenterChoice(kind=segmenter, weights=weights, engine=backend, live=True),
        prior=prior,
        kept=kept,
        navigation=navigation,
        login=login,
        unattended=unattended,
    )
    run_console(options, listener=listener)


@cli.command()
def drive(
    scenario: ScenarioOption = "office",
    goal: Annotated[list[str] | None, typer.Option(metavar="X,Y", help="Metres of the map frame; repeat for more.")] = None,
    seed: SeedOption = 0,
    max_time: Annotated[float, typer.Option(metavar="S", min=1.0, help="Simulated seconds after which to give up.")] = 600.0,
    report: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the episode report here.")] = None,
    plots: Annotated[Path | None, typer.Option(metavar="DIR", help="Write plots of the episode here.")] = None,
    beware: BewareOption = None,
    segmenter: KindOption = "auto",
    weights: WeightsOption = None,
    backend: BackendOption = "auto",
    prior: PriorOption = None,
    kept: KeptOption = None,
    navigation: NavigationOption = None,
    random: RandomOption = False,
    zones: ZonesOption = None,
    ablation: AblationOption = Ablation.NONE,
) -> None:
    """Drive a mission without a console, as fast as the machine allows; exit code 0 only without any violation."""
    from app.album import Album
    from app.known_world import keep, recall
    from app.plots import plot_episode
    from app.segmenter import compose
    from app.task import Task, episode_of
    from navcore.config import load_config
    from navcore.robot import HUSKY
    from sim.scenario import load_scenario

    goals = tuple(point(text, "--goal") for text in goal or [])
    for folder in [*(file.parent for file in (report, kept) if file is not None), *([plots] if plots else [])]:
        prepare(folder)
    about = Task(
        scenario=load_scenario(scenario), goals=goals, random=random, zones=zones, ablation=ablation, max_time_s=max_time
    )
    listed, config = beware_list(beware), None if navigation is None else load_config(navigation)
    # After what can be wrong at a glance: trying the engines takes seconds.
    perception = compose(SegmenterChoice(kind=segmenter, weights=weights, engine=backend))
    episode = episode_of(about, seed, robot=HUSKY, beware=listed, perception=perception, config=config)
    try:
        album = Album(episode)
        recall(episode.pilot.navigator.map, listed, prior=prior, kept=kept)
        with Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=Terminal(stderr=True)) as bar:
            shown = bar.add_task("starting", total=1.0)
            result = episode.run(lambda progress: bar.update(shown, description=progress.text(), completed=progress.share))
        if report is not None:
            report.write_text(json.dumps(result, indent=1), encoding="utf-8")
        keep(episode.pilot.navigator.map, listed, kept)
        if plots is not None:
            plot_episode(result, episode, album, plots)
    finally:
        episode.close()
    typer.echo(
        f"{'success' if result['success'] else 'FAILED'}: {result['goals_reached']} of {len(result['goals'])} goals, "
        f"{result['collisions']} collisions, {result['beware_intrusions']} beware and {result['zone_intrusions']} zone "
        f"intrusions, {result['distance_m']:.1f} m in {result['sim_time_s']:.0f} s, {result['wall_time_s']:.0f} s of real time"
    )
    sys.exit(0 if result["success"] else 1)


@cli.command()
def bench(
    part: Annotated[list[BenchPart] | None, typer.Argument(help="What to measure; everything if left out.")] = None,
    scenario: ScenarioOption = "office",
    seconds: Annotated[float, typer.Option(min=1.0, help="Simulated seconds to drive; for `page`, of each row.")] = 30.0,
) -> None:
    """Print this machine's figures: a drive, a tick on a large map, planners, segmentation by engine, a live map, a page."""
    from app.bench import run_bench

    run_bench(part or list(BenchPart), scenario, seconds)


@cli.command()
def reliability(
    row: Annotated[list[int] | None, typer.Option(min=1, max=25, help="Only this row; repeat for more.")] = None,
    factor: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Multiplies the number of trials.")] = 1.0,
) -> None:
    """Measure the promises of the reliability page and print them; exit code 0 only when all are met."""
    from app.reliability import measure_reliability

    sys.exit(measure_reliability(rows=frozenset(row or ()), factor=factor))


@cli.command()
def doctor() -> None:
    """Say what is installed, what is missing and what to do about it."""
    from app.doctor import examine

    sys.exit(examine())


def _refuse(text: str) -> NoReturn:
    typer.echo(f"bewarenav: {text}", err=True)
    sys.exit(2)
