"""Differences between two beware lists, in words for the operator."""

from __future__ import annotations

import dataclasses

from navcore.mission.beware_list import BewareClass, BewareList, ColourRule
from navcore.mission.prototype import Prototype

FIELDS = {
    "margin_m": ("margin", 1.0, "m"),
    "min_confidence": ("confidence", 100.0, "%"),
    "min_height_m": ("smallest height", 1.0, "m"),
    "max_height_m": ("largest height", 1.0, "m"),
    "min_size_m": ("smallest size", 1.0, "m"),
    "max_size_m": ("largest size", 1.0, "m"),
}
"""Key of a number → its name, factor and unit."""


def changes_between(before: BewareList, after: BewareList) -> tuple[str, ...]:
    """Return a phrase for everything that differs; empty for lists that say the same."""
    old = {entry.class_id: entry for entry in before.classes}
    new = {entry.class_id: entry for entry in after.classes}
    told = [f"“{entry.title}” added" for number, entry in new.items() if number not in old]
    told += [f"“{entry.title}” removed" for number, entry in old.items() if number not in new]
    for number, entry in new.items():
        if number in old:
            told += _changes_of(old[number], entry)
    both = [number for number in old if number in new]
    if both != [number for number in new if number in old]:
        told.append("order changed")
    return tuple(told)


def _changes_of(old: BewareClass, new: BewareClass) -> list[str]:
    name, told = f"“{old.title}”", []
    if old.name != new.name:
        told.append(f"“{old.name}” renamed to “{new.name}”")
    if old.enabled != new.enabled:
        told.append(f"{name} switched {'on' if new.enabled else 'off'}")
    for key, (title, factor, unit) in FIELDS.items():
        values = getattr(old, key), getattr(new, key)
        if values[0] != values[1]:
            told.append(f"{name}: {title} {_number(values[0], factor, unit)} → "
                        f"{_number(values[1], factor, unit)}")  # fmt: skip
    if old.label != new.label:
        told.append(f"{name}: shown as “{new.title}”")
    if old.detected_as != new.detected_as:
        told.append(f"{name}: network class “{new.detected_as}”")
    if old.prototype != new.prototype:
        told.append(f"{name}: {_prototype_change(old.prototype, new.prototype)}")
    if old.colour != new.colour:
        told.append(f"{name}: {_rule_change(old.colour, new.colour)}")
    return told


def _prototype_change(old: Prototype | None, new: Prototype | None) -> str:
    if old is None or new is None:
        return "example added" if old is None else "example removed"
    return "example changed"


def _rule_change(old: ColourRule | None, new: ColourRule | None) -> str:
    if old is None or new is None:
        return "colour rule added" if old is None else "colour rule removed"
    names = [
        field.name.replace("_", " ").removesuffix(" deg").removesuffix(" m")
        for field in dataclasses.fields(ColourRule)
        if getattr(old, field.name) != getattr(new, field.name)
    ]
    return f"colour rule changed ({', '.join(names)})"


def _number(value: float | None, factor: float, unit: str) -> str:
    return "any" if value is None else f"{factor * value:.4g} {unit}"
