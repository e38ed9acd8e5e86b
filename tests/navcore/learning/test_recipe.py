"""Recipes: the schedule is torch's, unknown keys are refused, and a recipe says which run it is."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest
import torch

from navcore.errors import BadConfiguration
from navcore.learning.data.card import DatasetCard
from navcore.learning.training.recipe import (
    Augmentation,
    Recipe,
    learning_rate,
    load_recipe,
    momentum,
)
from navcore.perception.esanet.network.preprocess import DepthStatistics

CARD = DatasetCard(class_names=("a",), depth=DepthStatistics(mean=1.0, std=1.0, units_per_m=1.0))

EARLIER = "e60350b8873753ec5b0156130acd5ffc4a30a4ee03f1678fc42b09e8896c4a96"


@pytest.mark.parametrize("epochs", [11, 20, 60, 500])
def test_the_schedule_is_the_official_one(epochs: int) -> None:
    recipe = Recipe(batch=5)
    optimiser = torch.optim.SGD(
        [torch.nn.Parameter(torch.zeros(1))], lr=1.0, momentum=0.9, nesterov=True
    )
    largest = 0.01 * 5 / 8
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # torch wants optimiser.step() first, and there is none here
        official = torch.optim.lr_scheduler.OneCycleLR(
            optimiser,
            max_lr=largest,
            total_steps=epochs,
            pct_start=0.1,
            anneal_strategy="cos",
            div_factor=25,
            final_div_factor=1e4,
        )
        for step in range(epochs):
            group = optimiser.param_groups[0]
            assert learning_rate(recipe, step, epochs) == pytest.approx(group["lr"], rel=1e-9)
            assert momentum(recipe, step, epochs) == pytest.approx(group["momentum"], rel=1e-12)
            official.step()


@pytest.mark.parametrize("steps", [1, 2, 5, 10])
def test_short_runs_have_a_schedule_too(steps: int) -> None:
    rates = [learning_rate(Recipe(), step, steps) for step in range(steps)]
    assert rates == sorted(rates, reverse=True)
    assert rates[0] == pytest.approx(0.01)
    assert momentum(Recipe(cycle_momentum=False), 0, steps) == 0.9


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("epoch = 3", "unknown key 'epoch'"),
        ("epochs = 0", "epochs"),
        ("batch = 1", "batch"),
        ('variant = "r19"', "r19"),
        ("width = 0.3", "width"),
        ("size = { height = 250, width = 320 }", "multiple of 32"),
        ('precision = "float16"', "precision"),
        ("augmentation = { scale = [1.4, 1.0] }", "smaller one first"),
        ("augmentation = { scale = [0.5, 1.0] }", "scale"),
        ("learning_rate = nan", "learning_rate"),
    ],
)
def test_a_recipe_that_cannot_be_is_refused_by_name(text: str, named: str, tmp_path: Path) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(text)
    with pytest.raises(BadConfiguration, match=named):
        load_recipe(path)


def test_a_recipe_is_read_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(
        'variant = "r34"\nsize = { height = 256, width = 320 }\naugmentation = { flip = 0 }\n'
    )
    recipe = load_recipe(path)
    assert (
        recipe.variant,
        recipe.size.width,
        recipe.augmentation.flip,
        recipe.augmentation.scale,
    ) == (
        "r34",
        320,
        0,
        (1.0, 1.4),
    )


def test_the_identity_tells_runs_apart() -> None:
    runs = [Recipe(), Recipe(seed=1), Recipe(epochs=3), Recipe(width=0.25)]
    assert len({recipe.identity(CARD) for recipe in runs}) == len(runs)
    assert Recipe(seed=0).identity(CARD) == Recipe().identity(CARD)
    other = DatasetCard(class_names=("b",), depth=CARD.depth)
    assert Recipe().identity(other) != Recipe().identity(CARD)


def test_another_source_of_images_or_other_initial_weights_make_another_run() -> None:
    recipe = Recipe()
    runs = {
        recipe.identity(CARD),
        recipe.identity(CARD, start="a"),
        recipe.identity(CARD, source="a"),
        recipe.identity(CARD, source="b"),
    }
    assert len(runs) == 4


def test_changes_of_light_make_another_run_and_their_absence_none() -> None:
    own = Recipe(augmentation=Augmentation(focus=0.5))
    lit = Recipe(augmentation=Augmentation(focus=0.5, blur=(0.0, 0.03)))
    assert lit.identity(CARD) != own.identity(CARD)
    # What a version without changes of light said.
    assert own.identity(CARD) == EARLIER
