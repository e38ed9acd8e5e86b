"""What the console needs of the system behind it. `app` satisfies this port; `web` imports nothing else of the project's
composition. Every method returns at once: it posts an intent or reads an immutable snapshot, and may be called from any thread.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from navcore.beware import BewareClass, BewareList
from navcore.followed import Track
from navcore.frame import Intrinsics
from navcore.grid import GridSpec, OccupancyGrid
from navcore.mask import Mask
from navcore.mission import Goal, Phase
from navcore.occupancy import Occupancy
from navcore.path import NoPath, Path
from navcore.robot import RobotProfile, Twist
from navcore.segment import Finder
from navcore.transform import Matrix, Pose2
from navcore.zone_shapes import Shape
from navcore.zones import Zone, ZoneKind
from web.insight import Insight

MissionAction = Literal["start", "pause", "resume", "cancel", "leave"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StopReason:
    """One reason for which the robot does not move, or does not move as asked."""

    code: str
    """Stable word for programs, e.g. `emergency_stop`, `stale_frame`, `no_path`."""
    text: str
    """A sentence for the operator, with the figures that matter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Everything small that is shown or sent on: one consistent snapshot."""

    stamp_s: float
    """Robot's monotonic clock at the snapshot."""
    scenario: str
    """Name of the world, or of the robot when it is real."""
    robot: str
    """Platform name."""
    phase: Phase
    """What the operator has asked for."""
    moving: bool
    """Whether a command other than zero is being sent."""
    summary: str
    """One sentence: what the robot does now, or why it does not move."""
    stop_latched: bool
    """An emergency stop holds until it is reset."""
    reasons: tuple[StopReason, ...]
    """Why the robot stands although it was told to drive; the worst first. Empty when nothing holds it."""
    pose: Pose2
    """T_map_base by odometry."""
    twist: Twist
    """Velocity by odometry."""
    command: Twist
    """What was last sent to the wheels."""
    queue: tuple[Goal, ...]
    """Goals still to reach, the present one first."""
    reached: tuple[Goal, ...]
    """Goals reached."""
    distance_to_goal_m: float | None
    """Along the planned path; None without one."""
    travelled_m: float
    """Driven since start."""
    explored_m2: float
    """Floor seen since start."""
    replans: int
    """Paths planned since start."""
    tick_ms: float
    """Duration of the last tick of the navigator."""
    frame_age_s: float | None
    """Age of the newest camera frame; None before the first."""
    zones_version: int
    """Grows with every change of the zones."""
    beware_version: int
    """Version of the beware list."""
    by_hand: bool = False
    """Somebody drives it by hand."""
    in_zone: bool = False
    """The robot stands in an area that it must not be in; `leave` gets it out."""
    segmenter: str
    """What labels the pictures, e.g. `network r18-nbt1d × 0.5, onnxruntime f32, 416 × 256` or `colour rules`."""
    segmenter_warning: str | None
    """Why it is not what it should be, e.g. that the network does not run; None when it is."""
    loop: bool = False
    """Goals that are reached wait again."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """Everything large that is shown: the newest tick's values, arrays read-only."""

    serial: int
    """Grows with every new picture."""
    pose: Pose2
    """T_map_base when the frame was taken."""
    T_map_camera: Matrix
    """(4, 4) where the camera was, optical frame."""
    intrinsics: Intrinsics
    """Of the camera."""
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3) the camera's picture."""
    labels: npt.NDArray[np.uint8]
    """(H, W) class id of the beware list per pixel, 0 for nothing."""
    confidence: npt.NDArray[np.float32]
    """(H, W) how sure the segmenter is of them, 0 to 1."""
    occupancy: Occupancy
    """Occupied and blocked cells, packed."""
    seen_mask: Mask
    """Cells into which the camera has looked, packed."""
    grid_version: int
    """Changes whenever `occupancy` or `seen_mask` do."""
    path: npt.NDArray[np.float64]
    """(N, 2) planned path in metres of the map frame; (0, 2) without one."""
    waypoints: npt.NDArray[np.float64]
    """(M, 2) the path's corners and its end."""
    driven: npt.NDArray[np.float64]
    """(K, 2) where the robot has been."""
    people: tuple[Track, ...] = ()
    """Who walks or stands about, and how."""
    depth_m: npt.NDArray[np.float32] | None = None
    """(H, W) distance along the optical axis, 0 where nothing was measured; None where it is not kept."""
    prior: Mask | None = None
    """Cells that are occupied on a map from elsewhere and were not seen free; None without such a map."""

    @property
    def grid_spec(self) -> GridSpec:
        """Where the grid lies, without unpacking it."""
        return self.occupancy.spec

    @property
    def grid(self) -> OccupancyGrid:
        """Occupied cells by layer."""
        return self.occupancy.grid

    @property
    def blocked(self) -> npt.NDArray[np.bool_]:
        """(rows, cols) where the robot's centre may not be."""
        return self.occupancy.blocked

    @property
    def seen(self) -> npt.NDArray[np.bool_]:
        """(rows, cols) cells into which the camera has looked; the rest is unknown (and counts as free)."""
        return self.seen_mask.bools


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cloud:
    """The points of the map."""

    serial: int
    """Changes whenever the points do."""
    points_map: npt.NDArray[np.float32]
    """(N, 3) metres of the map frame."""
    rgb: npt.NDArray[np.uint8]
    """(N, 3) colours as the camera saw them."""
    class_ids: npt.NDArray[np.uint8]
    """(N,) class id of the beware list, 0 for a geometric obstacle."""


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
    """Without it: between the same places under the stored zones, or to the present goal where no zone is drafted."""
    cut_by: tuple[str, ...] = ()
    """Names of the zones that cut the goal off, where they do."""


