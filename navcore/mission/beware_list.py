"""The beware list: the objects that must not be touched, and the confidence that each one needs.

One immutable, versioned value. The segmenter labels pixels with the class ids of all entries,
enabled or not, and the map keeps every class ever detected. So an edit of the list acts at once on
everything seen before.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from navcore.errors import BadConfiguration
from navcore.toml_config import from_table, ranged, read_toml

NOTHING = 0
"""Class id of a pixel without an entry of the list; on the map, of a geometric obstacle."""
PERSON = "person"
"""Name of the entry for people."""
LARGEST_CLASS_ID = 62
"""Largest class id; the map has a bit for each id in a word."""
MAX_MARGIN_M = 2.0
"""Largest margin of an entry in metres."""
OPTIONAL = ("colour", "min_height_m", "max_height_m", "min_size_m", "label")
"""Fields of an entry that an edit may remove, with None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourRule:
    """Range of colours in HSV; the hue range may wrap around red, for example 345 to 15."""

    hue_deg: tuple[float, float] = ranged(0.0, 360.0)
    """First and last hue in degrees, in rising order."""
    min_saturation: float = ranged(0.0, 1.0, default=0.5)
    """Smallest saturation, 0 (grey) to 1."""
    min_value: float = ranged(0.0, 1.0, default=0.2)
    """Smallest brightness, 0 (black) to 1."""
    max_height_m: float = ranged(0.0, 3.0, default=0.05)
    """Largest height in metres above the floor: a marking is flat, and a red chair is no red
    zone."""
    fallback: bool = False
    """Whether the rule applies only without a network for the class: a rule may take a blue chair
    leg for a cup, where a network does not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareClass:
    """Class of objects to beware of."""

    name: str
    """English name, unique in the list, for example `red floor`."""
    class_id: int = ranged(1, LARGEST_CLASS_ID)
    """Id that the map stores; permanently bound to the name."""
    enabled: bool = True
    """Whether points of the class are obstacles now."""
    margin_m: float = ranged(0.0, MAX_MARGIN_M, default=0.0)
    """Clearance in metres beyond the robot's own margin."""
    min_confidence: float = ranged(0.0, 1.0, default=0.5)
    """Confidence, 0 to 1, below which points are no obstacles."""
    colour: ColourRule | None = None
    """Rule that detects the class by colour; None if only a network can."""
    min_height_m: float | None = ranged(0.01, 2.0, default=None)
    """Smallest height in metres of an object of this class above the floor; flat regions are images
    of one. None for a class that may be flat."""
    max_height_m: float | None = ranged(0.01, 2.0, default=None)
    """Largest height in metres of an object of this class; a detection right below something higher
    is a part of that, such as the foot of a chair, which is an obstacle itself. None for any
    height."""
    min_size_m: float | None = ranged(0.01, 2.0, default=None)
    """Smallest length in metres of a visible region of this class; smaller regions of a network or
    a colour rule are grains of the floor or image noise. None for any size."""
    label: str | None = None
    """Name in the console, in the operator's language; None for the English name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareList:
    """Classes of objects to beware of, in the operator's order."""

    classes: tuple[BewareClass, ...]
    """Entries, unique by name and by class id."""
    version: int = 0
    """Version of the list; grows by one with every edit."""
    retired: tuple[tuple[str, int], ...] = ()
    """Name and class id of removed entries: the map may still hold points of them."""

    def __post_init__(self) -> None:
        for what in ("name", "class_id"):
            values = [getattr(entry, what) for entry in self.classes]
            twice = {value for value in values if values.count(value) > 1}
            if twice:
                raise BadConfiguration(f"beware list: {what} {twice.pop()!r} occurs more than once")

    def named(self, name: str) -> BewareClass:
        """Return the entry with a name; raises `BadConfiguration` if there is none."""
        for entry in self.classes:
            if entry.name == name:
                return entry
        known = ", ".join(entry.name for entry in self.classes)
        raise BadConfiguration(f"beware list: no class {name!r}; known classes: {known}")

    @property
    def enabled(self) -> tuple[BewareClass, ...]:
        """Entries whose points are obstacles now."""
        return tuple(entry for entry in self.classes if entry.enabled)

    @property
    def names(self) -> dict[int, str]:
        """Class id → name, removed entries included."""
        return {class_id: name for name, class_id in self.retired} | {
            entry.class_id: entry.name for entry in self.classes
        }

    @property
    def people_ids(self) -> list[int]:
        """Class ids of people; empty for a list without people."""
        return [entry.class_id for entry in self.classes if entry.name == PERSON]

    def edited(self, name: str, /, **changes: object) -> BewareList:
        """Return the next version with changed fields of one entry; raises `BadConfiguration` for
        an unknown key or a bad value."""
        if "class_id" in changes:
            raise BadConfiguration(f"beware list: {name}: class_id cannot be changed")
        merged = {**as_table(self.named(name)), **changes}
        table = {
            key: value for key, value in merged.items() if value is not None or key not in OPTIONAL
        }
        checked = from_table(BewareClass, table, f"beware list: {name}")
        return self.replaced(checked if other.name == name else other for other in self.classes)

    def replaced(self, classes: Iterable[BewareClass]) -> BewareList:
        """Return the next version with other entries; raises `BadConfiguration` if a name gets
        another class id, because the map stores ids."""
        classes = tuple(classes)
        names = self.names
        ids = {name: class_id for class_id, name in names.items()}
        for entry in classes:
            if names.get(entry.class_id, entry.name) != entry.name:
                raise BadConfiguration(
                    f"beware list: class_id {entry.class_id} belongs to "
                    f"{names[entry.class_id]!r} for ever"
                )
            if ids.get(entry.name, entry.class_id) != entry.class_id:
                raise BadConfiguration(
                    f"beware list: {entry.name!r} has class_id {ids[entry.name]} for ever"
                )
        kept = {entry.name for entry in classes}
        retired = tuple((name, class_id) for name, class_id in ids.items() if name not in kept)
        return BewareList(classes=classes, version=self.version + 1, retired=retired)


def as_table(entry: BewareClass) -> dict[str, object]:
    """Return an entry as plain values, as in a TOML table or JSON object, without fields that are
    None."""
    return {key: value for key, value in dataclasses.asdict(entry).items() if value is not None}


def as_toml(beware: BewareList) -> str:
    """Return the list as a TOML document that `load_beware_list` reads."""
    tables = (
        [f"{key} = {_toml(value)}" for key, value in as_table(entry).items()]
        for entry in beware.classes
    )
    return "\n".join("\n".join(["[[beware]]", *lines, ""]) for lines in tables)


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    # Strings, booleans and numbers of JSON are valid TOML, except for one control character that
    # JSON does not escape.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Document:
    beware: tuple[BewareClass, ...] = ()


def load_beware_list(path: Path) -> BewareList:
    """Read `[[beware]]` tables of a TOML file; raises `BadConfiguration` with file and key."""
    return BewareList(classes=from_table(_Document, read_toml(path), path.name).beware)


def default_beware_list() -> BewareList:
    """Return the list of the package (`navcore/mission/beware.toml`)."""
    return load_beware_list(Path(__file__).with_name("beware.toml"))
