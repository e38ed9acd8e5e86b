"""Port of the console to explanations: event log, path explanation, detections, time
series. `app` implements it.

Every method may be called from any thread; none waits for, or delays, the tick or the command
thread.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import computed_field

from navcore.planning.explanation.constraint_removal import Removal
from navcore.planning.explanation.path_explanation import Stretch
from web.interface.wire import Polyline, Position, WholePolyline, served

Kind = Literal[
    "mission",
    "goal",
    "replanned",
    "stopped",
    "released",
    "seen",
    "zone",
    "beware",
    "labelled",
    "place",
    "map",
]
"""Subject of an entry of the event log."""
Verdict = Literal["wrong", "rejected"]
"""What an operator said of a detection."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Entry of the event log: a decision of the robot, or an event that led to one."""

    id: int
    """Number of the entry; grows by one with every entry, across restarts."""
    start: int
    """Number of the start of the console that wrote the entry, counted from 1."""
    stamp_s: float
    """Time by the robot's monotonic clock of that start, seconds."""
    unix_s: float
    """Time by the wall clock, seconds since 1970."""
    kind: Kind
    """Subject of the entry."""
    text: str
    """Sentence for the operator, with the figures that matter."""
    place: Position | None = None
    """Position (x, y) in metres of the map frame; null for an entry without a position."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """Part of the event log, oldest entry first."""

    newest: int
    """Id of the newest entry of the whole log, 0 for an empty log; the next `since`."""
    oldest: int
    """Id of the oldest entry that is kept, 0 for an empty log; pages with `before` end here."""
    start: int
    """Number of the present start of the console; earlier starts have smaller numbers."""
    entries: tuple[Entry, ...]
    """Entries, oldest first."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class ExplainedRule:
    """Rule that blocks cells, and its effect on the path."""

    key: str
    """Key of the rule: `class:<id>`, `zone:<id>` or `wall`."""
    name: str
    """Name that the operator gave it."""
    along_m: float
    """Length of the path that touches the rule, metres."""
    saves_m: float | None = None
    """Length in metres by which the path is shorter without the rule; null when not computed."""


@served
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """Rules that shape the path, or the fewest rules whose removal opens one."""

    goal: Position
    """Goal (x, y) in metres of the map frame."""
    reason: str | None
    """Reason why there is no path; null when there is one."""
    length_m: float | None
    """Length of the path in metres; null without a path."""
    path: WholePolyline
    """(N, 2) points of the path in metres of the map frame; empty without a path."""
    stretches: tuple[Stretch, ...]
    """Consecutive parts of the path with the rule that each one touches."""
    rules: tuple[ExplainedRule, ...]
    """All rules that can be removed, and obstacles along the path, costliest first."""
    all_cost_m: float | None
    """Length in metres by which the path is shorter without all rules; null when not known."""
    main: tuple[str, ...] = ()
    """Keys of the rules that make the path longer: one rule, or a few that do so together; empty
    when no rule does."""
    main_cost_m: float = 0.0
    """Length in metres by which the path is shorter without the rules in `main`."""
    lift: Removal | None
    """Smallest set of rules whose removal opens a path; null when there is a path."""

    @computed_field  # type: ignore[prop-decorator]
    @property
    def found(self) -> bool:
        """Whether there is a path."""
        return self.reason is None


@served
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alternative:
    """Path without some rules; nothing is applied."""

    reason: str | None
    """Reason why there would be no path; null when there would be one."""
    length_m: float | None
    """Length of the path in metres; null without one."""
    difference_m: float | None
    """Length in metres beyond that of the present path; null when one of them is missing."""
    path: Polyline
    """(N, 2) points of the path in metres of the map frame; empty without one."""

    @computed_field  # type: ignore[prop-decorator]
    @property
    def found(self) -> bool:
        """Whether there would be a path."""
        return self.reason is None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidates:
    """Motion primitives of the local planner in the newest tick."""

    serial: int
    """Serial number of the tick."""
    arcs: npt.NDArray[np.float64]
    """(A, S, 2) points of each primitive in metres of the map frame."""
    free: npt.NDArray[np.int64]
    """(A,) number of leading points that the body reaches without a collision."""
    chosen: int | None = None
    """Index of the primitive that is driven; None during any other motion."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """Detected object of the beware list at one position."""

    id: int
    """Constant id of the object."""
    class_name: str
    """Name of its class in the beware list."""
    class_id: int
    """Id of its class in the beware list."""
    place: Position
    """Position (x, y) in metres of the map frame."""
    confidence: float
    """Confidence in its best view, 0 to 1."""
    looks: int
    """Number of frames in which it was detected."""
    first_s: float
    """Time of the first detection by the robot's clock, seconds."""
    last_s: float
    """Time of the last detection by the robot's clock, seconds."""
    verdict: Verdict | None = None
    """Correction by the operator: of another class or of none for the next training, or rejected on
    the map; null for none."""
    has_image: bool = True
    """Whether its whole image is kept, as a correction for the next training needs it."""


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class LabellingState:
    """State of the folder of images for the next training."""

    folder: str
    """Path of the folder."""
    pictures: int
    """Number of images in the folder."""
    bytes_used: int
    """Size of these images in bytes."""
    max_pictures: int
    """Largest number of images; further ones are refused."""
    max_bytes: int
    """Largest size of all images in bytes; further ones are refused."""


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
        """Return its present size and limits; raises `StorageFailed` if it cannot be read."""


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
