"""What the README shows is true: its examples load, its commands exist."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from navcore.learning.training.recipe import load_recipe
from navcore.mission.beware_list import default_beware_list, load_beware_list
from navcore.perception.esanet.inference.network_file import SHIPPED
from navcore.perception.esanet.weights.weights_file import load
from sim.scenario.load import load_scenario

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def example(tmp_path: Path) -> Callable[[str], Path]:
    """The one TOML block of the README that holds some words, as a file."""

    def as_file(words: str) -> Path:
        (block,) = [
            block for block in re.findall(r"```toml\n(.*?)```", README, re.DOTALL) if words in block
        ]
        path = tmp_path / "example.toml"
        path.write_text(block, encoding="utf-8")
        return path

    return as_file


def test_the_world_of_the_readme_is_a_world(example: Callable[[str], Path]) -> None:
    world = load_scenario(str(example("[[furniture]]")))
    assert world.name == "my_room"
    assert (
        len(world.people)
        == len(world.items)
        == len(world.furniture)
        == len(world.prints)
        == len(world.faults)
        == 1
    )
    assert len(world.markings) == 2


def test_the_beware_list_of_the_readme_is_one_and_says_what_the_default_says(
    example: Callable[[str], Path],
) -> None:
    shown = load_beware_list(example("[[beware]]"))
    assert shown.classes == (default_beware_list().named("red floor"),)


def test_the_recipe_of_the_readme_is_one(example: Callable[[str], Path]) -> None:
    assert load_recipe(example("variant =")).size == load(SHIPPED).card.size


def test_every_make_target_and_file_that_the_readme_names_exists() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"`?make (\w+)`?", README):
        assert f"\n{target}:" in makefile, target
    for path in re.findall(r"`((?:app|navcore|sim|web|tests|docs)/[\w/.*]+)`", README):
        assert list(ROOT.glob(path.rstrip("/"))), path
    for picture in re.findall(r"!\[.*?\]\((.*?)\)", README):
        assert (ROOT / picture).exists(), picture
