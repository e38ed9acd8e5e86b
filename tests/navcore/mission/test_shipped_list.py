"""The shipped beware list asks of each class the confidence that the card of the shipped network
says."""

from __future__ import annotations

import re

from navcore.mission.beware_list import default_beware_list
from navcore.perception.esanet.inference.network_file import SHIPPED
from sim.scenario.schema import PATTERN_CLASSES

ROW = re.compile(r"^\| (?P<name>[^|]+) \| [\d.]+ \| [\d.]+ \| (?P<precision>[\d.]+) \|", re.M)


def test_the_least_confidence_of_a_class_is_half_over_its_precision() -> None:
    card = SHIPPED.with_suffix(".md").read_text(encoding="utf-8")
    precision = {row["name"]: float(row["precision"]) for row in ROW.finditer(card)}
    asked = {entry.name: entry.min_confidence for entry in default_beware_list().enabled}
    assert asked.keys() == precision.keys() - {"background"}
    assert asked == {name: round(0.5 / precision[name], 2) for name in asked}
    assert max(asked, key=lambda name: asked[name]) == "cable"


def test_floor_markings_but_red_are_on_the_list_and_off() -> None:
    off = [entry for entry in default_beware_list().classes if not entry.enabled]
    assert {entry.name for entry in off} == set(PATTERN_CLASSES.values())
    assert all(entry.colour is not None for entry in off)
