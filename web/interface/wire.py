"""How dataclasses of the interface appear in JSON."""

from __future__ import annotations

import ast
import inspect
import itertools
import sys
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, GetCoreSchemaHandler, InstanceOf, PlainSerializer, TypeAdapter
from pydantic_core.core_schema import any_schema

from navcore.geometry.transform import Pose2, Twist
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import BewareClass, ColourPattern, ColourRule, FloorLine
from navcore.mission.mission import Goal
from navcore.mission.prototype import Prototype
from navcore.planning.explanation.constraint_removal import Removal
from navcore.planning.explanation.path_explanation import Stretch
from navcore.safety.gate import StopReason

MAX_POLYLINE = 2000
"""Largest number of points of a polyline in an answer; longer ones are thinned."""
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
    """Return the docstrings of the fields of a class and of those it extends."""
    bases = [base for base in reversed(kind.__mro__) if "__annotations__" in vars(base)]
    return {
        name: text
        for base in bases
        for name, text in _texts(base.__module__).get(base.__name__, {}).items()
    }


@cache
def _texts(module: str) -> dict[str, dict[str, str]]:
    """Return the docstrings of the fields of each class of a module."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    return {node.name: _texts_of(node) for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}


def _texts_of(node: ast.ClassDef) -> dict[str, str]:
    found = {}
    for field, text in itertools.pairwise(node.body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            match text:
                case ast.Expr(value=ast.Constant(value=str(words))):
                    found[field.target.id] = inspect.cleandoc(words)
    return found


def _describe(schema: dict[str, Any], kind: type) -> None:
    for name, text in descriptions(kind).items():
        if name in schema.get("properties", {}):
            schema["properties"][name].setdefault("description", text)


DOCUMENTED = ConfigDict(json_schema_extra=_describe)
"""Configuration of a served class: the docstrings of its fields are the descriptions in OpenAPI.

They are read when OpenAPI is asked for. Pydantic would read them when the class is made, and the
whole file again for every class: a second of each start.
"""


def served(kind: type[_Kind]) -> type[_Kind]:
    """Class decorator of a dataclass in answers; they are without fields that count in no
    comparison, which are no part of its value."""
    kind.__pydantic_config__ = DOCUMENTED  # type: ignore[attr-defined]
    hidden = {field.name for field in fields(kind) if not field.compare}  # type: ignore[arg-type]
    if hidden:

        def schema_of(source: Any, handler: GetCoreSchemaHandler) -> Any:
            schema: Any = handler(source)
            for field in schema["schema"]["fields"]:
                if field["name"] in hidden:
                    field["serialization_exclude"], field["schema"] = True, any_schema()
            return schema

        kind.__get_pydantic_core_schema__ = staticmethod(schema_of)  # type: ignore[attr-defined]
    _served.append(kind)
    return kind


_CORE = (
    *(BewareClass, ColourPattern, ColourRule, FloorLine),
    *(Goal, GridSpec, Pose2, Prototype, Removal),
    *(StopReason, Stretch, Twist),
)
"""Values of the navigation core that answers hold."""
for _value in _CORE:
    served(_value)


def build_schemas() -> None:
    """Make the schemas of all served dataclasses, once: pydantic takes the schema that a class has,
    instead of making it again for every route."""
    while _served:
        kind = _served.pop(0)
        kind.__pydantic_core_schema__ = TypeAdapter(kind).core_schema  # type: ignore[attr-defined]


def values_of(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass by name, nested dataclasses as they are."""
    return {field.name: getattr(value, field.name) for field in fields(value)}


Polyline = Annotated[Points, InstanceOf(), PlainSerializer(polyline, return_type=list[Position])]
"""(N, 2) points in metres of the map frame; at most `MAX_POLYLINE` of them in JSON."""
WholePolyline = Annotated[
    Points, InstanceOf(), PlainSerializer(rounded, return_type=list[Position])
]
"""(N, 2) points in metres of the map frame; all of them in JSON, where indices refer to them."""
