"""Figures of the training: pictures per second of this machine, and mOSD as a data set to train on.

python -m app.bench_learning speed python -m app.bench_learning mosd FOLDER OUT    FOLDER/learn and
FOLDER/test with NN.rgb.jpg, NN.depth.png, NN.semantic.png
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Annotated

import torch
import typer

from app.learning.training import keep_freed_memory
from navcore.errors import BadConfiguration
from navcore.learning.data.card import Split
from navcore.learning.data.dataset import DatasetWriter
from navcore.learning.data.images import read_depth, read_grey, read_rgb
from navcore.learning.training.batches import Batch
from navcore.learning.training.initial_weights import fresh_network
from navcore.learning.training.recipe import Recipe
from navcore.learning.training.trainer import training_loss
from navcore.perception.esanet.network.preprocess import Size

bench = typer.Typer(help="Figures of the training.", no_args_is_help=True)
SIZES = (Size(height=256, width=320), Size(height=256, width=448))
CLASSES = 12


@bench.command()
def speed(
    threads: Annotated[int, typer.Option(min=0, help="0 = one per core.")] = 0,
    steps: Annotated[
        int, typer.Option(min=1, help="Measured ones, after one to warm up; the median counts.")
    ] = 5,
    batch: Annotated[int, typer.Option(min=2)] = 8,
) -> None:
    """Pictures per second, forward, backward and optimiser, without reading pictures."""
    torch.set_num_threads(threads or os.cpu_count() or 1)
    keep_freed_memory()
    for size in SIZES:
        for width in (0.5, 0.25):
            for bfloat16 in (False, True):
                rate = _rate(Recipe(width=width, size=size, batch=batch), steps, bfloat16=bfloat16)
                precision = "bfloat16" if bfloat16 else "float32"
                typer.echo(
                    f"{size.width}×{size.height}  width {width:<4g}  {precision:8}  {rate:6.1f} pictures/s"
                )


@bench.command()
def mosd(source: Path, out: Path) -> None:
    """Write mOSD (Kinect pictures of table tops) as a data set: void, table, object."""
    writer = DatasetWriter(
        out, class_names=("table", "object"), source={"from": "mOSD, PointCloudLibrary/data"}
    )
    splits: dict[str, Split] = {"learn": "train", "test": "test"}
    for folder, split in splits.items():
        pictures = sorted((source / folder).glob("*.rgb.jpg"))
        if not pictures:
            raise BadConfiguration(f"{source / folder}: no *.rgb.jpg is there")
        for path in pictures:
            name = path.name.removesuffix(".rgb.jpg")
            depth, labels = (path.with_name(f"{name}.{kind}.png") for kind in ("depth", "semantic"))
            writer.add(split, name, read_rgb(path), read_depth(depth), read_grey(labels))
    writer.finish()


def _rate(recipe: Recipe, steps: int, *, bfloat16: bool) -> float:
    network = fresh_network(recipe, CLASSES).to(memory_format=torch.channels_last).train()  # type: ignore[call-overload]
    optimiser = torch.optim.SGD(network.parameters(), lr=1e-3, momentum=0.9, nesterov=True)
    shape = (recipe.batch, recipe.size.height, recipe.size.width)
    picture, weights = torch.randn(shape[0], 4, *shape[1:]), torch.ones(CLASSES)
    labels = torch.randint(0, CLASSES + 1, shape, dtype=torch.uint8)
    batch = Batch(rgb=picture[:, :3], depth=picture[:, 3:], labels=labels)
    seconds = []
    for _ in range(steps + 1):
        started = time.perf_counter()
        optimiser.zero_grad()
        torch.autograd.backward(training_loss(network, batch, weights, bfloat16=bfloat16))
        optimiser.step()
        seconds.append(time.perf_counter() - started)
    return recipe.batch / sorted(seconds[1:])[steps // 2]


if __name__ == "__main__":
    bench()
