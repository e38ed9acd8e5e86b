"""The beware list: what the operator says must not be touched, and how sure the robot must be of
it.

One immutable, versioned value. The segmenter labels pixels with the entries' class ids whether or
not an entry is enabled; the map keeps every class it ever saw. So an edit of the list acts at once
on everything seen before.
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
"""Class id of a pixel that shows nothing of the list; on the map, of a purely geometric obstacle.
"""
PERSON = "person"
"""What the list calls people."""
LARGEST_CLASS_ID = 62
MAX_MARGIN_M = 2.0
OPTIONAL = ("colour", "min_height_m", "max_height_m", "min_size_m", "label")
"""Fields of an entry that an edit may take away, with None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourRule:
    """Pixels of a colour, in HSV; the hue range may wrap around red, e.g. 345 to 15."""

    hue_deg: tuple[float, float] = ranged(0.0, 360.0)
    """First and last hue, going up."""
    min_saturation: float = ranged(0.0, 1.0, default=0.5)
    """Least saturation, 0 (grey) to 1."""
    min_value: float = ranged(0.0, 1.0, default=0.2)
    """Least brightness, 0 (black) to 1."""
    max_height_m: float = ranged(0.0, 3.0, default=0.05)
    """Only points up to this height above the floor: a marking is flat, a red chair is no red zone.
    """
    fallback: bool = False
    """Only while no network knows the class: a blue chair leg is a cup to a rule, and need not be
    one to a network."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareClass:
    """One thing to beware of."""

    name: str
    """English name, unique in the list, e.g. `red floor`."""
    class_id: int = ranged(1, LARGEST_CLASS_ID)
    """What the map stores; stays with the name for ever."""
    enabled: bool = True
    """Whether its points are obstacles now."""
    margin_m: float = ranged(0.0, MAX_MARGIN_M, default=0.0)
    """Room kept around it beyond the robot's own margin."""
    min_confidence: float = ranged(0.0, 1.0, default=0.5)
    """Points the segmenter was less sure of are no obstacles."""
    colour: ColourRule | None = None
    """The rule that finds it by colour; None when only a network can."""
    min_height_m: float | None = ranged(0.01, 2.0, default=None)
    """What a thing of this class rises above the floor at least; what is flat is a picture of it.
    None when it may be flat."""
    max_height_m: float | None = ranged(0.01, 2.0, default=None)
    """How high a thing of this class is at most; what has something higher right above it is a part
    of that, as the foot of a chair, and that is in the way itself. None for a thing that may be as
    high as any."""
    min_size_m: float | None = ranged(0.01, 2.0, default=None)
    """What is seen of a thing of this class at once is at least so long; a speck is none, whether a
    network or a rule of colour sees it: floors have red grains, and pictures noise. None for any
    size."""
    label: str | None = None
    """What the console calls it, in the operator's language; the English name when there is none.
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareList:
    """Everything to beware of, in the operator's order."""

    classes: tuple[BewareClass, ...]
    """Unique by name and by class id."""
    version: int = 0
    """Grows by one with every edit."""
    retired: tuple[tuple[str, int], ...] = ()
    """Name and class id of entries that were taken off it: the map may still hold what was seen of
    them."""

    def __post_init__(self) -> None:
        for what in ("name", "class_id"):
            values = [getattr(entry, what) for entry in self.classes]
            twice = {value for value in values if values.count(value) > 1}
            if twice:
                raise BadConfiguration(f"beware list: {what} {twice.pop()!r} occurs more than once")

    def named(self, name: str) -> BewareClass:
        """The entry of that name; raises `BadConfiguration` when there is none."""
        for entry in self.classes:
            if entry.name == name:
                return entry
        known = ", ".join(entry.name for entry in self.classes)
        raise BadConfiguration(f"beware list: no class {name!r}; known classes: {known}")

    @property
    def enabled(self) -> tuple[BewareClass, ...]:
        """The entries that bind the robot now."""
        return tuple(entry for entry in self.classes if entry.enabled)

    @property
    def names(self) -> dict[int, str]:
        """What class ids mean, of entries that were taken off it, too."""
        return {class_id: name for name, class_id in self.retired} | {
            entry.class_id: entry.name for entry in self.classes
        }

    @property
    def people_ids(self) -> list[int]:
        """Class ids of people; empty where the list has none."""
        return [entry.class_id for entry in self.classes if entry.name == PERSON]

    def edited(self, name: str, /, **changes: object) -> BewareList:
        """The next version, with fields of one entry changed; raises `BadConfiguration` for an
        unknown key or a bad value."""
        if "class_id" in changes:
            raise BadConfiguration(f"beware list: {name}: class_id stays with the name for ever")
        merged = {**as_table(self.named(name)), **changes}
        table = {
            key: value for key, value in merged.items() if value is not None or key not in OPTIONAL
        }
        checked = from_table(BewareClass, table, f"beware list: {name}")
        return self.replaced(checked if other.name == name else other for other in self.classes)

    def replaced(self, classes: Iterable[BewareClass]) -> BewareList:
        """The next version, with other entries; id and name stay together, for the map remembers
        ids."""
        classes = tuple(classes)
        names = self.names
        ids = {name: class_id for class_id, name in names.items()}
        for entry in classes:
            if names.get(entry.class_id, entry.name) != entry.name:
                raise BadConfiguration(
                    f"beware list: class_id {entry.class_id} belongs to {names[entry.class_id]!r} for ever"
                )
            if ids.get(entry.name, entry.class_id) != entry.class_id:
                raise BadConfiguration(
                    f"beware list: {entry.name!r} has class_id {ids[entry.name]} for ever"
                )
        kept = {entry.name for entry in classes}
        retired = tuple((name, class_id) for name, class_id in ids.items() if name not in kept)
        return BewareList(classes=classes, version=self.version + 1, retired=retired)


def as_table(entry: BewareClass) -> dict[str, object]:
    """The entry as plain values, as a TOML table or JSON object would give it; without what is
    None."""
    return {key: value for key, value in dataclasses.asdict(entry).items() if value is not None}


def as_toml(beware: BewareList) -> str:
    """The list as a document that `load_beware_list` reads."""
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
    # JSON's strings, booleans and numbers are TOML's too, but for the one control character that
    # JSON leaves as it is.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Document:
    beware: tuple[BewareClass, ...] = ()


def load_beware_list(path: Path) -> BewareList:
    """Read `[[beware]]` tables; raises `BadConfiguration` naming file and key."""
    return BewareList(classes=from_table(_Document, read_toml(path), path.name).beware)


def default_beware_list() -> BewareList:
    """The list shipped with the package (`navcore/beware.toml`)."""
    return load_beware_list(Path(__file__).with_name("beware.toml"))
