"""How dataclasses of the interface appear in JSON."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Annotated, Any, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, InstanceOf, PlainSerializer, TypeAdapter

MAX_POLYLINE = 2000
"""Largest number of points of a polyline in an answer; longer ones are thinned."""
DOCUMENTED = ConfigDict(use_attribute_docstrings=True)
"""Configuration of a served dataclass: the docstrings of its fields are the descriptions in
OpenAPI."""

Points = npt.NDArray[np.float64]
Position = tuple[float, float]
"""(x, y) in metres of the map frame."""
_Kind = TypeVar("_Kind")
_served: list[type] = []
"""Served dataclasses without a schema yet."""


def polyline(points: Points) -> list[Position]:
    """Return a polyline (N, 2) thinned to `MAX_POLYLINE` points with both ends kept, rounded to
    millimetres, without points that are not finite."""
    if len(points) > MAX_POLYLINE:
        points = points[np.linspace(0, len(points) - 1, MAX_POLYLINE).round().astype(int)]
    return rounded(points[np.isfinite(points).all(axis=1)])


def rounded(points: Points) -> list[Position]:
    """Return all points (N, 2), rounded to millimetres."""
    return [(x, y) for x, y in np.round(points, 3).tolist()]


def descriptions(kind: type) -> dict[str, str]:
    """Return the docstrings of the fields of a dataclass."""
    schema = TypeAdapter(list[kind], config=DOCUMENTED).json_schema()  # type: ignore[valid-type]
    properties = schema["$defs"][kind.__name__]["properties"]
    return {
        name: entry["description"] for name, entry in properties.items() if "description" in entry
    }


def served(kind: type[_Kind]) -> type[_Kind]:
    """Class decorator of a dataclass in answers: the docstrings of its fields, and of those of a
    dataclass that it extends, are the descriptions in OpenAPI."""
    base = next(filter(is_dataclass, kind.__mro__[1:]), None)
    kind.__pydantic_config__ = DOCUMENTED if base is None else _documented_as(base)  # type: ignore[attr-defined]
    _served.append(kind)
    return kind


def build_schemas() -> None:
    """Make the schemas of all served dataclasses, once: pydantic takes the schema that a class has,
    instead of reading the class's source again for every route."""
    while _served:
        kind = _served.pop(0)
        kind.__pydantic_core_schema__ = TypeAdapter(kind).core_schema  # type: ignore[attr-defined]


def _documented_as(base: type) -> ConfigDict:
    """Return `DOCUMENTED` for a subclass of a dataclass: pydantic reads the docstrings of the
    fields that the subclass itself defines."""

    def add(schema: dict[str, Any]) -> None:
        for name, text in descriptions(base).items():
            schema["properties"][name].setdefault("description", text)

    return ConfigDict(use_attribute_docstrings=True, json_schema_extra=add)


def values_of(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass by name, nested dataclasses as they are."""
    return {field.name: getattr(value, field.name) for field in fields(value)}


Polyline = Annotated[Points, InstanceOf(), PlainSerializer(polyline, return_type=list[Position])]
"""(N, 2) points in metres of the map frame; at most `MAX_POLYLINE` of them in JSON."""
WholePolyline = Annotated[
    Points, InstanceOf(), PlainSerializer(rounded, return_type=list[Position])
]
"""(N, 2) points in metres of the map frame; all of them in JSON, where indices refer to them."""
