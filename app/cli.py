"""`bewarenav`: one command line for console, headless missions, evaluation and figures.

Bad input ends with one clear line and exit code 2.
"""

from __future__ import annotations

import json
import logging
import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console as Terminal
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from app.arguments import point, prepare
from app.dataset_cli import dataset_cli
from app.plan_cli import plan
from app.segment_cli import segment
from app.segmenter_choice import BackendOption, KindOption, SegmenterChoice, WeightsOption
from app.train_cli import train
from app.weights_cli import weights_cli
from navcore.beware import BewareList, default_beware_list, load_beware_list
from navcore.errors import BewareNavError

cli = typer.Typer(
    help="Operator console and navigation for a robot that understands what it must not touch.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
cli.add_typer(dataset_cli, name="dataset")
cli.add_typer(weights_cli, name="weights")
cli.command()(train)
cli.command()(segment)
ScenarioOption = Annotated[str, typer.Option("--scenario", metavar="NAME|FILE.toml", help="A built-in world or a world file.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same run.")]
BewareOption = Annotated[Path | None, typer.Option("--beware", metavar="FILE.toml", help="Beware list to drive with.")]


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
    host: Annotated[str, typer.Option(help="Address to listen on; anything but loopback asks for a login.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535)] = 8000,
    data: Annotated[Path, typer.Option(metavar="DIR", help="Where zones, beware list and runs are kept.")] = Path("data"),
    seed: SeedOption = 0,
    segmenter: KindOption = "auto",
    weights: WeightsOption = None,
    backend: BackendOption = "auto",
) -> None:
    """Start the operator console with the simulated robot."""
    from app.console import run_console

    choice = SegmenterChoice(kind=segmenter, weights=weights, engine=backend)
    run_console(scenario=scenario, host=host, port=port, data=data, seed=seed, choice=choice)


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
) -> None:
    """Drive a mission without a console, as fast as the machine allows; exit code 0 only without any violation."""
    from app.episode import Episode
    from app.plots import plot_episode
    from app.segmenter import compose
    from sim.scenario import load_scenario

    goals = tuple(point(text, "--goal") for text in goal or [])
    for folder in ([report.parent] if report else []) + ([plots] if plots else []):
        prepare(folder)
    world, listed = load_scenario(scenario), _beware(beware)
    perception = compose(SegmenterChoice(kind=segmenter, weights=weights, engine=backend))
    episode = Episode(world, seed=seed, beware=listed, goals=goals, max_time_s=max_time, perception=perception)
    try:
        with Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=Terminal(stderr=True)) as bar:
            task = bar.add_task("starting", total=1.0)
            result = episode.run(lambda progress: bar.update(task, description=progress.text(), completed=progress.share))
        if plots is not None:
            plot_episode(result, episode, plots)
    finally:
        episode.close()
    if report is not None:
        report.write_text(json.dumps(result, indent=1), encoding="utf-8")
    typer.echo(
        f"{'success' if result['success'] else 'FAILED'}: {result['goals_reached']} of {len(result['goals'])} goals, "
        f"{result['collisions']} collisions, {result['beware_intrusions']} beware and {result['zone_intrusions']} zone "
        f"intrusions, {result['distance_m']:.1f} m in {result['sim_time_s']:.0f} s, {result['wall_time_s']:.0f} s of real time"
    )
    sys.exit(0 if result["success"] else 1)


@cli.command()
def evaluate(
    suite: Annotated[str, typer.Argument(help="A scenario, e.g. office.")],
    episodes: Annotated[int, typer.Option(min=1, max=10_000)] = 10,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode; the others follow.")] = 0,
    workers: Annotated[int, typer.Option(min=1, max=64)] = 1,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Where episodes.jsonl and summary.json go.")] = None,
    max_time: Annotated[float, typer.Option(metavar="S", min=1.0)] = 600.0,
    beware: BewareOption = None,
    segmenter: KindOption = "auto",
    weights: WeightsOption = None,
    backend: BackendOption = "auto",
) -> None:
    """Drive many seeded episodes and print what came of them; resumes where it was interrupted."""
    from app.evaluate import evaluate_scenario
    from app.segmenter import compose

    summary = evaluate_scenario(
        suite,
        seeds=range(seed, seed + episodes),
        workers=workers,
        out=out or Path("runs") / suite,
        max_time_s=max_time,
        beware=_beware(beware),
        perception=compose(SegmenterChoice(kind=segmenter, weights=weights, engine=backend)),
    )
    sys.exit(0 if summary["success_rate"] == 1.0 else 1)


@cli.command()
def bench(
    scenario: ScenarioOption = "office",
    seconds: Annotated[float, typer.Option(min=1.0, help="Simulated seconds to drive.")] = 30.0,
) -> None:
    """Print this machine's figures: time per stage of a tick, and simulated seconds per second."""
    from app.bench import run_bench

    run_bench(scenario, seconds)


@cli.command()
def doctor() -> None:
    """Say what is installed, what is missing and what to do about it."""
    from app.doctor import examine

    sys.exit(examine())


cli.command()(plan)


def _beware(path: Path | None) -> BewareList:
    return default_beware_list() if path is None else load_beware_list(path)


def _refuse(text: str) -> NoReturn:
    typer.echo(f"bewarenav: {text}", err=True)
    sys.exit(2)
