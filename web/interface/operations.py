"""What the console needs of the system behind it. `app` satisfies this port; `web` imports nothing
else of the project's composition. Every method returns at once: it posts an intent or reads an
immutable snapshot, and may be called from any thread.

Refusals are exceptions of `navcore.errors`: `BadGeometry` (422), `BadConfiguration` (422),
`NotKnown` (404), `Outdated` (409), `Refused` (409), `StorageFailed` (503). What is refused changes
nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Literal, Protocol

from navcore.geometry.transform import Pose2, Twist
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from navcore.perception.labels import LabelSource
from navcore.robot.profile import RobotProfile
from web.interface.drafts import (
    GoalChanges,
    Preview,
    PreviewDraft,
    SavedMission,
    ZoneDraft,
    ZoneHistory,
)
from web.interface.insight import Diagnostics
from web.interface.snapshots import Cloud, State, TickSnapshot

MissionAction = Literal["start", "pause", "resume", "cancel", "leave"]


class GoalList(Protocol):
    """The goals that wait, and goals kept under a name."""

    def add(self, x_m: float, y_m: float, *, yaw_rad: float | None = None, name: str = "") -> Goal:
        """Queue a goal, perhaps with a heading to stand in. Refused outside the map, and inside an
        obstacle or zone that is known already (`BlockedGoal`, which names the nearest place where
        the robot could stand).
        """

    def change(self, goal_id: int, changes: GoalChanges) -> Goal:
        """Change `x_m`, `y_m`, `yaw_rad` (None for any heading) or `name` of a waiting goal."""

    def order(self, ids: Sequence[int]) -> None:
        """Drive to the waiting goals in this order."""

    def loop(self, loop: bool) -> None:
        """Whether goals that are reached wait again."""

    def remove(self, goal_id: int) -> None:
        """Take a goal out of the queue."""

    def missions(self) -> Mapping[str, SavedMission]:
        """Goals kept under a name."""

    def save(self, name: str) -> None:
        """Keep the waiting goals under a name, in the place of what had it before."""

    def load(self, name: str) -> None:
        """Put the goals of a kept mission in the place of those that wait; refused while driving."""

    def forget(self, name: str) -> None:
        """Forget a kept mission."""


class ZoneEdits(Protocol):
    """The stored zones, what can be undone of them, and sets of them by name. An edit binds the
    robot from the next tick on."""

    @property
    def stored(self) -> tuple[Zone, ...]:
        """All of them, in the order they were first stored."""

    @property
    def history(self) -> ZoneHistory:
        """What undo and redo would do now."""

    def add(self, draft: ZoneDraft) -> Zone:
        """Store a zone."""

    def add_all(self, drafts: Sequence[ZoneDraft]) -> tuple[Zone, ...]:
        """Store many zones as one edit, all or nothing."""

    def replace(
        self, zone_id: str, draft: ZoneDraft, *, expected_version: int | None = None
    ) -> Zone:
        """Change a zone; `Outdated` when its version is not the expected one."""

    def delete(self, zone_id: str, *, expected_version: int | None = None) -> None:
        """Forget a zone."""

    def undo(self) -> str:
        """Take the newest edit back; what it was."""

    def redo(self) -> str:
        """Do again what was taken back last; what it was."""

    def sets(self) -> Mapping[str, tuple[Zone, ...]]:
        """Zones kept under a name."""

    def save_set(self, name: str) -> None:
        """Keep the present zones under a name."""

    def use_set(self, name: str) -> None:
        """Let a set's zones bind the robot in the place of the present ones, as one edit."""

    def delete_set(self, name: str) -> None:
        """Forget a set; the present zones stay."""


class BewareEdits(Protocol):
    """The beware list."""

    @property
    def list(self) -> BewareList:
        """The list in force."""

    @property
    def can_undo(self) -> bool:
        """Whether an earlier list is known."""

    def finder(self, entry: BewareClass) -> LabelSource:
        """What finds an entry of the list in the pictures; perhaps nothing."""

    def edit(
        self, name: str, changes: Mapping[str, object], *, expected_version: int | None = None
    ) -> BewareList:
        """Change fields of one class, e.g. `enabled`, `margin_m`, `min_confidence`, `colour` (a
        table); None takes an optional one away. `Outdated` when the list's version is not the
        expected one.
        """

    def replace(self, beware: BewareList, *, expected_version: int | None = None) -> BewareList:
        """Put another list in force; it gets the next version."""

    def restore_defaults(self) -> BewareList:
        """Put the shipped list in force; it gets the next version."""

    def undo(self) -> BewareList:
        """Put the list before the newest edit in force, as the next version; `Refused` when there
        is none."""


class RobotService(Protocol):
    """The system as seen from the console."""

    @property
    def profile(self) -> RobotProfile:
        """The platform's body."""

    @property
    def robot_urdf(self) -> FilePath | None:
        """A URDF of the robot for the 3D view; None when there is none (a box is drawn)."""

    @property
    def goals(self) -> GoalList:
        """Where to drive."""

    @property
    def zones(self) -> ZoneEdits:
        """Where not to, or only slowly."""

    @property
    def beware(self) -> BewareEdits:
        """What not to touch."""

    @property
    def insight(self) -> Diagnostics:
        """Why the robot does what it does, and what it has recognised."""

    def state(self) -> State:
        """The newest snapshot."""

    def picture(self) -> TickSnapshot | None:
        """The newest tick's values; None before the first."""

    def cloud(self) -> Cloud | None:
        """The map's points, copied at most about once a second; None before the first."""

    def mission(self, action: MissionAction) -> None:
        """Start, pause, resume or cancel; or leave the beware area that the robot stands in."""

    def drive(self, twist: Twist | None) -> None:
        """By hand: this velocity for 0.25 s at most, through the safety gate; None lets go. A
        driving mission is paused."""

    def stop(self, source: str) -> None:
        """Latched emergency stop; `source` says who, e.g. `console button`, `REST`."""

    def reset_stop(self) -> None:
        """Release the latched stop; the mission stays paused until it is started or resumed again."""

    def preview(self, draft: PreviewDraft) -> Preview:
        """What the path would be under a draft beside what it is; applies nothing."""

    def poses(self) -> tuple[Pose2, ...]:
        """T_map_base by pose ID: the places from which the map's points were seen."""

    def correct_poses(self, poses: Mapping[int, Pose2]) -> None:
        """Put past poses right, e.g. after a loop closure: what was seen from them moves along,
        before the next tick."""

    def runs(self) -> tuple[Mapping[str, object], ...]:
        """Reports of past missions, newest first, without their series."""

    def run(self, run_id: str) -> Mapping[str, object]:
        """One mission's whole report."""
