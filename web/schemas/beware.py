"""The beware list in requests and answers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, Field, StrictBool, StrictStr

from navcore.mission.beware_list import (
    LARGEST_CLASS_ID,
    OPTIONAL,
    BewareClass,
    BewareList,
    ColourRule,
)
from navcore.mission.prototype import Prototype
from web.images import palette
from web.interface.beware import BewareDraft, BewareEdits, BewareVersionSummary, ListPreview
from web.interface.wire import DOCUMENTED, Points, Position, rounded, served, values_of
from web.schemas.drafts import PathPreviewOut, difference
from web.schemas.fields import Body, Changes, Closed, Entry, Limits, body_model

BewareEntry = Annotated[BewareClass, Body(ignored=("display", "found_by"))]
_NewClass = body_model(BewareClass, "NewBewareClass", omitted=("class_id",))
BewareChanges = Annotated[Mapping[str, object], Changes(_NewClass, OPTIONAL)]
"""Changed fields of one class; null removes an optional one. A new name keeps what is on the
map."""
NewEntry = Annotated[Mapping[str, object], Entry(_NewClass)]
"""Fields of a new class, without its id."""
Rule = Annotated[ColourRule, Body()]
Example = Annotated[Prototype, Body()]


MAX_CELLS, MAX_CLICKS = 5000, 16
"""Largest number of cells in an answer, and of clicks that a class is made of."""
MAX_VERSION = 1_000_000_000
"""Largest version of the list."""


class BewareListIn(Closed):
    """Whole list, in the operator's order."""

    classes: Annotated[list[BewareEntry], Field(max_length=LARGEST_CLASS_ID)]
    """Classes of the list."""
    version: int | None = None
    """Ignored; `If-Match` guards against lost edits."""
    can_undo: StrictBool | None = None
    """Ignored."""
    can_redo: StrictBool | None = None
    """Ignored."""
    limits: Mapping[str, object] | None = None
    """Ignored."""
    no_examples: str | None = None
    """Ignored."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class ListedClass(BewareClass):
    """Class of the beware list as the console shows it."""

    display: str
    """Colour of the class in the console, `#rrggbb`."""
    found_by: str
    """Part of the segmenter that detects the class."""


LIMITS: dict[str, Limits] = {
    field.name: {"low": field.metadata["low"], "high": field.metadata["high"]}
    for field in dataclasses.fields(BewareClass)
    if "low" in field.metadata
}
"""Ranges of the numbers of a class."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class BewareOut:
    """Beware list in force; its version is the ETag."""

    version: int
    """Version of the list."""
    classes: tuple[ListedClass, ...]
    """Classes in the operator's order."""
    can_undo: bool
    """Whether `beware/undo` has an edit to undo."""
    can_redo: bool
    """Whether `beware/redo` has an edit to repeat."""
    limits: Mapping[str, Limits]
    """Smallest and largest value of each number of a class, by its key."""
    no_examples: str | None
    """Why no class can be made by clicks on a thing here; null where one can."""

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
        history = editor.history
        return BewareOut(
            version=beware.version,
            classes=classes,
            can_undo=history.undo is not None,
            can_redo=history.redo is not None,
            limits=LIMITS,
            no_examples=editor.examples.hindrance,
        )


ListName = Literal["default", "office", "indoor", "outdoor"]
"""Name of a ready-made list, `default` for that of a new site."""


class OrderIn(Closed):
    """Order of the classes."""

    names: Annotated[list[StrictStr], Field(max_length=LARGEST_CLASS_ID)]
    """Names of all classes, in the new order."""


class BewareDraftIn(Closed):
    """Edit of the list to preview: another list to begin with, at most one, then changes."""

    version: Annotated[int, Field(strict=True, ge=0, le=MAX_VERSION)] | None = None
    """Stored version to begin with; null for the list in force."""
    toml: StrictStr | None = None
    """Content of a TOML file to begin with; null for the list in force."""
    ready_made: ListName | None = None
    """Ready-made list to begin with; null for the list in force."""
    changes: Annotated[
        dict[str, BewareChanges | None],
        Field(max_length=LARGEST_CLASS_ID, default_factory=dict),
    ]
    """Changed fields of some classes, by name; null for a class to remove."""
    add: NewEntry | None = None
    """Class to add; null to add none."""

    def draft(self) -> BewareDraft:
        """Return the edit."""
        return BewareDraft(
            version=self.version,
            toml=self.toml,
            ready_made=self.ready_made,
            changes=self.changes,
            add=self.add,
        )


