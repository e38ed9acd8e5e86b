"""Building blocks of request bodies: finite numbers in ranges, printable names, no unknown keys.

The body of a frozen dataclass is derived from it, so that each range is stated once.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    StrictBool,
    StrictStr,
    create_model,
    with_config,
)
from pydantic_core import CoreSchema, core_schema
from typing_extensions import TypedDict

from navcore.config.planning import PlanningConfig
from navcore.mission.prototype import MAX_CHANNELS
from navcore.toml_config import from_table
from web.interface.sites import FAR_M
from web.interface.wire import DOCUMENTED, descriptions


@with_config(DOCUMENTED)
class Limits(TypedDict):
    """Range of a number, both ends included."""

    low: float
    """Smallest value."""
    high: float
    """Largest value."""


MAX_NAME = 80
"""Largest length of a name in characters."""
MAX_ANGLE_RAD = 100.0
"""Largest angle in radians."""


def _printable(text: str) -> str:
    """Refuse control characters and lone surrogates: they break logs, labels and later answers."""
    if not text.strip():
        raise ValueError("a blank text is none")
    if not text.isprintable():
        raise ValueError("expected printable text")
    return text


def _addressable(text: str) -> str:
    """Refuse what clients resolve as a folder in an address, so that it never arrives there."""
    if text in (".", ".."):
        raise ValueError("“.” and “..” are no names: in an address they mean folders")
    return text


def hand_over(value: Any) -> Any:
    """Return a value as it is. Called for each entry of what may be large, because the interpreter
    changes threads between the steps of Python code alone: compiled code that reads or checks many
    megabytes would hold up the event loop, and with it a stop, from any thread. Each object and
    each number of a body is such an entry; a list of nothing but texts, constants or empty lists is
    read at once, 20 MB of them in about 0.3 s."""
    return value


def number(low: float, high: float) -> Any:
    """Return the constraints of a finite JSON number in [low, high]."""
    return Field(strict=True, allow_inf_nan=False, ge=low, le=high)


Metres = Annotated[float, number(-FAR_M, FAR_M)]
Share = Annotated[float, number(0.0, 1.0)]
Radians = Annotated[float, number(-MAX_ANGLE_RAD, MAX_ANGLE_RAD)]
_PRICE = PlanningConfig.__dataclass_fields__["unknown_price"].metadata
UNKNOWN_PRICE_RANGE: Limits = {"low": _PRICE["low"], "high": _PRICE["high"]}
"""Range of the price of unseen floor."""
UnknownPrice = Annotated[float, number(_PRICE["low"], _PRICE["high"])]
Corner = tuple[Metres, Metres]
Name = Annotated[StrictStr, Field(min_length=1, max_length=MAX_NAME), AfterValidator(_printable)]
NewName = Annotated[Name, AfterValidator(_addressable)]
"""Name of something new that is addressed by it; what is stored already may have any name."""
Label = Annotated[
    StrictStr,
    Field(max_length=MAX_NAME),
    AfterValidator(lambda text: _printable(text) if text else text),
]


class Closed(BaseModel):
    """Body whose unknown keys are refused by name."""

    model_config = DOCUMENTED | ConfigDict(extra="forbid", frozen=True)


class PoseIn(Closed):
    """Pose of the robot in the map, T_map_base."""

    x_m: Metres
    """x in metres of the map frame."""
    y_m: Metres
    """y in metres of the map frame."""
    yaw_rad: Radians
    """Heading in radians, counter-clockwise from x."""


@dataclass(frozen=True, slots=True)
class Body:
    """Annotation: the dataclass is validated strictly, by the ranges in the metadata of its fields
    (see `navcore.toml_config.ranged`)."""

    ignored: tuple[str, ...] = ()
    """Further string keys that are accepted and dropped."""

    def __get_pydantic_core_schema__(self, kind: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return a schema that validates a body and constructs the dataclass."""
        model = body_model(kind, ignored=self.ignored)

        def construct(body: BaseModel) -> Any:
            table = body.model_dump(exclude=set(self.ignored), exclude_none=True)
            return from_table(kind, table, "body")

        return core_schema.no_info_after_validator_function(
            construct, handler.generate_schema(model)
        )


