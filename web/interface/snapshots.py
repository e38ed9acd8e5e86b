"""Snapshots of the running system for the console: the small state, and the large values of the
newest tick."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import PlainSerializer

from navcore.costmap.costmap import Costmap
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix, Pose2, Twist
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.mission.mission import Goal, Phase
from navcore.mission.zone import Zone
from navcore.perception.people.track import Track
from navcore.planning.unseen_parts import Parts, unseen_m
from navcore.safety.gate import Cause, StopReason
from web.interface.localisation import PlaceOut
from web.interface.wire import served


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class ReasonOut:
    """Reason why the robot does not move."""

    code: Cause
    """Stable word for programs."""
    text: str
    """Sentence for the operator."""
    offer: Literal["back-off"] | None = None
    """Action below `mission/` that may help; null for none."""


def _reason_out(reason: StopReason) -> ReasonOut:
    offer: Literal["back-off"] | None = "back-off" if reason.cause is Cause.BOXED_IN else None
    return ReasonOut(code=reason.cause, text=reason.text, offer=offer)


@served
@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Small values of the system, one consistent snapshot; sent as they are."""

    type: Literal["state"] = "state"
    """Kind of the message."""
    stamp_s: float
    """Time of the snapshot by the robot's monotonic clock, seconds."""
    scenario: str
    """Name of the world, or of a real robot."""
    site: str = "default"
    """Name of the site in use."""
    site_id: str = ""
    """Its id: requests that are meant for its map name it in the header `Site-Id`."""
    robot: str
    """Name of the platform."""
    phase: Phase
    """State of the mission as the operator asked for it."""
    moving: bool
    """Whether a command other than zero is being sent."""
    summary: str
    """Sentence on the present motion, or on the reason of the standstill."""
    stop_latched: bool
    """Whether an emergency stop holds, or odometry or the camera's clock is not trusted, until a
    reset."""
    stop_pressed: bool = False
    """Whether an emergency stop holds."""
    stops: int = 0
    """Number of emergency stops since the start of the console, also of those while one held."""
    stop_warning: str | None = None
    """Why the stop, or its reset, would not hold over a restart; null while it would."""
    storage_warning: str | None = None
    """What else cannot be stored, and why; null while all is."""
    reasons: tuple[Annotated[StopReason, PlainSerializer(_reason_out, return_type=ReasonOut)], ...]
    """Reasons why the robot stands during a mission, the worst first; empty when nothing holds
    it."""
    pose: Pose2
    """T_map_base as the robot estimates it."""
    place: PlaceOut = field(default_factory=PlaceOut)
    """How well the robot knows its pose."""
    twist: Twist
    """Velocity by odometry."""
    command: Twist
    """Velocity that was last sent to the wheels."""
    queue: tuple[Goal, ...]
    """Goals to reach, the present one first."""
    reached: tuple[Goal, ...]
    """Last reached goals, oldest first; at most 20."""
    reached_count: int = 0
    """Number of reached goals of the mission."""
    distance_to_goal_m: float | None
    """Remaining length of the planned path in metres; null without a path."""
    travelled_m: float
    """Distance driven since the start, metres."""
    unseen_m: float | None = None
    """Length of the planned path over floor that was not seen yet, metres; null without a path."""
    unknown_price: float = 1.0
    """Cost of a metre of path over floor that was not seen yet, in metres of seen floor."""
    explored_m2: float
    """Area of the floor on the map that was seen, also before the start, square metres."""
    replans: int
    """Number of paths planned since the start."""
    images: int = 0
    """Number of images that were processed since the start."""
    tick_ms: float
    """Duration of the last tick of the navigator, milliseconds."""
    frame_age_s: float | None
    """Age in seconds of the camera frame by which the motion was decided; null before the first.
    Between two ticks it is one whose labels are not made yet."""
    map_age_s: float | None = None
    """Age in seconds of the newest camera frame on the map, with its labels; null before the
    first."""
    zones_version: int
    """Number of changes of the zones."""
    beware_version: int
    """Version of the beware list."""
    beware_enabled: int
    """Number of enabled classes of the beware list; at 0 only geometric obstacles and zones keep
    the robot away."""
    by_hand: bool = False
    """Whether an operator drives the robot by hand."""
    backs_off: bool = False
    """Whether the robot backs off on its own, as it was told to."""
    in_zone: bool = False
    """Whether the robot is in an area that it must not be in; the action `leave` gets it out."""
    segmenter: str
    """Description of what labels the images, for example `network r18-nbt1d × 0.5, onnxruntime f32,
    416 × 256` or `colour rules`."""
    segmenter_warning: str | None
    """Reason why the segmenter is not the configured one; null when it is."""
    loop: bool = False
    """Whether reached goals are queued again."""
    goes_on: bool = False
    """Whether the paused mission goes on by itself, once the robot has backed off."""
    picture_serial: int | None = None
    """Serial number of the newest tick, which `path` and `camera.jpg` show; null before the
    first."""
    grid_version: int | None = None
    """Version of the map in the newest tick, which `map.png` shows; null before the first."""
    grid_spec: GridSpec | None = None
    """Position and size of the map in the newest tick, which grows with robot and goals; null
    before the first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TickSnapshot:
    """Large values of the newest tick; all arrays are read-only."""

    serial: int
    """Serial number; grows with every tick."""
    pose: Pose2
    """T_map_base at the time of the frame."""
    T_map_camera: Matrix
    """(4, 4) pose of the camera's optical frame in the map frame."""
    intrinsics: Intrinsics
    """Intrinsics of the camera."""
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3) colour image of the camera."""
    labels: npt.NDArray[np.uint8]
    """(H, W) class id of the beware list per pixel, 0 for nothing."""
    confidence: npt.NDArray[np.float32]
    """(H, W) confidence of the labels, 0 to 1."""
    occupancy: Costmap
    """Occupied and blocked cells, packed."""
    seen_mask: CellMask
    """Observed cells, packed."""
    grid_version: int
    """Version of `occupancy` and `seen_mask`."""
    path: npt.NDArray[np.float64]
    """(N, 2) planned path in metres of the map frame; (0, 2) without one."""
    waypoints: npt.NDArray[np.float64]
    """(M, 2) corners and end of the path in metres of the map frame."""
    unseen: Parts = ()
    """(first, last) points of each part of `path` over floor that was not seen yet."""
    driven: npt.NDArray[np.float64]
    """(K, 2) past positions of the robot in metres of the map frame."""
    people: tuple[Track, ...] = ()
    """Tracked people."""
    closed: tuple[Zone, ...] = ()
    """Areas that the robot keeps out of for a while by its own decision; the names say why."""
    depth_m: npt.NDArray[np.float32] | None = None
    """(H, W) distance along the optical axis in metres, 0 for no measurement; None when not
    kept."""
    prior: CellMask | None = None
    """Cells that are occupied on a prior map and were not seen free; None without a prior map."""

    @property
    def unseen_m(self) -> float | None:
        """Length in metres of `path` over floor that was not seen yet; None without a path."""
        return unseen_m(self.path, self.unseen) if len(self.path) else None

    @property
    def grid_spec(self) -> GridSpec:
        """Position and resolution of the grid, without unpacking it."""
        return self.occupancy.spec

    @property
    def grid(self) -> OccupancyGrid:
        """Occupied cells by layer."""
        return self.occupancy.grid

    @property
    def blocked(self) -> npt.NDArray[np.bool_]:
        """(rows, cols) cells that the robot's centre must not enter."""
        return self.occupancy.blocked

    @property
    def seen(self) -> npt.NDArray[np.bool_]:
        """(rows, cols) observed cells; the others are unknown and count as free."""
        return self.seen_mask.bools


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cloud:
    """Points of the map."""

    serial: int
    """Version of the points."""
    points_map: npt.NDArray[np.float32]
    """(N, 3) points in metres of the map frame."""
    rgb: npt.NDArray[np.uint8]
    """(N, 3) colours in the camera image."""
    class_ids: npt.NDArray[np.uint8]
    """(N,) class id of the beware list, 0 for a geometric obstacle."""
