"""What the pages show is true: their examples load, and what they name exists."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from navcore.config.navigator import load_config
from navcore.learning.training.recipe import load_recipe
from navcore.mission.beware_list import default_beware_list, load_beware_list
from navcore.perception.esanet.inference.network_file import SHIPPED
from navcore.perception.esanet.weights.weights_file import load
from sim.scenario.load import load_scenario

ROOT = Path(__file__).parents[2]
MOST_BYTES = 6144
"""Largest size of the first page."""
ROOMS = ("app", "navcore", "sim", "tests", "web")
TARGET = re.compile(r"\bmake ([a-z][a-z-]*)\b")
CODE = re.compile(r"```.*?```|`[^`\n]+`", re.DOTALL)
PATH = re.compile(rf"`((?:{'|'.join(ROOMS)})/[\w/.*{{}},-]+)`")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.+)$", re.MULTILINE)


def pages() -> list[Path]:
    """Every Markdown page that git knows or would add; without git, those of the rooms."""
    if shutil.which("git") and (ROOT / ".git").exists():
        listed = subprocess.run(
            ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
            cwd=ROOT,
            check=True,
            capture_output=True,
            text=True,
        ).stdout.splitlines()
        found = {ROOT / name for name in listed}
    else:
        found = {
            *ROOT.glob("*.md"),
            *(page for room in ROOMS for page in ROOT.glob(f"{room}/**/*.md")),
        }
    return sorted(page for page in found if page.exists())


PAGES = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in pages()}
every_page = pytest.mark.parametrize("page", PAGES)


def toml_blocks(page: str) -> list[str]:
    """The TOML examples of a page."""
    return re.findall(r"```toml\n(.*?)```", PAGES[page], re.DOTALL)


def anchors(page: str) -> set[str]:
    """The anchors that GitHub gives to the headings of a page."""
    headings = HEADING.findall(re.sub(r"```.*?```", "", PAGES[page], flags=re.DOTALL))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.fixture
def example(tmp_path: Path) -> Callable[[str, str], Path]:
    """The one TOML block of a page that holds some words, as a file."""

    def as_file(page: str, words: str) -> Path:
        (block,) = [block for block in toml_blocks(page) if words in block]
        path = tmp_path / "example.toml"
        path.write_text(block, encoding="utf-8")
        return path

    return as_file


def test_the_first_page_is_short() -> None:
    assert len(PAGES["README.md"].encode()) <= MOST_BYTES


def test_the_first_page_leads_to_every_other() -> None:
    reached, waiting = {"README.md"}, ["README.md"]
    while waiting:
        page = waiting.pop()
        for target in LINK.findall(PAGES[page]):
            path = (ROOT / page).parent / target.partition("#")[0]
            name = str(path.resolve().relative_to(ROOT)) if path.exists() else ""
            if name in PAGES and name not in reached:
                reached.add(name)
                waiting.append(name)
    assert set(PAGES) == reached


@every_page
def test_every_example_is_toml(page: str) -> None:
    for block in toml_blocks(page):
        tomllib.loads(block)


@every_page
def test_every_link_and_image_of_a_page_leads_somewhere(page: str) -> None:
    for target in LINK.findall(CODE.sub("", PAGES[page])):
        if target.startswith(("http://", "https://")):
            continue
        name, _, anchor = target.partition("#")
        path = ((ROOT / page).parent / name if name else ROOT / page).resolve()
        assert path.exists(), target
        if anchor:
            assert anchor in anchors(str(path.relative_to(ROOT))), target


@every_page
def test_every_make_target_and_file_that_a_page_names_exists(page: str) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for code in CODE.findall(PAGES[page]):
        for target in TARGET.findall(code):
            assert f"\n{target}:" in makefile, target
    for path in PATH.findall(PAGES[page]):
        assert list(ROOT.glob(path.rstrip("/"))), path


def test_the_world_of_the_page_is_a_world(example: Callable[[str, str], Path]) -> None:
    world = load_scenario(str(example("sim/README.md", "[[furniture]]")))
    assert world.name == "my_room"
    assert (
        len(world.people)
        == len(world.items)
        == len(world.furniture)
        == len(world.prints)
        == len(world.faults)
        == len(world.movers)
        == 1
    )
    assert len(world.markings) == 3


def test_the_generated_world_of_the_page_is_a_world(example: Callable[[str, str], Path]) -> None:
    world = load_scenario(str(example("sim/README.md", "[[scatter]]")))
    assert world.relief is not None
    assert len(world.rooms) == len(world.scatter) == 1


def test_the_beware_list_of_the_page_is_one_and_says_what_the_default_says(
    example: Callable[[str, str], Path],
) -> None:
    for name in ("red floor", "yellow-black tape", "white line"):
        shown = load_beware_list(example("navcore/formats/README.md", f'name = "{name}"'))
        assert shown.classes == (default_beware_list().named(name),)


def test_the_recipe_of_the_page_is_one(example: Callable[[str, str], Path]) -> None:
    recipe = load_recipe(example("navcore/learning/README.md", "variant ="))
    assert recipe.size == load(SHIPPED).card.size


def test_the_navigation_settings_of_the_page_are_some(
    example: Callable[[str, str], Path],
) -> None:
    config = load_config(example("navcore/config/README.md", "safety_margin_m ="))
    assert config.people.non_cooperative
