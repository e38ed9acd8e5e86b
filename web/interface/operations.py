"""Port of the console to the robot. `app` implements it.

Every method may be called from any thread. What moves or stops the robot posts a request, and what
reads its state an immutable snapshot: both return at once. An edit returns when it is on the disk,
a preview when it is planned, a change of site when the map that is left is on the disk.

Refusals are exceptions of `navcore.errors`: `BadGeometry` (422), `BadConfiguration` (422),
`NotKnown` (404), `Outdated` (409), `Refused` (409), `StorageFailed` (503). A refusal changes
nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Literal, Protocol

from navcore.geometry.transform import Pose2, Twist
from navcore.mapping.points.erasing import Erasable
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from navcore.robot.profile import RobotProfile
from web.interface.beware import OPERATOR, BewareEdits, ListPreview
from web.interface.drafts import (
    EditHistory,
    GoalChanges,
    Preview,
    PreviewDraft,
    RejectedPlace,
    SavedMission,
    ZoneDraft,
)
from web.interface.insight import Diagnostics
from web.interface.localisation import PlaceEdits
from web.interface.sites import Sites
from web.interface.snapshots import Cloud, State, TickSnapshot
from web.interface.teaching import Teaching

Existing = Literal["ask", "replace", "keep", "skip"]
"""What happens to an imported zone with the outline of a stored one: a refusal that names them, the
stored one gets its properties, both are kept, or it is left out."""
MissionAction = Literal["start", "pause", "resume", "cancel", "leave"]


class GoalList(Protocol):
    """Waiting goals and saved missions."""

    def add(self, x_m: float, y_m: float, *, yaw_rad: float | None = None, name: str = "") -> Goal:
        """Queue a goal, with a heading or for any; refused where the map cannot grow to, and inside
        a known obstacle or a zone (`BlockedGoal`, which may name the nearest free position)."""

    def change(self, goal_id: int, changes: GoalChanges) -> Goal:
        """Change `x_m`, `y_m`, `yaw_rad` (None for any heading) or `name` of a waiting goal."""

    def order(self, ids: Sequence[int]) -> None:
        """Change the order of the waiting goals."""

    def loop(self, loop: bool) -> None:
        """Set whether reached goals are queued again."""

    def remove(self, goal_id: int) -> None:
        """Remove a goal from the queue."""

    def missions(self) -> Mapping[str, SavedMission]:
        """Return the saved missions by name."""

    def save(self, name: str, *, replace: bool = True) -> None:
        """Save the waiting goals under a name; `AlreadyThere` for the name of a saved mission
        unless it is to be replaced."""

    def load(self, name: str) -> None:
        """Replace the waiting goals by those of a saved mission; refused while driving."""

    def forget(self, name: str) -> None:
        """Delete a saved mission."""


class ZoneEdits(Protocol):
    """Stored zones, their history, and named sets. An edit applies from the next tick on."""

    @property
    def stored(self) -> tuple[Zone, ...]:
        """All zones, in the order in which they were first stored."""

    @property
    def history(self) -> EditHistory:
        """Edits that can be undone and redone."""

    def add(self, draft: ZoneDraft) -> Zone:
        """Store a zone."""

    def add_all(self, drafts: Sequence[ZoneDraft], existing: Existing = "keep") -> tuple[Zone, ...]:
        """Store many zones as one edit, all or nothing, and return them. `existing` says what
        happens to those with the outline of a stored zone; "ask" raises `AlreadyThere`."""

    def replace(
        self, zone_id: str, draft: ZoneDraft, *, expected_version: int | None = None
    ) -> Zone:
        """Change a zone; `Outdated` when its version is not the expected one."""

    def delete(self, zone_id: str, *, expected_version: int | None = None) -> None:
        """Delete a zone."""

    def undo(self, *, by: str = OPERATOR) -> str:
        """Undo the newest edit and return its description."""

    def redo(self, *, by: str = OPERATOR) -> str:
        """Repeat the edit that was undone last and return its description."""

    def sets(self) -> Mapping[str, tuple[Zone, ...]]:
        """Return the named sets of zones."""

    def save_set(self, name: str, *, replace: bool = True) -> None:
        """Save the present zones under a name; `AlreadyThere` for the name of a set unless it is to
        be replaced."""

    def use_set(self, name: str) -> None:
        """Replace the present zones by those of a set, as one edit."""

    def delete_set(self, name: str) -> None:
        """Delete a set; the present zones stay."""


class MapEdits(Protocol):
    """Edits of the map and their history. An edit is done before the next tick, and the event log
    says what it has changed; `by` names the user in it."""

    @property
    def history(self) -> EditHistory:
        """Edits that can be undone and redone."""

    def erase(self, corners: tuple[tuple[float, float], ...], what: Erasable, *, by: str) -> None:
        """Erase what is in a polygon of (x, y) in metres; what the camera sees there later comes
        back. Raises `BadGeometry` with what is wrong with the polygon."""

    @property
    def rejected(self) -> tuple[RejectedPlace, ...]:
        """Where detections were rejected, oldest first."""

    def reject(self, sighting_id: int, *, all_of_class: bool, by: str) -> None:
        """Free what a detection, or every present one of its class, occupies on the map, and
        remember that it takes better evidence there; raises `NotKnown`."""

    def reject_at(
        self, class_id: int, at: tuple[float, float], *, all_of_class: bool, by: str
    ) -> None:
        """Do the same with what the map holds of a class at a place, or anywhere; raises `Refused`
        where there is nothing of it."""

    def forget(self, rejection_id: int, *, by: str) -> None:
        """Forget a rejection: its class counts there as everywhere; raises `NotKnown`."""

    def undo(self, *, by: str) -> str:
        """Undo the newest edit and return its description."""

    def redo(self, *, by: str) -> str:
        """Repeat the edit that was undone last and return its description."""


class PathSettings(Protocol):
    """Settings of the path, kept with the site; a change applies from the next tick on."""

    @property
    def unknown_price(self) -> float:
        """Cost of a metre of path over unseen floor, in metres of seen floor."""

    def set_unknown_price(self, price: float) -> None:
        """Set the cost of a metre of unseen floor in metres of seen floor."""


class AllEdits(Protocol):
    """Edits of zones, beware list, map and path settings together, in the order in which they were
    made since the start of the console."""

    @property
    def history(self) -> EditHistory:
        """The newest edit, and the one that was undone last, whichever they are of."""

    def undo(self, *, by: str, number: int | None = None) -> str:
        """Undo the newest edit and return its description; `Refused` without one, and when it is
        not the one with the `number`, if that is given."""

    def redo(self, *, by: str) -> str:
        """Repeat the edit that was undone last and return its description."""


class RobotService(Protocol):
    """Robot as seen from the console."""

    @property
    def profile(self) -> RobotProfile:
        """Profile of the platform."""

    @property
    def robot_urdf(self) -> FilePath | None:
        """URDF file of the robot for the 3D view; None without one (a box is drawn)."""

    @property
    def goals(self) -> GoalList:
        """Goals and saved missions."""

    @property
    def zones(self) -> ZoneEdits:
        """Keep-out and speed-limit zones."""

    @property
    def beware(self) -> BewareEdits:
        """Objects that must not be touched."""

    @property
    def map_edits(self) -> MapEdits:
        """What the operator erases from the map."""

    @property
    def path_settings(self) -> PathSettings:
        """Settings of the path."""

    @property
    def edits(self) -> AllEdits:
        """One undo for zones, beware list, map and path settings."""

    @property
    def place(self) -> PlaceEdits:
        """Where the robot is in the map."""

    @property
    def sites(self) -> Sites:
        """Sites: named places with their maps, zones and missions."""

    @property
    def insight(self) -> Diagnostics:
        """Explanations, detections and measurements."""

    @property
    def teaching(self) -> Teaching:
        """Frames, training and networks by which the operator teaches a class."""

    def state(self) -> State:
        """Return the newest snapshot."""

    def newest_tick(self) -> TickSnapshot | None:
        """Return the values of the newest tick; None before the first."""

    def cloud(self) -> Cloud | None:
        """Return the points of the map, copied at most once a second; None before the first
        tick."""

    def mission(self, action: MissionAction) -> None:
        """Start, pause, resume or cancel the mission, or leave the beware area that the robot is
        in."""

    def drive(self, twist: Twist | None) -> None:
        """Drive by hand: a velocity for at most 0.25 s, through the safety gate; None ends it. A
        driving mission is paused."""

    def back_off(self) -> None:
        """Drive half a metre straight back, through the safety gate; a driving mission goes on
        afterwards."""

    def stop(self, source: str) -> None:
        """Latch the emergency stop; `source` names its origin, such as `console button`."""

    def reset_stop(self, stops: int | None = None) -> None:
        """Release the emergency stop; the mission stays paused until it is started or resumed.
        `stops`: number of stops that the operator has seen; raises `Refused` after a newer one."""

    def preview(self, draft: PreviewDraft) -> Preview:
        """Plan the path with and without a draft; nothing is applied."""

    def preview_list(self, beware: BewareList) -> ListPreview:
        """Compare another beware list with the one in force: cells, path and goals that would be
        cut off; nothing is applied."""

    def poses(self) -> tuple[Pose2, ...]:
        """Return T_map_base by pose id, the poses from which the map was observed."""

    def correct_poses(self, poses: Mapping[int, Pose2]) -> None:
        """Correct past poses, for example after a loop closure; the points observed from them, and
        the zones and goals that were drawn beside them, move along before the next tick."""

    def runs(self) -> tuple[Mapping[str, object], ...]:
        """Return the reports of past missions, newest first, without their time series."""

    def run(self, run_id: str) -> Mapping[str, object]:
        """Return the whole report of one mission; raises `NotKnown`."""
