"""What an operator gives, not yet applied: drafts of zones and goals, what they would lead to, and
what is kept of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np
import numpy.typing as npt

from navcore.mission.mission import Goal
from navcore.mission.zone import ZoneKind
from navcore.mission.zone_shapes import Shape
from navcore.planning.path import NoPath, Path


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneDraft:
    """A zone as an operator gives it, not yet checked."""

    name: str
    """What the operator calls it."""
    polygon: tuple[tuple[float, float], ...]
    """Corners (x, y) in metres of the map frame."""
    enabled: bool = True
    """Whether it binds the robot."""
    margin_m: float = 0.0
    """Room kept around it beyond the robot's own margin."""
    kind: ZoneKind = ZoneKind.KEEP_OUT
    """What it demands."""
    max_speed_mps: float | None = None
    """The limit, of a speed limit."""
    colour: str | None = None
    """`#rrggbb`; None for the console's own."""
    expires_at_s: float | None = None
    """When it is switched off, seconds since 1970 by the robot's calendar clock."""
    expires_in_s: float | None = None
    """The same from now on, by the robot's clock; one of the two at most."""
    drawn: Shape | None = None
    """What the polygon was made of; dropped where the polygon is another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneHistory:
    """What can be taken back."""

    undo: str | None
    """The edit that undo takes back, in words; None without one."""
    redo: str | None
    """The edit that redo does again."""


class GoalChanges(TypedDict, total=False):
    """The fields of a waiting goal that change."""

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
    """Goals that are kept under a name."""

    goals: tuple[Goal, ...]
    """In order; their ids mean nothing."""
    loop: bool
    """Whether they are driven again and again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewDraft:
    """What is to be tried without applying it."""

    goal: tuple[float, float] | None = None
    """Default: the present goal."""
    start: tuple[float, float] | None = None
    """Default: where the robot stands."""
    zone: ZoneDraft | None = None
    """A zone to be added …"""
    replaces: str | None = None
    """… in the place of the stored one with this id, whose outline then does not count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathPreview:
    """A path that would be driven."""

    outcome: Path | NoPath
    """The path, or why there would be none."""
    points: npt.NDArray[np.float64]
    """(N, 2) the path in metres of the map frame; (0, 2) without one."""
    length_m: float | None
    """Its length; None without one."""
    time_s: float | None
    """How long it would take, about; None without one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Preview:
    """What a draft would lead to; nothing is applied."""

    path: PathPreview
    """With the draft."""
    present: PathPreview | None
    """Without it: between the same places under the stored zones, or to the present goal where no
    zone is drafted."""
    cut_by: tuple[str, ...] = ()
    """Names of the zones that cut the goal off, where they do."""
