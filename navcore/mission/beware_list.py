"""The beware list: the objects that must not be touched, and the confidence that each one needs.

One immutable, versioned value. The segmenter labels pixels with the class ids of all entries,
enabled or not, and the map keeps every class ever detected. So an edit of the list acts at once on
everything seen before.
"""

from __future__ import annotations

import dataclasses
import json
import re
import tomllib
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from navcore.errors import BadConfiguration
from navcore.mission.prototype import Prototype
from navcore.toml_config import from_table, ranged, read_text

NOTHING = 0
"""Class id of a pixel without an entry of the list; on the map, of a geometric obstacle."""
PERSON = "person"
"""Name of the entry for people."""
LARGEST_CLASS_ID = 62
"""Largest class id; the map has a bit for each id in a word."""
MAX_RETIRED = 500
"""Largest number of names that are remembered of removed and renamed entries."""
MAX_MARGIN_M = 2.0
"""Largest margin of an entry in metres."""
FLAT_M = 0.05
"""Height in metres up to which a colour is a flat marking, unless a rule says otherwise."""
MAX_NAME = 80
"""Largest length of a name in characters."""
OPTIONAL = (
    *("colour", "prototype", "min_height_m", "max_height_m", "min_size_m", "max_size_m"),
    *("label", "network_class"),
)
"""Fields of an entry that an edit may remove, with None."""
LIMITED = ("height_m", "size_m", "saturation", "value")
"""What has a least and a greatest value, `min_` and `max_`, in an entry or its colours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourPattern:
    """A second colour that alternates with that of the rule along the floor: the black of
    yellow-black tape, or the bare floor between lines. Without limits it is any colour that the
    rule does not take."""

    max_gap_m: float = ranged(0.02, 3.0)
    """Largest distance in metres across one colour from the other colour to the other again."""
    hue_deg: tuple[float, float] = ranged(0.0, 360.0, default=(0.0, 360.0))
    """First and last hue of the second colour in degrees, in rising order."""
    min_saturation: float = ranged(0.0, 1.0, default=0.0)
    """Smallest saturation of the second colour, 0 (grey) to 1."""
    max_saturation: float = ranged(0.0, 1.0, default=1.0)
    """Largest saturation of the second colour, 0 (grey) to 1."""
    min_value: float = ranged(0.0, 1.0, default=0.0)
    """Smallest brightness of the second colour, 0 (black) to 1."""
    max_value: float = ranged(0.0, 1.0, default=1.0)
    """Largest brightness of the second colour, 0 (black) to 1."""
    min_share: float = ranged(0.0, 0.5, default=0.1)
    """Least share of the floor of one marking that each of the two colours covers, 0 to 0.5."""
    min_line_m: float = ranged(0.0, 3.0, default=0.0)
    """Least length in metres of a line of the first colour; shorter pieces are none. 0 for any."""
    max_size_m: float = ranged(0.05, 100.0, default=100.0)
    """Largest length in metres of one marking; larger ones are something else."""

    @property
    def takes_any(self) -> bool:
        """Whether the second colour has no limits."""
        hues, saturations = self.hue_deg, (self.min_saturation, self.max_saturation)
        return (hues, saturations, self.min_value, self.max_value) == ((0, 360), (0, 1), 0, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorLine:
    """What tells a painted line from a floor or wall of its colour: it is narrow, and brighter than
    the floor on both sides. White and grey have no hue to tell them by."""

    max_width_m: float = ranged(0.02, 1.0)
    """Largest width of a line in metres."""
    min_contrast: float = ranged(0.05, 5.0)
    """Least difference of brightness from the floor beside the line, as a share of that of the
    floor (Weber contrast)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColourRule:
    """Range of colours in HSV; the hue range may wrap around red, for example 345 to 15."""

    hue_deg: tuple[float, float] = ranged(0.0, 360.0)
    """First and last hue in degrees, in rising order."""
    min_saturation: float = ranged(0.0, 1.0, default=0.5)
    """Smallest saturation, 0 (grey) to 1."""
    max_saturation: float = ranged(0.0, 1.0, default=1.0)
    """Largest saturation, 0 (grey) to 1; a low one is for white, grey and black."""
    min_value: float = ranged(0.0, 1.0, default=0.2)
    """Smallest brightness, 0 (black) to 1."""
    max_value: float = ranged(0.0, 1.0, default=1.0)
    """Largest brightness, 0 (black) to 1; a low one is for black."""
    max_height_m: float = ranged(0.0, 3.0, default=FLAT_M)
    """Largest height in metres above the floor: a marking is flat, and a red chair is no red
    zone."""
    fallback: bool = False
    """Whether the rule applies only without a network for the class: a rule may take a blue chair
    leg for a cup, where a network does not."""
    alone: bool = False
    """Whether the rule counts by itself even where a network knows the class; else the network and
    the rule weigh each other's evidence."""
    line: FloorLine | None = None
    """Limits of the lines that alone have this colour; None for areas of any width."""
    pattern: ColourPattern | None = None
    """Second colour that must alternate with this one along the floor; None for a plain colour."""


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
    prototype: Prototype | None = None
    """What the class looks like by a few clicks; None for a class without an example."""
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
    max_size_m: float | None = ranged(0.05, 10.0, default=None)
    """Largest length in metres of an object of this class; a longer surface that a network takes
    for one is furniture, such as a table for a box. For classes that are obstacles by their height.
    None for any size."""
    label: str | None = None
    """Name in the console, in the operator's language; None for the English name."""
    network_class: str | None = None
    """Class of the network that detects this one, kept when the entry is renamed; None for the
    class with the entry's own name."""

    @property
    def title(self) -> str:
        """What people call it: its name in the operator's language, else the English one."""
        return self.label or self.name

    @property
    def detected_as(self) -> str:
        """Class of the network that detects this one."""
        return self.network_class or self.name


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareList:
    """Classes of objects to beware of, in the operator's order."""

    classes: tuple[BewareClass, ...]
    """Entries, unique by name and by class id."""
    version: int = 0
    """Version of the list; grows by one with every edit."""
    retired: tuple[tuple[str, int], ...] = ()
    """Name and class id of removed entries, and former names of renamed ones, oldest first: maps
    may hold points under them. A name has one class id for ever, apart from former names beyond
    the newest `MAX_RETIRED`; an id keeps its last name."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "retired", _newest(self.retired, self.classes))
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
        """Class id → newest name, removed entries included."""
        return {class_id: name for name, class_id in self.retired} | {
            entry.class_id: entry.name for entry in self.classes
        }

    @property
    def titles(self) -> dict[int, str]:
        """Class id → what people call it, removed entries included."""
        return self.names | {entry.class_id: entry.title for entry in self.classes}

    @property
    def ids(self) -> dict[str, int]:
        """Name → class id, removed entries and former names included."""
        return dict(self.retired) | {entry.name: entry.class_id for entry in self.classes}

    @property
    def people_ids(self) -> list[int]:
        """Class ids of people; empty for a list without people."""
        return [entry.class_id for entry in self.classes if entry.detected_as == PERSON]

    def edited(self, name: str, /, **changes: object) -> BewareList:
        """Return the next version with changed fields of one entry; raises `BadConfiguration` for
        an unknown key or a bad value."""
        if "class_id" in changes:
            raise BadConfiguration(f"beware list: {name}: class_id cannot be changed")
        merged = {**as_table(self.named(name)), **changes}
        table = {
            key: _given(value)
            for key, value in merged.items()
            if value is not None or key not in OPTIONAL
        }
        checked = from_table(BewareClass, table, f"beware list: {name}")
        self.check_new_limits((checked,))
        return self.replaced(checked if other.name == name else other for other in self.classes)

    def replaced(self, classes: Iterable[BewareClass]) -> BewareList:
        """Return the next version with other entries; raises `BadConfiguration` if a name gets
        another class id or a class id an unknown name, because maps store ids."""
        classes = tuple(classes)
        ids = self.ids
        for entry in classes:
            if ids.get(entry.name, entry.class_id) != entry.class_id:
                raise BadConfiguration(
                    f"beware list: {entry.name!r} has class_id {ids[entry.name]} for ever"
                )
            if entry.name not in ids and entry.class_id in ids.values():
                raise BadConfiguration(
                    f"beware list: class_id {entry.class_id} belongs to "
                    f"{self.names[entry.class_id]!r} for ever"
                )
        return self._followed_by(classes)

    def added(self, table: Mapping[str, object]) -> BewareList:
        """Return the next version with one more entry at its end, given as plain values without
        `class_id`; a class that was removed before gets its class id back, and with it its points
        on the map."""
        name = table.get("name")
        if any(entry.name == name for entry in self.classes):
            raise BadConfiguration(f"beware list: there is a class {name!r} already")
        number = self.ids.get(name) if isinstance(name, str) else None
        for entry in self.classes:
            if entry.class_id == number:
                raise _former_name(str(name), entry.name)
        table = {**table, "class_id": self._free_id() if number is None else number}
        entry = from_table(BewareClass, table, "beware list")
        self.check_new_limits((entry,))
        return self.replaced((*self.classes, entry))

    def renamed(self, name: str, new: str) -> BewareList:
        """Return the next version with another name for an entry, which keeps its class id, so that
        what is on the map stays, and its class of the network."""
        entry, owner = self.named(name), self.ids.get(new)
        if any(other.name == new for other in self.classes):
            raise BadConfiguration(f"beware list: there is a class {new!r} already")
        if owner is not None and owner != entry.class_id:
            raise BadConfiguration(
                f"beware list: {new!r} was the name of another class; take another one"
            )
        network_class = None if entry.detected_as == new else entry.detected_as
        renamed = dataclasses.replace(entry, name=new, network_class=network_class)
        return self._followed_by(
            tuple(renamed if other is entry else other for other in self.classes)
        )

    def removed(self, name: str) -> BewareList:
        """Return the next version without an entry; its points stay in the map and count no
        more."""
        entry = self.named(name)
        return self._followed_by(tuple(other for other in self.classes if other is not entry))

    def ordered(self, names: Sequence[str]) -> BewareList:
        """Return the next version with the entries in another order, all of them named once."""
        if sorted(names) != sorted(entry.name for entry in self.classes):
            raise BadConfiguration("beware list: the order has to name every class once")
        return self._followed_by(tuple(map(self.named, names)))

    def adopted(self, classes: Iterable[BewareClass]) -> BewareList:
        """Return the next version with the entries of another list: a known name keeps its class id
        here, a new one takes its own where that is free."""
        wanted, ids = tuple(classes), self.ids
        self.check_new_limits(wanted)
        used, given = {*ids.values()}, dict[int, str]()
        adopted = []
        for entry in wanted:
            number = ids.get(entry.name)
            if number is None:
                number = entry.class_id if entry.class_id not in used else self._free_id(used)
            if number in given:
                newest = self.names[number]
                raise _former_name(entry.name if entry.name != newest else given[number], newest)
            given[number] = entry.name
            used.add(number)
            adopted.append(dataclasses.replace(entry, class_id=number))
        return self.replaced(adopted)

    def check_new_limits(self, classes: Iterable[BewareClass]) -> None:
        """Raise `BadConfiguration` as `check_limits` for an entry whose limits or colour are not
        those of its name in this list: what was stored before limits were compared stays."""
        stored = {entry.name: _limits_of(entry) for entry in self.classes}
        for entry in classes:
            if _limits_of(entry) != stored.get(entry.name):
                check_limits(entry, f"beware list: {entry.name}")

    def _free_id(self, used: Container[int] | None = None) -> int:
        taken = self.ids.values() if used is None else used
        for number in range(1, LARGEST_CLASS_ID + 1):
            if number not in taken:
                return number
        raise BadConfiguration(
            f"beware list: all {LARGEST_CLASS_ID} class ids are used, by removed classes too; "
            "rename or bring back one of those"
        )

    def _followed_by(self, classes: tuple[BewareClass, ...]) -> BewareList:
        known = self.ids
        for entry in classes:
            if entry.name not in known:
                check_name(entry.name, "beware list")
        kept = {(entry.name, entry.class_id) for entry in classes}
        retired = tuple(pair for pair in self.ids.items() if pair not in kept)
        return BewareList(classes=classes, version=self.version + 1, retired=retired)


def _former_name(former: str, newest: str) -> BadConfiguration:
    return BadConfiguration(
        f"beware list: {former!r} is a former name of {newest!r}; take another one"
    )


def _newest(
    retired: Sequence[tuple[str, int]], classes: Iterable[BewareClass]
) -> tuple[tuple[str, int], ...]:
    """Return the retired names without the oldest of more than `MAX_RETIRED`; of an id without
    another name none is left out."""
    surplus, kept = len(retired) - MAX_RETIRED, list[tuple[str, int]]()
    names = Counter([entry.class_id for entry in classes] + [number for _, number in retired])
    for pair in retired:
        if surplus > 0 and names[pair[1]] > 1:
            surplus -= 1
            names[pair[1]] -= 1
        else:
            kept.append(pair)
    return tuple(kept)


def check_name(name: str, where: str) -> None:
    """Raise `BadConfiguration` for a name of a class that is blank, too long, not printable, or
    that no address can end with."""
    if not name.strip() or not name.isprintable() or len(name) > MAX_NAME:
        raise BadConfiguration(
            f"{where}: name {name!r:.90}: expected 1 to {MAX_NAME} printable characters"
        )
    if name in (".", ".."):
        raise BadConfiguration(
            f"{where}: “.” and “..” are no names: in an address they mean folders"
        )


def check_limits(entry: BewareClass, where: str) -> None:
    """Raise `BadConfiguration` for an entry whose least value of something is above the greatest:
    nothing would be detected as it."""
    parts: list[tuple[str, BewareClass | ColourRule | ColourPattern]] = [(where, entry)]
    if entry.colour is not None:
        parts.append((f"{where}.colour", entry.colour))
        if entry.colour.pattern is not None:
            parts.append((f"{where}.colour.pattern", entry.colour.pattern))
    for place, part in parts:
        for what in LIMITED:
            low, high = f"min_{what}", f"max_{what}"
            least, greatest = getattr(part, low, None), getattr(part, high, None)
            if least is not None and greatest is not None and least > greatest:
                raise BadConfiguration(f"{place}.{low}: {least:g} is above {high} {greatest:g}")


def _limits_of(entry: BewareClass) -> tuple[object, ...]:
    """Return what `check_limits` compares."""
    ends = (f"{end}_{what}" for what in LIMITED for end in ("min", "max"))
    return (entry.colour, *(getattr(entry, end, None) for end in ends))


def as_table(entry: BewareClass) -> dict[str, object]:
    """Return an entry as plain values, as in a TOML table or JSON object, without fields that are
    None."""
    return {
        key: _given(value) for key, value in dataclasses.asdict(entry).items() if value is not None
    }


def _given(value: object) -> object:
    """Return a value without the parts of a rule that it has not: TOML has no null."""
    if isinstance(value, Mapping):
        return {key: _given(inner) for key, inner in value.items() if inner is not None}
    return value


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


_TABLE = re.compile(r"\s*\[\[\s*beware\s*\]\]")
_PLACE = re.compile(r"beware\[(\d+)\](?:\.(\w+))?(?:\.(\w+))?(.*)", re.DOTALL)


def parse_beware_list(text: str, where: str) -> BewareList:
    """Return the list of a TOML document; raises `BadConfiguration` with `where`, the line and the
    key of what is wrong."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        # What the parser says has no translation.
        at = re.search(r"line\s(\d+)", str(error))
        line = at[1] if at else max(len(text.splitlines()), 1)
        raise BadConfiguration(f"{where}: not readable as TOML, see line {line}") from None
    if not isinstance(given := document.get("beware", []), list):
        raise BadConfiguration(f"{where}: beware: expected a list, got {given!r}")
    try:
        classes = from_table(_Document, document, where).beware
        for number, entry in enumerate(classes):
            check_limits(entry, f"beware[{number}]")
    except BadConfiguration as error:
        found = _PLACE.search(str(error))
        if found is None:
            raise
        index, key, inner, said = found.groups()
        unknown = re.search(r"unknown key '(\w+)'", said)
        keys = (unknown[1] if unknown else None, inner, key)
        line = _line_of(text, int(index), keys)
        raise BadConfiguration(f"{where}: line {line}: {found.group()}") from None
    for index, entry in enumerate(classes):
        check_name(entry.name, f"{where}: line {_line_of(text, index, ('name',))}")
    for key in ("name", "class_id"):
        values = [getattr(entry, key) for entry in classes]
        for index, value in enumerate(values):
            if value in values[:index]:
                raise BadConfiguration(
                    f"{where}: line {_line_of(text, index, (key,))}: {key} {value!r} occurs more "
                    "than once"
                )
    return BewareList(classes=classes)


def _line_of(text: str, index: int, keys: Sequence[str | None]) -> int:
    """Return the line, from 1, of the first key that is in an entry, else of the entry's
    header."""
    lines = text.splitlines()
    headers = [number for number, line in enumerate(lines) if _TABLE.match(line)]
    if index >= len(headers):  # written as an inline array
        return 1
    end = headers[index + 1] if index + 1 < len(headers) else len(lines)
    for key in filter(None, keys):
        for number in range(headers[index], end):
            if re.search(rf"(^|[\s{{,.]){re.escape(key)}\s*[=\]]", lines[number]):
                return number + 1
    return headers[index] + 1


def load_beware_list(path: Path) -> BewareList:
    """Read `[[beware]]` tables of a TOML file; raises `BadConfiguration` with file, line and
    key."""
    return parse_beware_list(read_text(path), path.name)


def default_beware_list() -> BewareList:
    """Return the list of the package (`navcore/mission/beware.toml`)."""
    return load_beware_list(Path(__file__).with_name("beware.toml"))
