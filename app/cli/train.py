"""`bewarenav train`: teach the network a data set."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from navcore.errors import BadConfiguration


def train(
    data: Annotated[
        Path,
        typer.Option("--data", metavar="DIR", help="Data set folder; see `bewarenav dataset`."),
    ],
    recipe: Annotated[
        Path | None,
        typer.Argument(metavar="RECIPE.toml", help="Without it the defaults are taken."),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Where model, state and report go.")
    ] = Path("runs/train"),
    start: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.safetensors",
            help="Weights to go on from, e.g. to add your own pictures or classes.",
        ),
    ] = None,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Go on with the run in --out; at most one epoch was lost."),
    ] = False,
    device: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto",
    workers: Annotated[int, typer.Option(min=0, max=64, help="Threads that prepare pictures.")] = 2,
    threads: Annotated[
        int, typer.Option(min=0, max=256, help="Threads that compute; 0 = one per core.")
    ] = 0,
    cache_mb: Annotated[
        int, typer.Option(min=0, help="Memory for decoded pictures, per process.")
    ] = 4096,
) -> None:
    """Train a network on a data set: model.safetensors, its card and its figures. Under torchrun on
    several processes."""
    import torch

    from app.learning import report as training_report
    from app.learning import training
    from navcore.learning.data.dataset import load_dataset
    from navcore.learning.training.recipe import Recipe, load_recipe
    from navcore.perception.esanet.weights.weights_file import load

    cores = (os.cpu_count() or 1) // int(os.environ.get("LOCAL_WORLD_SIZE", "1"))
    torch.set_num_threads(
        threads or max(1, cores)
    )  # the package app has capped all libraries at one
    chosen = Recipe() if recipe is None else load_recipe(recipe)
    if not (data / "train_rgb.txt").is_file():
        raise BadConfiguration(
            f"--data {data}: no data set with a train split (train_rgb.txt) is there"
        )
    started = time.monotonic()
    run = training.train(
        chosen,
        load_dataset(data),
        out,
        resume=resume,
        start=None if start is None else load(start),
        device=device,
        workers=workers,
        cache_mb=cache_mb,
    )
    if run is not None:
        training_report.report(
            run, command=["bewarenav", *sys.argv[1:]], seconds=time.monotonic() - started
        )
