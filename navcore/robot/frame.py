"""Sensor frame: a registered RGB-D image with the odometry of its capture."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.compiled import compiled
from navcore.errors import BadFrame
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import IDENTITY, Matrix, Pose2, Twist, tilt_matrix
from navcore.robot.fix import PositionFix, check_fix
from navcore.robot.laser_scan import LaserScan, check_scan

BLIND_SHARE = 0.98
"""Largest share of missing depth in a valid image; above, the lens is covered or the projector
off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Image of the depth camera with registered colour, and the odometry of its capture."""

    stamp_ns: int
    """Capture time in nanoseconds of the robot's monotonic clock."""
    rgb: npt.NDArray[np.uint8]
    """(H, W, 3) colours in RGB order."""
    depth_m: npt.NDArray[np.float32]
    """(H, W) distance along the optical axis in metres; 0 for no measurement."""
    intrinsics: Intrinsics
    """Intrinsics of the depth camera, to which colour is registered."""
    T_base_camera: Matrix
    """(4, 4) mount of the camera, optical frame."""
    pose: Pose2
    """Pose of the robot at the time of capture: T_odom_base by odometry as the robot delivers it,
    T_map_base once the frame is `placed`."""
    twist: Twist
    """Velocity by odometry at the time of capture."""
    roll_rad: float = 0.0
    """Rotation of the body about its x axis in radians, positive with the left side up; of gravity,
    by the accelerometer. 0 where it is not measured."""
    pitch_rad: float = 0.0
    """Rotation of the body about its y axis in radians, positive with the front down (REP 103); of
    gravity, by the accelerometer. 0 where it is not measured."""
    uncoloured: npt.NDArray[np.bool_] | None = None
    """(H, W) pixels whose colour is not known, and black, because the colour lens does not see what
    they show: no label of them counts. None where all colours are known."""
    fixes: tuple[PositionFix, ...] = ()
    """Absolute positions measured in the last second, in order of time: a reader that skips frames
    misses none, and the stamps tell which are new. In the map's frame, even before the frame is
    placed."""
    scan: LaserScan | None = None
    """Newest laser scan; None of a robot without a scanner."""

    def placed(self, T_map_odom: Pose2) -> Frame:
        """Return the frame with its pose in the map frame instead of odometry's; the same frame
        where the two are one."""
        if T_map_odom == IDENTITY:
            return self
        return dataclasses.replace(self, pose=T_map_odom @ self.pose)

    @property
    def T_map_camera(self) -> Matrix:
        """(4, 4) pose of the camera in the frame of `pose`, above the plane on which the robot
        stands: on a slope z is the height above the slope, as mapping needs it."""
        return self.pose.matrix() @ self.T_base_camera

    @property
    def T_level_base(self) -> Matrix:
        """(4, 4) tilt of the base: from the base frame to a frame with the same origin and heading
        whose z axis is vertical."""
        return tilt_matrix(self.roll_rad, self.pitch_rad)

    @property
    def plane_slope(self) -> npt.NDArray[np.float64]:
        """(2,) rise per metre along x and y of the base frame of the plane on which the robot
        stands."""
        upward = self.T_level_base[2]
        return np.asarray(upward[:2] / upward[2])

    @property
    def T_level_camera(self) -> Matrix:
        """(4, 4) pose of the camera in the frame with the origin and heading of the base and a
        vertical z axis: x and y are horizontal distances, z is no height above a slope."""
        return self.T_level_base @ self.T_base_camera

    def shows(self, points_map: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
        """Return (N,) whether (N, 3) points in metres of the map frame are within the image,
        occluded or not."""
        camera, lens = self.T_map_camera, self.intrinsics
        x, y, z = ((points_map - camera[:3, 3]) @ camera[:3, :3] * (lens.fx, lens.fy, 1.0)).T
        cols, rows = x + lens.cx * z, y + lens.cy * z
        return np.asarray(
            (z > 0)
            & (cols >= 0)
            & (cols <= (lens.width - 1) * z)
            & (rows >= 0)
            & (rows <= (lens.height - 1) * z)
        )


def check_frame(frame: Frame) -> None:
    """Raise `BadFrame` for a frame that must not enter the map, with the reason."""
    lens = frame.intrinsics
    if not all(map(math.isfinite, lens.pinhole)) or min(lens.fx, lens.fy) <= 0:
        raise BadFrame(
            f"intrinsics {lens} are invalid: fx and fy must be positive, all four finite"
        )
    height, width = frame.intrinsics.height, frame.intrinsics.width
    if frame.depth_m.shape != (height, width):
        raise BadFrame(
            f"depth has shape {frame.depth_m.shape}, expected {(height, width)} as its "
            "intrinsics say"
        )
    if frame.rgb.shape != (height, width, 3) or frame.rgb.dtype != np.uint8:
        raise BadFrame(
            f"rgb is {frame.rgb.dtype} {frame.rgb.shape}, expected uint8 {(height, width, 3)}"
        )
    if frame.uncoloured is not None and frame.uncoloured.shape != (height, width):
        raise BadFrame(f"uncoloured has shape {frame.uncoloured.shape}, expected {(height, width)}")
    if frame.depth_m.dtype != np.float32:
        raise BadFrame(f"depth is {frame.depth_m.dtype}, expected float32 metres")
    measured, valid = _count_depths(frame.depth_m)
    if valid < frame.depth_m.size:
        raise BadFrame(_what_is_invalid(frame.depth_m))
    missing = 1.0 - measured / frame.depth_m.size
    if missing > BLIND_SHARE:
        raise BadFrame(
            f"depth is missing in {missing:.0%} of the image, expected at most {BLIND_SHARE:.0%}"
        )
    numbers = (
        frame.pose.x_m,
        frame.pose.y_m,
        frame.pose.yaw_rad,
        frame.twist.v_mps,
        frame.twist.w_radps,
    )
    if not all(map(math.isfinite, numbers)) or not np.isfinite(frame.T_base_camera).all():
        raise BadFrame(f"pose, velocity or camera mount is not finite: {numbers}")
    if not max(abs(frame.roll_rad), abs(frame.pitch_rad)) < math.pi / 2:
        raise BadFrame(
            f"roll {frame.roll_rad:g} or pitch {frame.pitch_rad:g} rad, expected within ±π/2"
        )
    for fix in frame.fixes:
        check_fix(fix)
    if frame.scan is not None:
        check_scan(frame.scan)


@compiled
def _count_depths(depth_m: npt.NDArray[np.float32]) -> tuple[int, int]:
    """Return the numbers of pixels that are positive, and of those that are finite and not
    negative; sums of comparisons by rows, which the compiler vectorises."""
    measured, valid = 0, 0
    for i in range(depth_m.shape[0]):
        row_measured, row_valid = np.int32(0), np.int32(0)
        for j in range(depth_m.shape[1]):
            depth = depth_m[i, j]
            row_measured += np.int32(depth > np.float32(0))
            row_valid += np.int32((depth >= np.float32(0)) & (depth < np.float32(np.inf)))
        measured, valid = measured + int(row_measured), valid + int(row_valid)
    return measured, valid


def _what_is_invalid(depth_m: npt.NDArray[np.float32]) -> str:
    not_finite = int((~np.isfinite(depth_m)).sum())
    if not_finite:
        return f"depth holds {not_finite} non-finite values, expected metres or 0"
    return f"depth has negative values, minimum {depth_m.min():g} m, expected metres or 0"
