"""Beware list that a world starts with: the shipped one, without the classes that the world does
not have, and with those of its markings."""

from __future__ import annotations

import dataclasses

from navcore.errors import BadConfiguration
from navcore.mission.beware_list import PERSON, BewareList, default_beware_list
from sim.scenario.schema import Scenario


def starting_beware_list(scenario: Scenario) -> BewareList:
    """Return the shipped list with the classes of `scenario.beware_off` switched off and those of
    the world's markings switched on."""
    shipped = default_beware_list()
    marked = {marking.beware_class for marking in scenario.markings if marking.beware}
    return dataclasses.replace(
        shipped,
        classes=tuple(
            dataclasses.replace(
                entry,
                enabled=(entry.enabled or entry.name in marked)
                and entry.name not in scenario.beware_off,
            )
            for entry in shipped.classes
        ),
    )


def check_beware_off(scenario: Scenario, where: str) -> None:
    """Raise `BadConfiguration` for a class that the shipped list lacks, or of which the world has
    an object."""
    known = [entry.name for entry in default_beware_list().classes]
    present = {
        *(item.kind for item in scenario.items),
        *(group.kind for group in scenario.scatter),
        *(marking.beware_class for marking in scenario.markings if marking.beware),
        *(PERSON for _ in scenario.people),
    }
    for i, name in enumerate(scenario.beware_off):
        if name not in known:
            raise BadConfiguration(
                f"{where}.beware_off[{i}]: {name!r}, expected one of: {', '.join(known)}"
            )
        if name in present:
            raise BadConfiguration(
                f"{where}.beware_off[{i}]: a {name} is in this world; the robot must beware of it"
            )
