"""What the README shows is true: its examples load, its commands exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from navcore.beware import default_beware_list, load_beware_list
from sim.scenario import load_scenario

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def examples(tmp_path: Path) -> list[Path]:
    """Every TOML block of the README, as a file."""
    blocks = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    for number, block in enumerate(blocks):
        (tmp_path / f"example{number}.toml").write_text(block, encoding="utf-8")
    return sorted(tmp_path.glob("example*.toml"))


def test_the_world_of_the_readme_is_a_world(examples: list[Path]) -> None:
    world = load_scenario(str(examples[0]))
    assert world.name == "my_room"
    assert len(world.people) == len(world.items) == len(world.markings) == len(world.furniture) == 1


def test_the_beware_list_of_the_readme_is_one_and_says_what_the_default_says(examples: list[Path]) -> None:
    shown = load_beware_list(examples[1])
    assert shown.classes == (default_beware_list().named("red floor"),)


def test_every_make_target_and_file_that_the_readme_names_exists() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"`?make (\w+)`?", README):
        assert f"\n{target}:" in makefile, target
    for path in re.findall(r"`((?:app|navcore|sim|web|tests|docs)/[\w/.*]+)`", README):
        assert list(ROOT.glob(path.rstrip("/"))), path
    for picture in re.findall(r"!\[.*?\]\((.*?)\)", README):
        assert (ROOT / picture).exists(), picture
