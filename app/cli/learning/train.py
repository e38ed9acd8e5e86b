"""`bewarenav train`: train the network on a data set."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from navcore.errors import BadConfiguration


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainSettings:
    """The argument and the options of the command."""

    data: Annotated[
        Path,
        typer.Option("--data", metavar="DIR", help="Data set folder; see `bewarenav dataset`."),
    ]
    recipe: Annotated[
        Path | None,
        typer.Argument(metavar="RECIPE.toml", help="Training configuration; else the defaults."),
    ] = None
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of model, state and report.")
    ] = Path("runs/train")
    start: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.safetensors",
            help="Initial weights, e.g. to add your own images or classes.",
        ),
    ] = None
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Continue the run in --out; loses at most one epoch."),
    ] = False
    device: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto"
    workers: Annotated[int, typer.Option(min=0, max=64, help="Threads that prepare images.")] = 2
    threads: Annotated[
        int, typer.Option(min=0, max=256, help="Threads that compute; 0 = one per core.")
    ] = 0
    cache_mb: Annotated[
        int, typer.Option(min=0, help="Memory for decoded images, megabytes per process.")
    ] = 4096
    rendered: Annotated[
        bool,
        typer.Option(
            "--rendered",
            help="Train on worlds that --workers processes render meanwhile instead of the train "
            "split, for a GPU; their images take --cache-mb of its memory.",
        ),
    ] = False


def train(settings: TrainSettings) -> None:
    """Train a network on a data set: model.safetensors, its card and its measurements. Under
    torchrun on several processes."""
    import torch

    from app.learning import report as training_report
    from app.learning import training
    from navcore.learning.data.dataset import load_dataset
    from navcore.learning.training.recipe import Recipe, load_recipe
    from navcore.perception.esanet.weights.weights_file import load

    cores = (os.cpu_count() or 1) // int(os.environ.get("LOCAL_WORLD_SIZE", "1"))
    # The package app has capped all libraries at one thread.
    torch.set_num_threads(settings.threads or max(1, cores))
    recipe = Recipe() if settings.recipe is None else load_recipe(settings.recipe)
    if not settings.rendered and not (settings.data / "train_rgb.txt").is_file():
        raise BadConfiguration(
            f"--data {settings.data}: no data set with a train split (train_rgb.txt) is there"
        )
    started = time.monotonic()
    run = training.train(
        recipe,
        load_dataset(settings.data),
        settings.out,
        resume=settings.resume,
        start=None if settings.start is None else load(settings.start),
        device=settings.device,
        workers=settings.workers,
        cache_mb=settings.cache_mb,
        rendered=settings.rendered,
    )
    if run is not None:
        training_report.report(
            run, command=["bewarenav", *sys.argv[1:]], seconds=time.monotonic() - started
        )
