"""`bewarenav`: the command line for the console, headless missions, evaluations and benchmarks.

Bad input ends with one clear line and exit code 2.
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from app.bench.parts import BenchPart
from app.cli.console import console
from app.cli.drive import drive
from app.cli.evaluate.command import evaluate
from app.cli.laser_log import laser_log
from app.cli.learning.dataset import dataset_cli
from app.cli.learning.segment import segment
from app.cli.learning.train import train
from app.cli.learning.weights import weights_cli
from app.cli.options import CameraOption, ScenarioOption, camera_stream, takes_options
from app.cli.plan import plan
from app.cli.replay import replay
from app.cli.results import compare, merge
from app.cli.sites import site_cli
from app.cli.users import users_cli
from app.runtime.start.segmenter_choice import Kind
from navcore.errors import BadConfiguration, BewareNavError

cli = typer.Typer(
    help="Operator console and navigation for a robot that understands what it must not touch.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
cli.add_typer(dataset_cli, name="dataset")
cli.add_typer(weights_cli, name="weights")
cli.add_typer(users_cli, name="users")
cli.add_typer(site_cli, name="site")
cli.command()(takes_options(train))
cli.command()(takes_options(segment))
cli.command()(takes_options(plan))
cli.command()(takes_options(replay))
cli.command()(takes_options(laser_log))
cli.command()(takes_options(evaluate))
cli.command()(merge)
cli.command()(compare)
cli.command()(takes_options(console))
cli.command()(takes_options(drive))


def main() -> None:
    """Run the command line; refusals of this project become one line and exit code 2."""
    logging.basicConfig(
        level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s"
    )
    for chatty in ("httpx", "websockets", "viser", "trimesh", "matplotlib"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
    try:
        cli()
    except BewareNavError as error:
        _refuse(str(error))


@cli.command()
def bench(
    part: Annotated[
        list[BenchPart] | None, typer.Argument(help="What to measure; everything if left out.")
    ] = None,
    scenario: ScenarioOption = "office",
    seconds: Annotated[float, typer.Option(min=1.0, help="Simulated seconds to drive.")] = 30.0,
    maps: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Published maps to plan on; two made forests if left out."
        ),
    ] = None,
    ticks: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help="Keep the times of the part `latency` here."),
    ] = None,
    samples: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help="Keep the samples of the part `soak` here."),
    ] = None,
    segmenter: Annotated[
        Kind, typer.Option(help="What segments the images of the part `soak`.")
    ] = "network",
    camera: CameraOption = None,
    peers: Annotated[
        bool,
        typer.Option(
            "--peers",
            help="Install pyastar2d and scikit-image into build/bench-peers, and plan with them.",
        ),
    ] = False,
    against: Annotated[
        str | None,
        typer.Option(
            metavar="REVISION",
            help="Run this benchmark in turn in another revision, and print the ratios.",
        ),
    ] = None,
) -> None:
    """Measure this machine: a drive, a tick on a large map, segmentation by engine, planners, a
    live map, a page, training, the ticks of the console, what the console holds over time."""
    from app.bench.main import print_comparison, run_bench
    from app.bench.planning.peers import install_peers

    parts = part or list(BenchPart)
    if against is not None:
        if ticks is not None or samples is not None or peers:
            raise BadConfiguration(
                "--ticks, --samples and --peers are of one benchmark, and --against runs several"
            )
        if scenario.endswith(".toml"):
            scenario = str(Path(scenario).resolve())  # each revision runs in a folder of its own
        options = ["--scenario", scenario, "--seconds", str(seconds)]
        # Not where it is left out: an old revision may lack the option.
        options += [] if segmenter == "network" else ["--segmenter", segmenter]
        options += [] if maps is None else ["--maps", str(maps.resolve())]
        options += [] if camera is None else ["--camera", camera]
        print_comparison(against, [*parts, *options])
        return
    if peers:
        install_peers()
    run_bench(
        parts,
        scenario,
        seconds,
        maps=maps,
        ticks=ticks,
        samples=samples,
        segmenter=segmenter,
        camera=None if camera is None else camera_stream(camera),
    )


@cli.command()
def doctor() -> None:
    """Check what is installed, and print what is missing and how to install it."""
    from app.cli.doctor import examine

    sys.exit(examine())


def _refuse(text: str) -> NoReturn:
    typer.echo(f"bewarenav: {text}", err=True)
    sys.exit(2)
