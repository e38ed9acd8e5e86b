"""Initial weights of a run: random, or transferred from another network to other classes."""

from __future__ import annotations

import copy
import dataclasses

import torch

from navcore.errors import BadConfiguration
from navcore.learning.data.dataset import Dataset
from navcore.learning.training.recipe import Recipe
from navcore.perception.esanet import EsaNet, build
from navcore.perception.esanet.network.variants import variant_named
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard


def new_network(recipe: Recipe, num_classes: int) -> EsaNet:
    """Return a network with random weights, the same for the same seed."""
    with torch.random.fork_rng():
        torch.manual_seed(recipe.seed)
        if recipe.he_init:
            return build(recipe.variant, num_classes, width=recipe.width)
        return EsaNet(variant_named(recipe.variant), num_classes, width=recipe.width)


def transferred_network(start: TrainedNetwork, recipe: Recipe, card: WeightsCard) -> EsaNet:
    """Return a network of its own for the classes of `card` with the weights of `start`, random for
    new classes.

    Raises `BadConfiguration` if the two differ in more than their classes.
    """
    known, wanted = start.card, card
    if (known.variant, known.width) != (wanted.variant, wanted.width):
        has, asked = (f"{of.variant} × {of.width:g}" for of in (known, wanted))
        raise BadConfiguration(
            f"training: cannot start from a network {has}; the recipe asks for {asked}"
        )
    if known.class_names == wanted.class_names:
        return copy.deepcopy(start.network)
    network = new_network(recipe, wanted.num_classes)
    rows = _common_classes(known, wanted)
    by_class = wanted.architecture.class_tensors()
    learned, tensors = start.network.state_dict(), network.state_dict()
    for key, tensor in tensors.items():
        if key not in by_class:
            tensor.copy_(learned[key])
            continue
        for row, old_row in rows:
            tensor[row].copy_(learned[key][old_row])
    return network


def with_depth_of(start: TrainedNetwork, dataset: Dataset) -> Dataset:
    """Return the data set with the depth statistics of `start`, in its own unit."""
    depth = start.card.depth.in_unit(dataset.card.depth.units_per_m)
    return dataclasses.replace(dataset, card=dataclasses.replace(dataset.card, depth=depth))


def _common_classes(known: WeightsCard, wanted: WeightsCard) -> list[tuple[int, int]]:
    """Return for each common class its index in the wanted and in the known network, by name,
    ignoring case."""
    numbers = {name.casefold(): number for number, name in enumerate(known.class_names)}
    return [
        (number, numbers[name.casefold()])
        for number, name in enumerate(wanted.class_names)
        if name.casefold() in numbers
    ]
