"""`bewarenav weights`: convert, calibrate, quantise and describe files of network weights."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:  # at run time these would make every command wait for torch
    from navcore.learning.training.batches import CachedSplit
    from navcore.learning.training.evaluation import InferenceSettings
    from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard

weights_cli = typer.Typer(
    help="Trained ESANet networks: convert an official checkpoint, describe a file."
)


@weights_cli.command()
def convert(
    source: Annotated[
        Path, typer.Argument(help="Official checkpoint (.pth) with 37 or 40 classes.")
    ],
    target: Annotated[Path, typer.Argument(help="The .safetensors file to write.")],
) -> None:
    """Convert a checkpoint to safetensors with its hash, without executing anything in it."""
    from navcore.perception.esanet.weights import weights_file as weights

    _say(weights.convert(source, target))


@weights_cli.command()
def halve(
    source: Annotated[Path, typer.Argument(help="A .safetensors file.")],
    target: Annotated[Path, typer.Argument(help="The .safetensors file to write.")],
) -> None:
    """Write a network with its kernels in half precision: half the file size."""
    from navcore.perception.esanet.weights import weights_file as weights

    trained = weights.load(source)
    weights.save(trained.network, trained.card, target, half=True)
    _say(trained.card)


@weights_cli.command()
def calibrate(
    source: Annotated[Path, typer.Argument(help="A trained .safetensors file.")],
    target: Annotated[Path, typer.Argument(help="The .safetensors file to write.")],
    data: Annotated[
        Path,
        typer.Option(metavar="DIR", help="A data set with a split that was not used for training."),
    ],
    split: Annotated[str, typer.Option(help="The split to calibrate on.")] = "valid",
) -> None:
    """Shift the logits of the classes to maximise the mean IoU of a split, and scale them so that
    confidence equals accuracy."""
    from navcore.learning.training.calibration import calibrate as shift
    from navcore.perception.esanet.weights import weights_file as weights

    trained, images, inference = _opened(source, target, data, split)
    made = shift(trained.network, images, inference)
    weights.save(trained.network, trained.card, target)
    for name, offset, shown in zip(trained.card.class_names, made.offsets, made.shown, strict=True):
        typer.echo(f"{name}: {offset:+.3f}" + ("" if shown else f", no image of {split} shows it"))
    typer.echo(f"temperature: {made.temperature:.3f}")


@weights_cli.command()
def quantise(
    source: Annotated[Path, typer.Argument(help="A trained .safetensors file.")],
    target: Annotated[Path, typer.Argument(help="The .safetensors file to write.")],
    data: Annotated[
        Path,
        typer.Option(metavar="DIR", help="A data set with a split that was not used for training."),
    ],
    split: Annotated[str, typer.Option(help="The split to measure on.")] = "valid",
    most_lost: Annotated[
        float,
        typer.Option(help="Largest loss of mean IoU at which the file is written.", min=0, max=1),
    ] = 0.01,
) -> None:
    """Measure the value ranges for eight-bit arithmetic and what it costs; engines may then run the
    network in eight bits."""
    from navcore.errors import BadConfiguration
    from navcore.learning.training.quantisation import quantise as measure
    from navcore.perception.esanet.weights import weights_file as weights

    trained, images, inference = _opened(source, target, data, split)
    found = measure(trained.network, images, inference)
    typer.echo(
        f"mean IoU in eight bits: {found.mean_iou_in_bytes:.4f}, without: {found.mean_iou:.4f}"
    )
    if math.isnan(found.mean_iou):
        raise BadConfiguration(
            f"{data}: the images of {split} have no labels, so nothing can be measured"
        )
    if found.mean_iou - found.mean_iou_in_bytes > most_lost:
        raise BadConfiguration(f"eight bits cost more than {most_lost:g}: {target} was not written")
    kept = len(found.ranges) - found.ranges.count(0.0)
    typer.echo(f"{kept} of {len(found.ranges)} convolutions in eight bits")
    weights.save(trained.network, dataclasses.replace(trained.card, ranges=found.ranges), target)


@weights_cli.command()
def info(
    path: Annotated[Path, typer.Argument(help="A converted or trained .safetensors file.")],
) -> None:
    """Check that a file is intact and describe its network."""
    from navcore.perception.esanet.weights import weights_file as weights

    _say(weights.load(path).card)


def _opened(
    source: Path, target: Path, data: Path, split: str
) -> tuple[TrainedNetwork, CachedSplit, InferenceSettings]:
    """Open a network and the images of a split, with how the network is run on them.

    Raises `BadConfiguration` where they do not fit.
    """
    from navcore.errors import BadConfiguration
    from navcore.learning.data.card import SPLITS
    from navcore.learning.data.dataset import dataset_for
    from navcore.learning.training.batches import CachedSplit
    from navcore.learning.training.evaluation import InferenceSettings
    from navcore.perception.esanet.weights import weights_file as weights

    weights.check_name(target)  # before minutes of work, not after
    trained = weights.load(source)
    if trained.card.size is None:
        raise BadConfiguration(f"{source} does not say at what size it was trained")
    chosen = next((known for known in SPLITS if known == split), None)
    if chosen is None:
        raise BadConfiguration(f"--split {split!r}: expected train, valid or test")
    dataset = dataset_for(data, class_names=trained.card.class_names, depth=trained.card.depth)
    if not dataset.count(chosen):
        raise BadConfiguration(f"--split {split}: the data set has no such images")
    return (
        trained,
        CachedSplit(dataset, chosen, cache_mb=0),
        InferenceSettings(size=trained.card.size),
    )


def _say(card: WeightsCard) -> None:
    typer.echo(
        f"{card.variant}, width {card.width:g}, {card.num_classes} classes: "
        f"{', '.join(card.class_names)}"
    )
    typer.echo(f"depth: {card.depth}")
    typer.echo(f"made from sha256 {card.source_sha256}")
    typer.echo(
        "runs in eight bits where an engine can" if card.ranges is not None else "not quantised"
    )
