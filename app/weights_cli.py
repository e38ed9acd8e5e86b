"""`bewarenav weights`: convert an official ESANet checkpoint once, and say what a weights file holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from navcore.esanet.weights import WeightsCard  # at run time it would make every command wait for torch

weights_cli = typer.Typer(help="Trained ESANet networks: convert an official checkpoint, say what a file holds.")


@weights_cli.command()
def convert(
    source: Annotated[Path, typer.Argument(help="Official checkpoint (.pth) with 37 or 40 classes.")],
    target: Annotated[Path, typer.Argument(help="The .safetensors file to write.")],
) -> None:
    """Read a checkpoint without executing anything in it and write it as safetensors with its hash."""
    from navcore.esanet import weights

    _say(weights.convert(source, target))


@weights_cli.command()
def halve(
    source: Annotated[Path, typer.Argument(help="A .safetensors file.")],
    target: Annotated[Path, typer.Argument(help="The .safetensors file to write.")],
) -> None:
    """Write a network with its kernels in half precision: half the size, for files to ship."""
    from navcore.esanet import weights

    trained = weights.load(source)
    weights.save(trained.network, trained.card, target, half=True)
    _say(trained.card)


@weights_cli.command()
def info(path: Annotated[Path, typer.Argument(help="A converted or shipped .safetensors file.")]) -> None:
    """Check that a file is whole and say what network it holds."""
    from navcore.esanet import weights

    _say(weights.load(path).card)


def _say(card: WeightsCard) -> None:
    typer.echo(f"{card.variant}, width {card.width:g}, {card.num_classes} classes: {', '.join(card.class_names)}")
    typer.echo(f"depth: {card.depth}")
    typer.echo(f"made from sha256 {card.source_sha256}")