class ListPreviewOut(BaseModel):
    """Effect of an edit of the list; nothing is applied."""

    model_config = DOCUMENTED

    appear: list[Position]
    """Middles in metres of the map frame of cells that would be occupied; thinned beyond
    `MAX_CELLS`."""
    appear_count: int
    """Number of cells that would be occupied."""
    go: list[Position]
    """Middles in metres of the map frame of cells that would be free; thinned beyond
    `MAX_CELLS`."""
    go_count: int
    """Number of cells that would be free."""
    nearer_count: int
    """Number of cells that stay occupied and to which the robot would come nearer."""
    changes: tuple[str, ...]
    """What the edit changes in the list."""
    path: PathPreviewOut | None
    """Path to the present goal with the edit; null without a goal."""
    present: PathPreviewOut | None
    """Path to the present goal without the edit; null without a goal."""
    change_m: float | None
    """Additional length of the path in metres; null when one of the paths is missing."""
    change_s: float | None
    """Additional travel time in seconds; null when one of the paths is missing."""
    cut_off: tuple[str, ...]
    """Titles of the waiting goals that have a path now and would have none."""

    @staticmethod
    def of(preview: ListPreview, changes: tuple[str, ...]) -> ListPreviewOut:
        """Return the answer for a preview of some changes."""
        path, present = preview.path, preview.present
        length_m, time_s = (
            difference(getattr(path, key, None), getattr(present, key, None))
            for key in ("length_m", "time_s")
        )
        return ListPreviewOut(
            appear=_thinned(preview.appear),
            appear_count=len(preview.appear),
            go=_thinned(preview.go),
            go_count=len(preview.go),
            nearer_count=preview.nearer,
            changes=changes,
            path=None if path is None else PathPreviewOut.of(path),
            present=None if present is None else PathPreviewOut.of(present),
            change_m=length_m,
            change_s=time_s,
            cut_off=preview.cut_off,
        )


class RuleOut(BaseModel):
    """Proposed colour rule."""

    model_config = DOCUMENTED

    rule: ColourRule
    """Rule, as an entry's `colour` takes it."""


class LookOut(BaseModel):
    """What a colour rule or an example takes in one image."""

    model_config = DOCUMENTED

    age_s: float
    """Age of the image in seconds."""
    share: float
    """Share of its pixels that the rule takes."""
    frame: str
    """Name of the image, in which a click can be made as long as it is kept."""
    mask: str
    """PNG of the taken pixels as a data URL; all others are transparent."""
    picture: str
    """JPEG of the image as a data URL; empty for the newest one."""


Keys = Annotated[list[Annotated[str, Field(max_length=64)]], Field(max_length=MAX_CLICKS)]


class ClickOut(BaseModel):
    """What a click has taken."""

    model_config = DOCUMENTED

    key: str
    """Key of the click; it is kept for a while."""
    frame: str
    """Name of the image that was clicked."""
    mask: str
    """PNG of the pixels of the thing as a data URL; all others are transparent."""


class ExampleIn(Closed):
    """Clicks to make a class of."""

    clicks: Annotated[Keys, Field(min_length=1)]
    """Keys of the clicks on the thing."""
    away: Keys = Field(default_factory=list)
    """Keys of clicks on what does not belong to it."""


class ExampleOut(BaseModel):
    """A class by example, which is not applied yet."""

    model_config = DOCUMENTED

    prototype: Prototype
    """Prototype, as an entry's `prototype` takes it."""
    looks: list[LookOut]
    """What it takes in the newest image and in those of the last minutes."""


class LooksOut(BaseModel):
    """What a colour rule takes in the newest image and in those of the last minutes."""

    model_config = DOCUMENTED

    looks: list[LookOut]
    """Looks, newest first."""


class VersionsOut(BaseModel):
    """Stored versions of the list."""

    model_config = DOCUMENTED

    versions: tuple[BewareVersionSummary, ...]
    """Versions, newest first."""


class ComparisonOut(BaseModel):
    """Stored version beside the list in force."""

    model_config = DOCUMENTED

    version: int
    """Number of the version."""
    classes: tuple[BewareClass, ...]
    """Its classes."""
    changes: tuple[str, ...]
    """What would change if it was brought back."""


def _thinned(points: Points) -> list[Position]:
    step = max(1, math.ceil(len(points) / MAX_CELLS))
    return rounded(points[::step])
