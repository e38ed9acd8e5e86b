"""The network a run begins with: fresh, or what another has learned, carried over to other classes
where they differ."""

from __future__ import annotations

import dataclasses

import torch

from navcore.errors import BadConfiguration
from navcore.learning.training.recipe import Recipe
from navcore.perception.esanet import EsaNet, build
from navcore.perception.esanet.network.variants import variant_named
from navcore.perception.esanet.weights.architecture import Architecture
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard


def fresh_network(recipe: Recipe, num_classes: int) -> EsaNet:
    """The network before it has learned anything; the same for the same seed."""
    with torch.random.fork_rng():
        torch.manual_seed(recipe.seed)
        if recipe.he_init:
            return build(recipe.variant, num_classes, width=recipe.width)
        return EsaNet(variant_named(recipe.variant), num_classes, width=recipe.width)


def taught_network(start: TrainedNetwork, recipe: Recipe, card: WeightsCard) -> EsaNet:
    """A network for the classes of `card` that knows what `start` knows, and begins afresh with the
    classes it does not.

    Raises `BadConfiguration` when the two differ in more than their classes.
    """
    known, wanted = start.card, card
    if (known.variant, known.width) != (wanted.variant, wanted.width):
        told, asked = (f"{of.variant} × {of.width:g}" for of in (known, wanted))
        raise BadConfiguration(
            f"training: cannot start from a network {told}; the recipe asks for {asked}"
        )
    if known.class_names == wanted.class_names:
        return start.network
    network = fresh_network(recipe, wanted.num_classes)
    rows = _both(known, wanted)
    by_class = _per_class(wanted.architecture)
    learned, tensors = start.network.state_dict(), network.state_dict()
    for key, tensor in tensors.items():
        if key not in by_class:
            tensor.copy_(learned[key])
            continue
        for row, old_row in rows:
            tensor[row].copy_(learned[key][old_row])
    return network


def _both(known: WeightsCard, wanted: WeightsCard) -> list[tuple[int, int]]:
    """Of each class that both have, its number in what is wanted and in what is known; by name, in
    whatever case."""
    numbers = {name.casefold(): number for number, name in enumerate(known.class_names)}
    return [
        (number, numbers[name.casefold()])
        for number, name in enumerate(wanted.class_names)
        if name.casefold() in numbers
    ]


def _per_class(architecture: Architecture) -> set[str]:
    """The tensors with a row for each class: those whose shape another number of classes would
    change."""
    other = (
        dataclasses.replace(architecture, num_classes=architecture.num_classes + 1)
        .skeleton()
        .state_dict()
    )
    return {
        key
        for key, tensor in architecture.skeleton().state_dict().items()
        if tensor.shape != other[key].shape
    }
