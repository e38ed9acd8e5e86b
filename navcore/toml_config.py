"""Dataclasses from TOML tables: unknown, missing, mistyped and out-of-range keys are refused by
name."""

from __future__ import annotations

import dataclasses
import io
import math
import tomllib
import types
import typing
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from navcore.errors import BadConfiguration
from navcore.files import read_whole

T = TypeVar("T")
MAX_BYTES = 1 << 22
"""Largest TOML file that is read, in bytes."""
_LARGEST_INT = 1 << 53
"""Largest integer; beyond it floats no longer represent every integer."""


def read_toml(path: Path) -> dict[str, Any]:
    """Return the document of a file; raises `BadConfiguration` with file and line if it is
    invalid."""
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise BadConfiguration(f"{path}: not readable as TOML: {error}") from None


def read_text(path: Path) -> str:
    """Return the text of a file of at most `MAX_BYTES`, its line ends as newlines; raises
    `BadConfiguration` with the file if it cannot be read."""
    data = read_whole(path, at_most=MAX_BYTES)
    try:
        return io.TextIOWrapper(io.BytesIO(data), encoding="utf-8").read()
    except UnicodeDecodeError as error:
        raise BadConfiguration(f"{path}: not readable as TOML: {error}") from None


def from_table(kind: type[T], table: object, where: str, base: T | None = None) -> T:
    """Return the dataclass `kind` of a TOML table; missing keys are as in `base`, or the defaults.

    `where` is the key path shown in errors, for example `office.toml: people[0]`. Types follow the
    annotations: float (from an integer too), int, bool, str, nested dataclasses, tuples of those,
    `Literal` and optionals. Ranges are in the field's metadata (see `ranged`). Raises
    `BadConfiguration`.
    """
    if not isinstance(table, dict):
        raise BadConfiguration(f"{where}: expected a table, got {table!r}")
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}  # type: ignore[arg-type]
    hints = _hints(typing.cast(Any, kind))
    for key in table:
        if key not in fields:
            raise BadConfiguration(
                f"{where}: unknown key {key!r}; known keys: {', '.join(sorted(fields))}"
            )
    values = {}
    for name, field in fields.items():
        if name in table:
            values[name] = _value(
                hints[name],
                table[name],
                f"{where}.{name}",
                field.metadata,
                getattr(base, name, None),
            )
            # What is chosen from a list fails without an entry, and only later.
            if values[name] == () and field.default not in ((), dataclasses.MISSING):
                raise BadConfiguration(f"{where}.{name}: is empty, expected one value or more")
        elif base is not None:
            values[name] = getattr(base, name)
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise BadConfiguration(f"{where}: key {name!r} is missing")
    try:
        return kind(**values)
    except BadConfiguration as error:  # of values that do not go together
        raise BadConfiguration(f"{where}: {error}") from None


@cache
def _hints(kind: type[Any]) -> dict[str, Any]:
    """Return the types of the fields: evaluating the annotations takes most of the time to read a
    table, and stored lists have many."""
    return typing.get_type_hints(kind)


def ranged(low: float, high: float, **default: Any) -> Any:
    """Return a dataclass field for a number, or a tuple of numbers, in [low, high]."""
    return dataclasses.field(metadata={"low": low, "high": high}, **default)


def _value(
    hint: Any, value: object, where: str, metadata: typing.Mapping[str, Any], base: Any = None
) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is types.UnionType or origin is typing.Union:
        return _value(
            next(a for a in arguments if a is not types.NoneType), value, where, metadata, base
        )
    if origin is typing.Literal:
        if value not in arguments:
            raise BadConfiguration(
                f"{where}: expected one of {', '.join(map(repr, arguments))}, got {value!r}"
            )
        return value
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise BadConfiguration(f"{where}: expected a list, got {value!r}")
        if arguments[-1] is not Ellipsis and len(value) != len(arguments):
            raise BadConfiguration(f"{where}: expected {len(arguments)} values, got {len(value)}")
        inner = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
        return tuple(
            _value(a, v, f"{where}[{i}]", metadata)
            for i, (a, v) in enumerate(zip(inner, value, strict=True))
        )
    if dataclasses.is_dataclass(hint):
        return from_table(hint, value, where, base)  # type: ignore[arg-type]
    if (
        hint is float
        and isinstance(value, int)
        and not isinstance(value, bool)
        and abs(value) <= _LARGEST_INT
    ):
        value = float(value)
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > _LARGEST_INT:
        raise BadConfiguration(f"{where}: the number is out of range")
    if not isinstance(value, hint) or (hint is int and isinstance(value, bool)):
        raise BadConfiguration(f"{where}: expected {hint.__name__}, got {value!r}")
    if isinstance(value, int | float) and not isinstance(value, bool):
        low, high = metadata.get("low", -math.inf), metadata.get("high", math.inf)
        if not low <= value <= high or value in (math.inf, -math.inf):
            raise BadConfiguration(
                f"{where}: {value!r:.40} is out of range, allowed {low:g} to {high:g}"
            )
    return value
