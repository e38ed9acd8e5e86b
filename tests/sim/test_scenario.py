"""World files: the built-in ones are sound, bad ones are refused by key, seeds vary them within bounds."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from navcore.errors import BadConfiguration
from navcore.grid import GridSpec
from sim.referee import Referee
from sim.scenario import WORLDS, Scenario, load_scenario, scenario_names
from sim.variation import vary

ROOM = (WORLDS / "empty_room.toml").read_text(encoding="utf-8")


def test_the_built_in_worlds_load() -> None:
    assert {"office", "empty_room"} <= set(scenario_names())
    for name in scenario_names():
        assert load_scenario(name).name == name


@pytest.mark.parametrize(
    "old, new, key",
    [
        ("name = ", 'colour = "red"\nname = ', "colour"),
        ("size_m = [8.0, 8.0]\n", "", "size_m"),
        ("[8.0, 8.0]", "[8.0, -8.0]", "size_m[1]"),
        ("goals = [[2.8, 2.8]]", "goals = [[2.8]]", "goals[0]"),
        ("goals = [[2.8, 2.8]]", "goals = [[2.8, 9.0]]", "goals[0]"),
        ("goals = [[2.8, 2.8]]", "goals = [[3.7, 2.8]]", "goals[0]"),
        ("goals = [[2.8, 2.8]]", "goals = [[0.0, 0.0]]", "goals[0]"),
        ("start = [-2.5, -2.5, 0.0]", "start = [-3.5, -2.5, 0.0]", "start"),
        ("start = [-2.5, -2.5, 0.0]", "start = [0.5, -2.2, 0.0]", "furniture[0]"),
        ("start = [-2.5, -2.5, 0.0]", "start = [nan, -2.5, 0.0]", "start[0]"),
        ('kind = "box"', 'kind = "dragon"', "furniture[0].kind"),
        ("[0.9, -0.4], [0.9, 1.2]", "[0.9, 1.2], [0.9, -0.4]", "markings[0].polygon"),
        ("[[-0.7, -0.4], [0.9, -0.4], [0.9, 1.2], [-0.7, 1.2]]", "[[-0.7, -0.4], [0.9, -0.4]]", "markings[0].polygon"),
        ("[3.94, -3.94], [3.94, 3.94]", "[3.94, -3.94], [3.94, -3.94]", "walls[0].points[2]"),
        ("[3.94, -3.94], [3.94, 3.94]", "[5.0, -3.94], [3.94, 3.94]", "walls[0].points[1]"),
    ],
)
def test_a_bad_world_is_refused_by_key(old: str, new: str, key: str, tmp_path: Path) -> None:
    assert old in ROOM
    path = tmp_path / "bad.toml"
    path.write_text(ROOM.replace(old, new), encoding="utf-8")
    with pytest.raises(BadConfiguration) as refusal:
        load_scenario(path)
    assert key in str(refusal.value) and "bad.toml" in str(refusal.value)


def test_the_unchanged_file_is_the_control(tmp_path: Path) -> None:
    path = tmp_path / "good.toml"
    path.write_text(ROOM, encoding="utf-8")
    assert load_scenario(str(path)) == load_scenario("empty_room")


@pytest.mark.parametrize("name", ["nowhere", "../worlds/office", "", "missing.toml"])
def test_an_unknown_world_is_refused(name: str) -> None:
    with pytest.raises(BadConfiguration, match=r"office|no such file"):
        load_scenario(name)


def office_way_m(scenario: Scenario) -> float | None:
    spec = GridSpec.centred(size_m=scenario.map.size_m, resolution_m=scenario.map.resolution_m)
    return Referee(scenario).shortest_m(spec, 0.45, scenario.goals)


def test_the_office_mission_is_drivable_with_every_seed() -> None:
    office = load_scenario("office")
    assert all(45 < (office_way_m(vary(office, seed)) or 0.0) < 60 for seed in range(10))


def test_the_red_floor_lies_on_the_shortest_way_and_can_be_driven_round() -> None:
    office = load_scenario("office")
    unpainted = office_way_m(dataclasses.replace(office, markings=()))
    painted = office_way_m(office)
    assert unpainted is not None and painted is not None
    assert unpainted + 0.3 < painted < unpainted + 3.0


def test_seeds_move_loose_things_a_little_and_walls_never() -> None:
    office = load_scenario("office")
    found = [vary(office, seed) for seed in range(10)]
    assert len({run.furniture for run in found}) == len({run.items for run in found}) == 10
    assert vary(office, 7) == found[7]
    for run in found:
        assert run.walls == office.walls
        for piece, planned in zip(run.furniture, office.furniture, strict=True):
            assert max(abs(a - b) for a, b in zip(piece.at, planned.at, strict=True)) <= 0.06 + 1e-9
