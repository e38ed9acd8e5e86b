"""`bewarenav dataset`: render labelled pictures of random worlds."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console as Terminal
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from app.cli.import_dataset import import_cli, info
from navcore.errors import BadConfiguration

if TYPE_CHECKING:
    from sim.dataset.generate import (
        Picture,
        Split,
    )  # at run time they would make every command wait for the simulator

dataset_cli = typer.Typer(
    help="Data sets for the segmentation: render, import and look at them.", no_args_is_help=True
)
dataset_cli.add_typer(import_cli, name="import")
dataset_cli.command()(info)

POSES_PER_WORLD = 8
WORLDS_PER_JOB = 25
"""A process makes the pictures of so many worlds before it ends, because the renderers keep some of
their memory."""
RendererName = Literal["auto", "tiny", "egl"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Some pictures of one split, which one process makes."""

    split: Split
    seed: int
    """Of their worlds."""
    count: int
    """How many."""
    size: tuple[int, int]
    """Columns and rows."""
    renderer: RendererName
    """What draws them."""


@dataset_cli.command()
def render(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="Folder to make; it must be empty if it is there.")
    ],
    train: Annotated[
        int, typer.Option(min=0, max=1_000_000, help="Number of pictures to train with.")
    ] = 4500,
    valid: Annotated[
        int,
        typer.Option(min=0, max=1_000_000, help="Number of pictures to choose the best epoch by."),
    ] = 300,
    test: Annotated[
        int, typer.Option(min=0, max=1_000_000, help="Number of pictures to measure with.")
    ] = 600,
    seed: Annotated[
        int, typer.Option(min=0, max=1000, help="The same seed gives the same pictures.")
    ] = 0,
    size: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WxH",
            help="Columns and rows of a picture; several take turns. 424x240 if left out.",
        ),
    ] = None,
    renderer: Annotated[
        RendererName, typer.Option(help="auto: EGL for two thirds of the worlds where it works.")
    ] = "auto",
    workers: Annotated[int, typer.Option(min=1, max=64, help="Processes that render.")] = 1,
) -> None:
    """Render labelled pictures of random worlds; no world of one split is in another."""
    from navcore.learning.data.class_names import BEWARE_CLASSES
    from navcore.learning.data.writer import DatasetWriter

    counts: dict[Split, int] = {"train": train, "valid": valid, "test": test}
    jobs = _jobs(counts, seed, [_size(text) for text in size or ["424x240"]], renderer)
    source = {
        "made_by": "bewarenav dataset render",
        "seed": seed,
        "renderer": renderer,
        "poses_per_world": POSES_PER_WORLD,
    }
    writer = DatasetWriter(out, class_names=BEWARE_CLASSES, units_per_m=1000.0, source=source)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with (
        Progress(*columns, console=Terminal(stderr=True)) as bar,
        closing(_rendered(jobs, workers)) as results,
    ):
        task = bar.add_task("rendering", total=sum(counts.values()))
        for split, pictures in results:
            for picture in pictures:
                writer.add(split, picture.name, picture.rgb, picture.depth_mm, picture.labels)
                bar.advance(task)
    writer.finish()
    typer.echo(f"{out}: {train} pictures to train, {valid} to validate and {test} to test with")


def _jobs(
    counts: Mapping[Split, int], seed: int, sizes: Sequence[tuple[int, int]], renderer: RendererName
) -> list[Job]:
    """The shards of every split; with several sizes each shard has the next one, so every split has
    a share of each."""
    from sim.dataset.generate import SHARDS_PER_SPLIT, shard_seed

    most = POSES_PER_WORLD * WORLDS_PER_JOB
    if max(counts.values()) > most * SHARDS_PER_SPLIT:
        raise BadConfiguration(
            f"a split of {max(counts.values())} pictures, allowed up to {most * SHARDS_PER_SPLIT}"
        )
    return [
        Job(
            split=split,
            seed=shard_seed(seed, split, shard),
            count=min(most, count - shard * most),
            size=sizes[shard % len(sizes)],
            renderer=renderer,
        )
        for split, count in counts.items()
        for shard in range(-(-count // most))
    ]


def _rendered(jobs: list[Job], workers: int) -> Generator[tuple[Split, list[Picture]]]:
    """The pictures of each job, in the order of the jobs."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, _hush, max_tasks_per_child=1) as pool:
        try:
            yield from pool.map(_render, jobs)
        except BrokenProcessPool:
            # A pool of `multiprocessing` would start another process and wait for the lost pictures
            # for ever.
            raise BadConfiguration(
                "a process that renders was killed; if memory is short, say fewer --workers"
            ) from None
        finally:
            pool.shutdown(cancel_futures=True)


def _hush() -> None:
    """The renderers talk in the middle of the progress bar; what goes wrong comes back as an
    exception."""
    with Path(os.devnull).open("w", encoding="ascii") as nowhere:
        for stream in (1, 2):
            os.dup2(nowhere.fileno(), stream)


def _render(job: Job) -> tuple[Split, list[Picture]]:
    import cv2

    from sim.dataset.generate import render_pictures

    cv2.setNumThreads(1)
    pictures = render_pictures(
        seed=job.seed,
        worlds=-(-job.count // POSES_PER_WORLD),
        poses_per_world=POSES_PER_WORLD,
        size=job.size,
        renderer=job.renderer,
    )
    return job.split, list(pictures)[: job.count]


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if not (16 <= width <= 4096 and 16 <= height <= 4096):
        raise BadConfiguration(
            f"--size {text!r}: expected WxH in pixels, 16 to 4096 each, e.g. 424x240"
        )
    return width, height
