"""What the console needs to explain the robot: its log of decisions, why its path leads where it
does, what it has recognised, its figures over time. `app` satisfies this port; every method may be
called from any thread, and none of them waits for, or holds up, the tick or the command thread.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

Kind = Literal[
    "mission", "goal", "replanned", "stopped", "released", "seen", "zone", "beware", "labelled"
]
"""What a decision is about."""
Place = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One decision, or something that led to one."""

    id: int
    """Grows by one with every entry, and goes on after a restart."""
    start: int
    """Which start of the console wrote it, counted from 1."""
    stamp_s: float
    """Robot's monotonic clock, of that start."""
    unix_s: float
    """The wall clock."""
    kind: Kind
    """What it is about."""
    text: str
    """A sentence for the operator, with the figures that matter."""
    place: Place | None = None
    """Where, in metres of the map frame; None when it has no place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A part of the log."""

    newest: int
    """Id of the newest entry of all; 0 before the first."""
    oldest: int
    """Id of the oldest entry that is still kept; 0 before the first."""
    start: int
    """Which start of the console this is: entries with a smaller one are from earlier."""
    entries: tuple[Entry, ...]
    """Oldest first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplainedRule:
    """Something that closes cells, and what it does to the path."""

    key: str
    """`class:<id>`, `zone:<id>` or `wall`."""
    name: str
    """What the operator calls it."""
    along_m: float
    """Metres of the path that lie against it."""
    saves_m: float | None = None
    """How much shorter the path would be without it; None when that was not asked or cannot be
    said."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """Why the path leads where it does, or what would open one."""

    goal: Place
    """Where it leads."""
    reason: str | None
    """Why there is no path; None when there is one."""
    length_m: float | None
    """Of the path; None without one."""
    points: npt.NDArray[np.float64]
    """(N, 2) the path in metres of the map frame; (0, 2) without one."""
    stretches: tuple[tuple[str | None, int, int], ...]
    """(key of a rule or None, first, last index of `points`), in order, all of the path."""
    rules: tuple[ExplainedRule, ...]
    """What stands there, where the path lies against it, and all that can be lifted; the costliest
    first."""
    all_cost_m: float | None
    """How much shorter the path would be with every rule lifted; None without a path, or when that
    cannot be said."""
    lift: tuple[str, ...] | None
    """Without a path: keys of the smallest set of rules whose lifting opens one; None when none
    does, or none was found."""
    lift_exact: bool
    """Whether that is proven; False when the search was given up at its bound."""
    lift_at_least: int
    """No smaller number of rules opens a path."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alternative:
    """The path without some rules; nothing is applied."""

    reason: str | None
    """Why there would be none; None when there would be one."""
    length_m: float | None
    """Its length."""
    difference_m: float | None
    """Its length less that of the present path; None when one of them is missing."""
    points: npt.NDArray[np.float64]
    """(N, 2) in metres of the map frame."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidates:
    """The motion primitives that the local planner chooses from, of the newest tick."""

    serial: int
    """Of the picture that they belong to."""
    arcs: npt.NDArray[np.float64]
    """(A, S, 2) points of each arc in metres of the map frame."""
    free: npt.NDArray[np.int64]
    """(A,) how many points of it the body can be driven along, the first ones."""
    chosen: int | None = None
    """Index of the one that is driven; None while the robot does something else, such as turning in
    place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """A thing of the beware list that was recognised at one place."""

    id: int
    """Stays with it."""
    class_name: str
    """Of the beware list."""
    class_id: int
    """The same."""
    place: Place
    """Map frame, metres."""
    confidence: float
    """Of its best picture, 0 to 1."""
    looks: int
    """Pictures that showed it."""
    first_s: float
    """When it was first recognised, robot's clock."""
    last_s: float
    """When last."""
    verdict: Literal["wrong"] | None = None
    """What the operator said of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LabellingState:
    """The folder of pictures for the next training."""

    folder: str
    """Where it is."""
    pictures: int
    """In it."""
    bytes_used: int
    """By them."""
    max_pictures: int
    """More are refused."""
    max_bytes: int
    """The same."""


class EventLog(Protocol):
    """The event log."""

    def page(
        self, *, kinds: Collection[Kind], since: int, limit: int, before: int | None = None
    ) -> Page:
        """Return the newest entries of some kinds (none: all), `since` < id < `before`, at most
        `limit`, oldest first.

        Raises `StorageFailed` when older entries are needed that cannot be read.
        """


class Detections(Protocol):
    """The detected objects of the beware list."""

    def all(self) -> tuple[Sighting, ...]:
        """Return all objects, newest first."""

    def crop(self, sighting_id: int) -> bytes:
        """Return the JPEG of an object's best view; raises `NotKnown`."""

    def counts(self) -> Mapping[int, int]:
        """Return the number of objects by class id, without wrong detections."""


class LabellingFolder(Protocol):
    """The data set of corrected images."""

    def state(self) -> LabellingState:
        """Return its present size and limits."""


class TimeSeries(Protocol):
    """Measurements over time, one row per second."""

    def after(self, since_s: float) -> Mapping[str, list[float | None]]:
        """Return columns of equal length, `t_s`, `speed_mps`, …, with the rows after a time of the
        robot's clock."""


class Diagnostics(Protocol):
    """The robot's reasons, for the console. Refusals are exceptions of `navcore.errors`."""

    @property
    def event_log(self) -> EventLog:
        """What the robot decided, and what led to it."""

    @property
    def detections(self) -> Detections:
        """Detected objects of the beware list."""

    @property
    def labelling(self) -> LabellingFolder:
        """Images for the next training, corrected by operators."""

    @property
    def series(self) -> TimeSeries:
        """Speed, distance, explored area and volume, tick times."""

    def explain(self) -> Explanation:
        """Explain the present path, or the one to the first waiting goal; raises `Refused` without
        a goal or a map."""

    def without(self, keys: Collection[str]) -> Alternative:
        """Plan the path without some rules; raises `NotKnown` for a key that names none."""

    def candidates(self) -> Candidates | None:
        """Return the local planner's motion primitives; None before the first tick."""

    def mark_wrong(self, sighting_id: int, class_name: str | None) -> LabellingState:
        """Mark a detection as wrong: it is of another class, or of none of the list for None. Its
        frame is added to the labelling folder, corrected."""

    def snapshot(self) -> int:
        """Hold the present image for `add_example` and return its id; raises `Refused` before the
        first. Only the newest few are held."""

    def snapshot_image(self, snapshot: int) -> bytes:
        """Return the JPEG of a held image; raises `NotKnown`."""

    def add_example(
        self, snapshot: int, class_name: str, box: tuple[int, int, int, int]
    ) -> LabellingState:
        """Add a held image to the labelling folder: the box (left, top, right, bottom), in pixels,
        contains a missed object of a class."""
