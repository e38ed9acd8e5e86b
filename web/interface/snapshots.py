"""What is shown of the running system: one small snapshot of its state, and the large values of the
newest tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.costmap.costmap import Costmap
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import Matrix, Pose2, Twist
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.mission.mission import Goal, Phase
from navcore.mission.zone import Zone
from navcore.perception.people.track import Track
from navcore.safety.gate import StopReason


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
    """Why the robot stands although it was told to drive; the worst first. Empty when nothing holds
    it."""
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
    beware_enabled: int
    """Number of enabled classes of the beware list; at 0 only geometric obstacles and zones keep
    the robot away."""
    by_hand: bool = False
    """Somebody drives it by hand."""
    in_zone: bool = False
    """The robot stands in an area that it must not be in; `leave` gets it out."""
    segmenter: str
    """What labels the pictures, e.g. `network r18-nbt1d × 0.5, onnxruntime f32, 416 × 256` or
    `colour rules`."""
    segmenter_warning: str | None
    """Why it is not what it should be, e.g. that the network does not run; None when it is."""
    loop: bool = False
    """Goals that are reached wait again."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TickSnapshot:
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
    occupancy: Costmap
    """Occupied and blocked cells, packed."""
    seen_mask: CellMask
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
    closed: tuple[Zone, ...] = ()
    """Where the robot keeps out for a while of its own accord, with the name of why."""
    depth_m: npt.NDArray[np.float32] | None = None
    """(H, W) distance along the optical axis, 0 where nothing was measured; None where it is not
    kept."""
    prior: CellMask | None = None
    """Cells that are occupied on a map from elsewhere and were not seen free; None without such a
    map."""

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
        """(rows, cols) cells into which the camera has looked; the rest is unknown (and counts as
        free)."""
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
