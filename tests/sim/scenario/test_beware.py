"""The beware list a world starts with: without the classes that it does not have, and with all that
lies in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from navcore.errors import BadConfiguration
from navcore.mission.beware_list import default_beware_list
from sim.scenario.beware import starting_beware_list
from sim.scenario.load import WORLDS, load_scenario, scenario_names
from sim.scenario.variation import randomise
from sim.truth.true_objects import true_objects

EMPTY = (WORLDS / "empty_room.toml").read_text(encoding="utf-8")
OFF = {
    "clutter": {"landmine"},
    "empty_room": set(),
    "forest": {"book", "cup", "cable", "keyboard", "wet-floor sign"},
    "indoor": {"landmine"},
    "office": {"landmine"},
}


def test_each_shipped_world_starts_without_the_classes_that_it_does_not_have() -> None:
    assert set(OFF) == set(scenario_names())
    for name, off in OFF.items():
        starting = starting_beware_list(load_scenario(name))
        assert {entry.name for entry in starting.classes if not entry.enabled} == off, name
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
