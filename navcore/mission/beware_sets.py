"""Ready-made beware lists by name: the shipped list with the classes of a kind of site on."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path

from navcore.errors import BadConfiguration
from navcore.files import is_there
from navcore.mission.beware_list import BewareList, default_beware_list, load_beware_list


def ready_made() -> dict[str, BewareList]:
    """Return the lists of `navcore/mission/beware_sets.toml` by name."""
    shipped = default_beware_list()
    text = Path(__file__).with_name("beware_sets.toml").read_text(encoding="utf-8")
    return {name: _with_only(shipped, on) for name, on in tomllib.loads(text).items()}


def beware_list_of(name_or_file: Path) -> BewareList:
    """Return the ready-made list of a name, else that of a TOML file; raises `BadConfiguration` for
    what is neither and for a list without classes, and as `load_beware_list`."""
    lists, name = ready_made(), str(name_or_file)
    if name in lists:
        return lists[name]
    if not is_there(name_or_file):
        known = ", ".join(lists)
        raise BadConfiguration(f"{name}: no such file, and no ready-made beware list: {known}")
    beware = load_beware_list(name_or_file)
    if not beware.classes:
        raise BadConfiguration(f"{name}: the list is empty, the robot would beware of nothing")
    return beware


def _with_only(shipped: BewareList, on: list[str]) -> BewareList:
    names = {shipped.named(name).name for name in on}
    classes = (dataclasses.replace(one, enabled=one.name in names) for one in shipped.classes)
    return BewareList(classes=tuple(classes))
