"""The beware list a world starts with: without the classes that it does not have, and with all that
lies in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from navcore.errors import BadConfiguration
from navcore.mission.beware_list import default_beware_list
from sim.scenario.beware import starting_beware_list
from sim.scenario.load import WORLDS, load_scenario, scenario_names
from sim.scenario.schema import PATTERN_CLASSES
from sim.scenario.variation import randomise
from sim.truth.true_objects import true_objects

EMPTY = (WORLDS / "empty_room.toml").read_text(encoding="utf-8")
PATTERNS = set(PATTERN_CLASSES.values())
OFF = {
    "clutter": {"landmine"},
    "empty_room": set(),
    "forest": {"book", "cup", "cable", "keyboard", "wet-floor sign"},
    "indoor": {"landmine"},
    "office": {"landmine"},
    "terrain": {"landmine"},
}


def test_each_shipped_world_starts_without_the_classes_that_it_does_not_have() -> None:
    assert set(OFF) == set(scenario_names())
    for name, off in OFF.items():
        starting = starting_beware_list(load_scenario(name))
        are_off = {entry.name for entry in starting.classes if not entry.enabled}
        assert are_off == off | PATTERNS, name
        assert starting.names == default_beware_list().names


@pytest.mark.parametrize("name", OFF)
def test_nothing_that_lies_in_a_world_is_off(name: str) -> None:
    scenario = load_scenario(name)
    enabled = {entry.name for entry in starting_beware_list(scenario).enabled}
    lying = {entry.name for seed in range(3) for entry in true_objects(randomise(scenario, seed))}
    listed = {entry.name for entry in default_beware_list().classes}
    assert lying & listed <= enabled


@pytest.mark.parametrize(
    ("off", "words"),
    [
        ('["dragon"]', "beware_off[0]: 'dragon', expected one of: red floor"),
        ('["cup", "red floor"]', "beware_off[1]: a red floor is in this world"),
        ("[1]", "beware_off[0]: expected str"),
        ('"cup"', "beware_off: expected a list"),
    ],
)
def test_a_wrong_class_is_refused_by_key(off: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(f"beware_off = {off}\n{EMPTY}", encoding="utf-8")
    with pytest.raises(BadConfiguration) as refusal:
        load_scenario(path)
    assert words in str(refusal.value) and "bad.toml" in str(refusal.value)


def test_a_class_that_the_world_does_not_have_may_be_off(tmp_path: Path) -> None:
    path = tmp_path / "good.toml"
    path.write_text(f'beware_off = ["cup"]\n{EMPTY}', encoding="utf-8")
    assert not starting_beware_list(load_scenario(path)).named("cup").enabled


@pytest.mark.parametrize(("beware", "is_on"), [("true", True), ("false", False)])
def test_a_pattern_to_stay_off_is_switched_on_in_its_world(
    beware: str, is_on: bool, tmp_path: Path
) -> None:
    path = tmp_path / "taped.toml"
    marking = f"""
[[markings]]
name = "aisle"
pattern = "tape"
beware = {beware}
polygon = [[1, 1], [2, 1], [2, 1.2], [1, 1.2]]
"""
    path.write_text(EMPTY + marking, encoding="utf-8")
    starting = starting_beware_list(load_scenario(path))
    off = {entry.name for entry in starting.classes if not entry.enabled}
    assert off == PATTERNS - ({"yellow-black tape"} if is_on else set())


def test_a_pattern_of_a_liquid_is_refused_by_key(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    bad = EMPTY.replace("[[markings]]", '[[markings]]\nsurface = "mud"\npattern = "tape"', 1)
    path.write_text(bad, encoding="utf-8")
    with pytest.raises(BadConfiguration, match=r"markings\[0\].pattern: 'tape' on mud"):
        load_scenario(path)
