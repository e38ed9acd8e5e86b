"""Beware list in the console: its versions, previews of an edit, and looks at a colour rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from navcore.mission.beware_list import BewareClass, BewareList, ColourRule
from navcore.mission.prototype import Prototype
from navcore.perception.labels import LabelSource
from web.interface.drafts import EditHistory, PathPreview
from web.interface.wire import served

OPERATOR = "The operator"
"""Who makes an edit on a console without users."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareVersion:
    """Stored version of the beware list, and the edit that led to it."""

    list: BewareList
    """The list."""
    unix_s: float | None = None
    """When it was stored, seconds since 1970; None where that is not known."""
    by: str = ""
    """Who made the edit; empty where that is not known."""
    what: str = ""
    """Description of the edit; empty where that is not known."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class BewareVersionSummary:
    """Stored version of the list, without it."""

    version: int
    """Number of the version."""
    unix_s: float | None
    """When it was stored, seconds since 1970; null where that is not known."""
    by: str
    """Who made the edit; empty where that is not known."""
    what: str
    """Description of the edit; empty where that is not known."""
    classes: int
    """Number of classes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BewareDraft:
    """Edit of the list that is not applied: another list to begin with, then changes of single
    classes."""

    version: int | None = None
    """Stored version to begin with; None for the list in force."""
    toml: str | None = None
    """TOML document to begin with; None for the list in force."""
    ready_made: str | None = None
    """Name of a ready-made list to begin with, see `take_ready_made`; None for the list in
    force."""
    changes: Mapping[str, Mapping[str, object] | None] = field(default_factory=dict)
    """Changed fields of some classes, by name; None for a class to remove."""
    add: Mapping[str, object] | None = None
    """Class to add, given as plain values without its id; None to add none."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ListPreview:
    """Effect of another beware list; nothing is applied."""

    appear: npt.NDArray[np.float64]
    """(N, 2) middles in metres of the map frame of cells that would be occupied and are not."""
    go: npt.NDArray[np.float64]
    """(N, 2) middles in metres of the map frame of cells that are occupied and would not be."""
    nearer: int = 0
    """Number of cells that stay occupied and to which the robot would come nearer."""
    path: PathPreview | None = None
    """Path to the present goal with the other list; None without a goal."""
    present: PathPreview | None = None
    """Path to the present goal with the list in force; None without a goal."""
    cut_off: tuple[str, ...] = ()
    """Titles of the waiting goals that have a path now and would have none."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecentLook:
    """What a colour rule or an example takes in one image."""

    rgb: npt.NDArray[np.uint8]
    """(H, W, 3) the image."""
    mask: npt.NDArray[np.bool_]
    """(H, W) pixels that the rule takes."""
    age_s: float
    """Age of the image in seconds."""
    frame: str
    """Name of the image, in which a click can be made as long as it is kept."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExampleClick:
    """What a click has taken of a thing."""

    key: str
    """Key of the click, under which it is kept for a while."""
    frame: str
    """Name of the image that was clicked."""
    mask: npt.NDArray[np.bool_]
    """(H, W) pixels of the thing."""


class ColourRules(Protocol):
    """Colour rules from clicks, tried on the newest image and on those of the last minutes."""

    def proposed(self, right: float, down: float, *, frame: str | None = None) -> ColourRule:
        """Return the rule for what is at a position in the newest image or in a named one, given as
        shares of width and height; raises `Refused` without that image."""

    def looks(self, rule: ColourRule, at_most: int) -> Sequence[RecentLook]:
        """Return what a rule takes in the newest image and in some older ones, newest first."""


class Examples(Protocol):
    """Classes by example: clicks on a thing, and what is made of them. All raise `Refused` with
    the reason where no network runs, and for clicks that are no longer kept."""

    @property
    def hindrance(self) -> str | None:
        """Why no class can be made by example here; None where it can."""

    def click(
        self, right: float, down: float, beware: BewareList, *, frame: str | None = None
    ) -> ExampleClick:
        """Return what a click takes in the newest image or in a kept one, given as shares of width
        and height; `Refused` for floor, a wall, a place without depth and what the list knows."""

    def made(self, taken: Sequence[str], away: Sequence[str] = ()) -> Prototype:
        """Return the prototype of what some clicks have taken without what others have; `Refused`
        where it looks too much like what is around it."""

    def looks(self, prototype: Prototype, at_most: int) -> Sequence[RecentLook]:
        """Return what a prototype takes in the newest image and in some older ones, newest
        first."""


class BewareEdits(Protocol):
    """Beware list and its edits. `by` names the user in the list of versions.

    An edit raises `BadConfiguration` for a wrong value, a name that exists, and a colour rule that
    takes half of all pixels; `Refused` for an empty list unless it is forced.
    """

    @property
    def list(self) -> BewareList:
        """List in force."""

    @property
    def history(self) -> EditHistory:
        """Edits that can be undone and redone."""

    @property
    def colours(self) -> ColourRules:
        """Colour rules from clicks."""

    @property
    def examples(self) -> Examples:
        """Classes by example."""

    def finder(self, entry: BewareClass) -> LabelSource:
        """Return which part of the segmenter detects an entry of the list."""

    def edit(
        self,
        name: str,
        changes: Mapping[str, object],
        *,
        expected_version: int | None = None,
        by: str = OPERATOR,
    ) -> BewareList:
        """Change fields of one class, e.g. `enabled`, `margin_m`, `min_confidence`, `colour` (a
        table), or `name`, which keeps what is on the map; None removes an optional one. `Outdated`
        when the list's version is not the expected one."""

    def add(self, entry: Mapping[str, object], *, by: str = OPERATOR) -> BewareList:
        """Add a class, given as plain values without its id."""

    def remove(
        self,
        name: str,
        *,
        expected_version: int | None = None,
        force: bool = False,
        by: str = OPERATOR,
    ) -> BewareList:
        """Remove a class; `force` allows to remove the last one."""

    def order(self, names: Sequence[str], *, by: str = OPERATOR) -> BewareList:
        """Change the order of the classes."""

    def replace(
        self,
        beware: BewareList,
        *,
        expected_version: int | None = None,
        force: bool = False,
        by: str = OPERATOR,
    ) -> BewareList:
        """Replace the list; the new one gets the next version."""

    def import_toml(
        self,
        text: str,
        *,
        expected_version: int | None = None,
        force: bool = False,
        by: str = OPERATOR,
    ) -> BewareList:
        """Replace the list by that of a TOML document, whose known names keep their ids here;
        raises `BadConfiguration` with the line and the field of what is wrong."""

    def take_ready_made(self, name: str, *, by: str = OPERATOR) -> BewareList:
        """Replace the list by a ready-made one, as the next version: `default` is that of a new
        site, others are those of `navcore.mission.beware_sets`. Raises `NotKnown`."""

    def versions(self) -> tuple[BewareVersionSummary, ...]:
        """Return the stored versions, newest first."""

    def version(self, version: int) -> BewareVersion:
        """Return a stored version; raises `NotKnown`."""

    def restore(self, version: int, *, force: bool = False, by: str = OPERATOR) -> BewareList:
        """Bring back a stored version, as the next one; raises `NotKnown`."""

    def drafted(self, draft: BewareDraft) -> BewareList:
        """Return the list after an edit; nothing is applied. Raises what the edit would raise."""

    def undo(self, *, by: str = OPERATOR) -> str:
        """Undo the newest edit and return its description; `Refused` without one."""

    def redo(self, *, by: str = OPERATOR) -> str:
        """Repeat the edit that was undone last and return its description."""