class Operations(Protocol):
    """The system as seen from the console.

    Refusals are exceptions of `navcore.errors`: `BadGeometry` (422), `BadConfiguration` (422), `NotKnown` (404),
    `Outdated` (409), `Refused` (409), `StorageFailed` (503). What is refused changes nothing.
    """

    @property
    def profile(self) -> RobotProfile:
        """The platform's body."""

    @property
    def robot_urdf(self) -> FilePath | None:
        """A URDF of the robot for the 3D view; None when there is none (a box is drawn)."""

    @property
    def insight(self) -> Insight:
        """Why the robot does what it does, and what it has recognised."""

    def state(self) -> State:
        """The newest snapshot."""

    def picture(self) -> Picture | None:
        """The newest tick's values; None before the first."""

    def cloud(self) -> Cloud | None:
        """The map's points, copied at most about once a second; None before the first."""

    def add_goal(self, x_m: float, y_m: float, *, yaw_rad: float | None = None, name: str = "") -> Goal:
        """Queue a goal, perhaps with a heading to stand in. Refused outside the map, and inside an obstacle or zone that is
        known already (`BlockedGoal`, which names the nearest place where the robot could stand).
        """

    def change_goal(self, goal_id: int, changes: Mapping[str, object]) -> Goal:
        """Change `x_m`, `y_m`, `yaw_rad` (None for any heading) or `name` of a waiting goal."""

    def order_goals(self, ids: Sequence[int]) -> None:
        """Drive to the waiting goals in this order."""

    def loop_goals(self, loop: bool) -> None:
        """Whether goals that are reached wait again."""

    def missions(self) -> Mapping[str, SavedMission]:
        """Goals kept under a name."""

    def save_mission(self, name: str) -> None:
        """Keep the waiting goals under a name, in the place of what had it before."""

    def load_mission(self, name: str) -> None:
        """Put the goals of a kept mission in the place of those that wait; refused while driving."""

    def delete_mission(self, name: str) -> None:
        """Forget a kept mission."""

    def remove_goal(self, goal_id: int) -> None:
        """Take a goal out of the queue."""

    def mission(self, action: MissionAction) -> None:
        """Start, pause, resume or cancel; or leave the beware area that the robot stands in."""

    def drive(self, twist: Twist | None) -> None:
        """By hand: this velocity for 0.25 s at most, through the safety gate; None lets go. A driving mission is paused."""

    def stop(self, source: str) -> None:
        """Latched emergency stop; `source` says who, e.g. `console button`, `REST`."""

    def reset_stop(self) -> None:
        """Release the latched stop; the mission stays paused until it is started or resumed again."""

    def zones(self) -> tuple[Zone, ...]:
        """All stored zones."""

    def add_zone(self, draft: ZoneDraft) -> Zone:
        """Store a zone; it binds the robot from the next tick on."""

    def replace_zone(self, zone_id: str, draft: ZoneDraft, *, expected_version: int | None = None) -> Zone:
        """Change a zone; `Outdated` when its version is not the expected one."""

    def delete_zone(self, zone_id: str, *, expected_version: int | None = None) -> None:
        """Forget a zone."""

    def import_zones(self, drafts: Sequence[ZoneDraft]) -> tuple[Zone, ...]:
        """Store many zones as one edit, all or nothing."""

    def zone_history(self) -> ZoneHistory:
        """What undo and redo would do now."""

    def undo_zones(self) -> str:
        """Take the newest edit of the zones back; what it was."""

    def redo_zones(self) -> str:
        """Do again what was taken back last; what it was."""

    def zone_sets(self) -> Mapping[str, tuple[Zone, ...]]:
        """Zones kept under a name."""

    def save_zone_set(self, name: str) -> None:
        """Keep the present zones under a name."""

    def use_zone_set(self, name: str) -> None:
        """Let a set's zones bind the robot in the place of the present ones, as one edit."""

    def delete_zone_set(self, name: str) -> None:
        """Forget a set; the present zones stay."""

    def beware(self) -> BewareList:
        """The list in force."""

    def finder(self, entry: BewareClass) -> Finder:
        """What finds an entry of the list in the pictures; perhaps nothing."""

    def edit_beware(self, name: str, changes: Mapping[str, object], *, expected_version: int | None = None) -> BewareList:
        """Change fields of one class, e.g. `enabled`, `margin_m`, `min_confidence`, `colour` (a table); None takes an optional
        one away. `Outdated` when the list's version is not the expected one.
        """

    def replace_beware(self, beware: BewareList, *, expected_version: int | None = None) -> BewareList:
        """Put another list in force; it gets the next version."""

    def preview(self, draft: PreviewDraft) -> Preview:
        """What the path would be under a draft beside what it is; applies nothing."""

    def poses(self) -> tuple[Pose2, ...]:
        """T_map_base by pose ID: the places from which the map's points were seen."""

    def correct_poses(self, poses: Mapping[int, Pose2]) -> None:
        """Put past poses right, e.g. after a loop closure: what was seen from them moves along, before the next tick."""

    def runs(self) -> tuple[Mapping[str, object], ...]:
        """Reports of past missions, newest first, without their series."""

    def run(self, run_id: str) -> Mapping[str, object]:
        """One mission's whole report."""