@dataclass(frozen=True, slots=True)
class Changes:
    """Annotation of a mapping: the given fields of a body, all of which may be missing or null."""

    model: type[Closed]
    """Body whose fields change."""
    optional: tuple[str, ...]
    """Fields that null removes; null leaves every other field unchanged."""

    def __get_pydantic_core_schema__(self, _: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return a schema that validates a body and keeps the given fields."""
        texts = descriptions(self.model)
        fields: dict[str, Any] = {
            name: (
                field.rebuild_annotation() | None,
                Field(None, description=field.description or texts.get(name)),
            )
            for name, field in self.model.model_fields.items()
        }
        model = create_model(f"{self.model.__name__}Changes", __base__=Closed, **fields)

        def given(body: BaseModel) -> Mapping[str, object]:
            changes = body.model_dump(exclude_unset=True).items()
            return {
                name: value for name, value in changes if value is not None or name in self.optional
            }

        return core_schema.no_info_after_validator_function(given, handler.generate_schema(model))


@dataclass(frozen=True, slots=True)
class Entry:
    """Annotation of a mapping: the given fields of a body, those that it requires among them."""

    model: type[Closed]
    """Body."""

    def __get_pydantic_core_schema__(self, _: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return a schema that validates a body and keeps the given fields."""

        def given(body: BaseModel) -> Mapping[str, object]:
            return body.model_dump(exclude_unset=True, exclude_none=True)

        return core_schema.no_info_after_validator_function(
            given, handler.generate_schema(self.model)
        )


def body_model(
    kind: type[Any],
    name: str | None = None,
    *,
    omitted: tuple[str, ...] = (),
    ignored: tuple[str, ...] = (),
) -> type[Closed]:
    """Return the body of a dataclass without some fields, with further keys that are ignored.
    `name`: that of the body, by default the one of the dataclass with `In`."""
    texts, hints = descriptions(kind), typing.get_type_hints(kind)
    fields: dict[str, Any] = {
        name: (StrictStr | None, Field(None, description="Ignored.")) for name in ignored
    }
    for field in dataclasses.fields(kind):
        if field.name not in omitted:
            default = ... if field.default is dataclasses.MISSING else field.default
            fields[field.name] = (
                _constrained(hints[field.name], field.metadata),
                Field(default, description=texts.get(field.name)),
            )
    return create_model(
        name or f"{kind.__name__}In", __base__=Closed, __doc__=kind.__doc__, **fields
    )


def _constrained(hint: Any, metadata: Mapping[str, Any]) -> Any:
    """Return the type of a field with its range, strict: no text for a number, no 1 for true."""
    arguments = typing.get_args(hint)
    if isinstance(hint, types.UnionType):
        inner = next(argument for argument in arguments if argument is not types.NoneType)
        return _constrained(inner, metadata) | None
    if typing.get_origin(hint) is tuple and arguments[-1] is Ellipsis:
        values = tuple[_constrained(arguments[0], metadata), ...]  # type: ignore[valid-type, misc]
        return Annotated[values, Field(max_length=MAX_CHANNELS)]
    if typing.get_origin(hint) is tuple:
        return tuple[tuple(_constrained(argument, metadata) for argument in arguments)]  # type: ignore[misc]
    if dataclasses.is_dataclass(hint):
        return body_model(typing.cast("type[Any]", hint))
    if hint is float:
        return Annotated[float, number(metadata["low"], metadata["high"])]
    if hint is int:
        return Annotated[int, Field(strict=True, ge=metadata["low"], le=metadata["high"])]
    return {bool: StrictBool, str: Name}[hint]
