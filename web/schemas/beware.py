"""The beware list in requests and answers."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field, StrictBool
from typing_extensions import TypedDict

from navcore.mission.beware_list import LARGEST_CLASS_ID, OPTIONAL, BewareClass, BewareList
from web.images import palette
from web.interface.operations import BewareEdits
from web.interface.wire import DOCUMENTED, documented_as, values_of
from web.schemas.fields import Body, Changes, Closed, body_model

BewareEntry = Annotated[BewareClass, Body(ignored=("display", "found_by"))]
BewareChanges = Annotated[
    Mapping[str, object], Changes(body_model(BewareClass, omitted=("name", "class_id")), OPTIONAL)
]
"""Changed fields of one class; null removes an optional one."""


class BewareListIn(Closed):
    """Whole list, in the operator's order."""

    classes: Annotated[list[BewareEntry], Field(max_length=LARGEST_CLASS_ID)]
    """Classes of the list."""
    version: int | None = None
    """Ignored; `If-Match` guards against lost edits."""
    can_undo: StrictBool | None = None
    """Ignored."""
    limits: Mapping[str, object] | None = None
    """Ignored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedClass(BewareClass):
    """Class of the beware list as the console shows it."""

    __pydantic_config__: ClassVar[ConfigDict] = documented_as(BewareClass)

    display: str
    """Colour of the class in the console, `#rrggbb`."""
    found_by: str
    """Part of the segmenter that detects the class."""


class Limits(TypedDict):
    """Range of a number, both ends included."""

    low: float
    """Smallest value."""
    high: float
    """Largest value."""


LIMITS: dict[str, Limits] = {
    field.name: {"low": field.metadata["low"], "high": field.metadata["high"]}
    for field in dataclasses.fields(BewareClass)
    if "low" in field.metadata
}
"""Ranges of the numbers of a class."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareOut:
    """Beware list in force; its version is the ETag."""

    __pydantic_config__: ClassVar[ConfigDict] = DOCUMENTED

    version: int
    """Version of the list."""
    classes: tuple[ListedClass, ...]
    """Classes in the operator's order."""
    can_undo: bool
    """Whether `beware/undo` has an edit to undo."""
    limits: Mapping[str, Limits]
    """Smallest and largest value of each number of a class, by its key."""

    @staticmethod
    def of(beware: BewareList, editor: BewareEdits) -> BewareOut:
        """Return a list with the console's colours and what detects each class."""
        classes = tuple(
            ListedClass(
                **values_of(entry),
                display=palette.hex_colour(palette.class_colour(entry.class_id)),
                found_by=str(editor.finder(entry)),
            )
            for entry in beware.classes
        )
        return BewareOut(
            version=beware.version, classes=classes, can_undo=editor.can_undo, limits=LIMITS
        )
