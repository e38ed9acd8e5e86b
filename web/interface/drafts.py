"""Requests of an operator that are not yet applied: drafts of zones and goals, previews of their
effect, and saved missions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypedDict

import numpy as np
import numpy.typing as npt

from navcore.mission.mission import Goal
from navcore.mission.zone import ZoneSpec
from navcore.planning.path import NoPath, Path
from web.interface.wire import Position, served


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneDraft(ZoneSpec):
    """Zone as an operator gives it, not yet checked; `drawn` is dropped if the polygon is not that
    of the shape."""

    expires_in_s: float | None = None
    """Time from now until the zone is disabled, seconds by the robot's clock; takes precedence over
    `expires_at_s`."""


class NumberedEdit(Protocol):
    """One step of an editor."""

    @property
    def text(self) -> str:
        """Its description."""
        ...

    @property
    def number(self) -> int:
        """Its number among all edits."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class EditHistory:
    """Edits that can be undone and redone."""

    undo: str | None
    """Description of the edit that undo would take back; None without one."""
    redo: str | None
    """Description of the edit that redo would repeat; None without one."""
    undo_number: int = field(default=0, compare=False)
    """Number of the edit that undo would take back, in the order of all edits of the operators
    since the start of the console; 0 without one, and for one from before the start."""
    redo_number: int = field(default=0, compare=False)
    """Number of the edit that redo would repeat; 0 without one."""

    @classmethod
    def of(cls, done: Sequence[NumberedEdit], undone: Sequence[NumberedEdit]) -> EditHistory:
        """Return what comes next, of the edits that were done and undone, newest last."""
        undo, redo = done[-1] if done else None, undone[-1] if undone else None
        return cls(
            undo=undo.text if undo else None,
            redo=redo.text if redo else None,
            undo_number=undo.number if undo else 0,
            redo_number=redo.number if redo else 0,
        )


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class RejectedPlace:
    """Place at which an operator said that a detection is not one of its class."""

    id: int
    """Number of the rejection since the start of the console."""
    class_id: int
    """Id of the class that is not there."""
    class_name: str
    """Its name in the beware list."""
    place: Position
    """Position (x, y) in metres of the map frame."""
    confidence: float
    """Highest confidence of the looks that were rejected; it takes more to count there."""


class GoalChanges(TypedDict, total=False):
    """Changed fields of a waiting goal."""

    x_m: float
    """x in metres of the map frame."""
    y_m: float
    """y in metres of the map frame."""
    yaw_rad: float | None
    """Heading at the goal in radians of the map frame; None for any."""
    name: str
    """Name given by the operator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedMission:
    """Goals saved under a name."""

    goals: tuple[Goal, ...]
    """Goals in order; their ids have no meaning."""
    loop: bool
    """Whether reached goals are queued again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewDraft:
    """Goal, zone or setting to preview without applying it."""

    goal: tuple[float, float] | None = None
    """Goal (x, y) in metres of the map frame; None for the present goal."""
    start: tuple[float, float] | None = None
    """Start (x, y) in metres of the map frame; None for the robot's position."""
    zone: ZoneDraft | None = None
    """Zone to add; None to add none."""
    replaces: str | None = None
    """Id of the stored zone that is left out, because `zone` replaces it or it is to be deleted;
    None for none."""
    unknown_price: float | None = None
    """Cost of a metre of unseen floor in metres of seen floor; None for the one in force."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathPreview:
    """Path that would be driven."""

    outcome: Path | NoPath
    """Path, or the reason why there would be none."""
    points: npt.NDArray[np.float64]
    """(N, 2) path in metres of the map frame; (0, 2) without one."""
    length_m: float | None
    """Length of the path in metres; None without one."""
    time_s: float | None
    """Estimated travel time in seconds; None without a path."""
    unseen_m: float | None = None
    """Length of the path over floor that was not seen yet, metres; None without a path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Preview:
    """Effect of a draft; nothing is applied."""

    path: PathPreview
    """Path with the draft."""
    present: PathPreview | None
    """Path without the draft: between the same positions under the stored zones and the settings in
    force, or to the present goal for a draft without a zone. None without a goal."""
    cut_by: tuple[str, ...] = ()
    """Names of the zones that cut the goal off; empty if none does."""
