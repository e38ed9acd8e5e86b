"""Ready-made beware lists: chosen by name, with the thresholds of the shipped list."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from navcore.errors import BadConfiguration
from navcore.mission.beware_list import PERSON, as_toml, default_beware_list
from navcore.mission.beware_sets import beware_list_of, ready_made
from sim.scenario.beware import starting_beware_list
from sim.scenario.load import load_scenario


def test_each_list_is_the_shipped_one_but_for_what_is_on() -> None:
    lists = ready_made()
    assert set(lists) == {"office", "indoor", "outdoor"}
    shipped = default_beware_list()
    for beware in lists.values():
        assert PERSON in {entry.name for entry in beware.enabled}
        assert [dataclasses.replace(one, enabled=True) for one in beware.classes] == [
            dataclasses.replace(one, enabled=True) for one in shipped.classes
        ]
    on = [{entry.name for entry in lists[name].enabled} for name in ("office", "outdoor")]
    assert on[0] - on[1] and on[1] - on[0]


def test_the_list_of_an_office_is_that_of_the_shipped_office() -> None:
    office = starting_beware_list(load_scenario("office"))
    assert beware_list_of(Path("office")).enabled == office.enabled


def test_what_is_no_name_is_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(as_toml(ready_made()["outdoor"]), encoding="utf-8")
    assert beware_list_of(path).classes == ready_made()["outdoor"].classes
    with pytest.raises(
        BadConfiguration, match="forest: no such file, and no ready-made beware list: office"
    ):
        beware_list_of(Path("forest"))


def test_a_file_without_classes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "empty.toml"
    path.touch()
    with pytest.raises(BadConfiguration, match=r"empty.toml: the list is empty"):
        beware_list_of(path)
