"""Robot profile: body, limits and sensors of a platform."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Matrix, Twist, camera_mount
from navcore.robot.camera_stream import CameraStream
from navcore.robot.laser_scan import ScannerMount
from navcore.toml_config import from_table, ranged, read_toml

HEADROOM_M = 0.2
"""Clearance in metres above a robot that what it passes under has to leave."""
_HIGHEST_M = 2.75
"""Largest height in metres that a measurement can have on the map."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraMount:
    """Mount of the camera in the robot's middle plane, facing ahead and down."""

    x_m: float = ranged(-5.0, 5.0)
    """Distance in metres ahead of the centre of the footprint."""
    z_m: float = ranged(0.05, 5.0)
    """Height in metres above the floor."""
    pitch_down_deg: float = ranged(-45.0, 89.0)
    """Pitch in degrees below the horizon."""

    @property
    def T_base_camera(self) -> Matrix:
        """(4, 4) pose of the optical frame in the base frame."""
        return camera_mount(
            x_m=self.x_m, y_m=0.0, z_m=self.z_m, pitch_down_rad=math.radians(self.pitch_down_deg)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthSensor:
    """Accuracy of the stereo depth camera; the defaults are those of an Intel RealSense D455."""

    baseline_m: float = ranged(0.005, 1.0, default=0.095)
    """Distance between the two imagers in metres."""
    disparity_error_px: float = ranged(0.001, 5.0, default=0.1)
    """Standard error of the disparity in pixels."""

    def depth_error_m(self, depth_m: float, fx: float) -> float:
        """Return the standard error in metres of a depth, for a focal length of `fx` pixels:
        z² · disparity error / (focal length · baseline)."""
        return depth_m * depth_m * self.disparity_error_px / (fx * self.baseline_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotProfile:
    """Body and limits of a platform; the origin of the base frame is the centre of the footprint on
    the floor."""

    name: str
    """Name of the platform, as in `robot` of reports."""
    length_m: float = ranged(0.05, 5.0)
    """Length in metres of the footprint, along x."""
    width_m: float = ranged(0.05, 5.0)
    """Width in metres of the footprint, along y; w_v of the paper's Algorithm 1."""
    max_speed_mps: float = ranged(0.05, 5.0)
    """Largest forward speed in metres per second."""
    max_yaw_rate_radps: float = ranged(0.05, 10.0)
    """Largest yaw rate in radians per second."""
    max_accel_mps2: float = ranged(0.05, 20.0)
    """Largest acceleration and deceleration in metres per second squared."""
    max_yaw_accel_radps2: float = ranged(0.05, 50.0)
    """Largest yaw acceleration in radians per second squared."""
    camera: CameraMount
    """Mount of the camera."""
    height_m: float = ranged(0.05, 2.5, default=1.3)
    """Height in metres of the highest point of the robot and its load."""
    max_slope: float = ranged(0.0, 1.0, default=0.2)
    """Largest slope that the robot drives on, rise per metre."""
    max_step_m: float = ranged(0.0, 0.5, default=0.06)
    """Largest step in metres that the robot drives over, up or down."""
    depth_sensor: DepthSensor = field(default_factory=DepthSensor)
    """Accuracy of the camera's depth."""
    stream: CameraStream = field(default_factory=CameraStream)
    """Size and rate of the camera's images."""
    scanner: ScannerMount | None = None
    """Laser scanner that sees all round; None without one."""

    @property
    def ceiling_m(self) -> float:
        """Height in metres above the ground from which something is above the robot and its
        sensors."""
        scanner_m = 0.0 if self.scanner is None else self.scanner.z_m
        top_m = max(self.height_m, self.camera.z_m, scanner_m)
        return min(top_m + HEADROOM_M, _HIGHEST_M)

    @property
    def circumscribed_radius_m(self) -> float:
        """Radius in metres of the circle that the footprint covers when it turns in place."""
        return float(np.hypot(self.length_m, self.width_m)) / 2

    def fastest_mps(self, twist: Twist) -> float:
        """Return an upper bound of the speed of every point of the body in metres per second."""
        return abs(twist.v_mps) + abs(twist.w_radps) * self.circumscribed_radius_m

    def footprint(self, padding_m: float = 0.0) -> npt.NDArray[np.float64]:
        """Return the (4, 2) corners in metres of the base frame, counter-clockwise, enlarged by
        `padding_m` on every side."""
        x, y = self.length_m / 2 + padding_m, self.width_m / 2 + padding_m
        return np.array([[x, y], [-x, y], [-x, -y], [x, -y]])

    def gap_m(self, x_m: float, y_m: float) -> float:
        """Return the distance in metres from the footprint to a point of the base frame, 0 under
        it."""
        ahead, beside = abs(x_m) - self.length_m / 2, abs(y_m) - self.width_m / 2
        return math.hypot(max(ahead, 0.0), max(beside, 0.0))

    def distances_m(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return (N,) distances in metres of (N, 2) points of the base frame from the footprint,
        negative under it."""
        beyond = np.abs(points) - (self.length_m / 2, self.width_m / 2)
        outside = np.hypot(*np.maximum(beyond, 0.0).T)
        return np.asarray(outside + np.minimum(beyond.max(axis=1, initial=-np.inf), 0.0))


ROBOTS = Path(__file__).parent / "profiles"
"""Folder with the profiles of the known platforms."""


def robot_names() -> tuple[str, ...]:
    """Return the names of the known platforms, sorted."""
    return tuple(sorted(path.stem for path in ROBOTS.glob("*.toml")))


def load_profile(name_or_path: str | Path) -> RobotProfile:
    """Return the profile of a known platform, or of a .toml file; raises `BadConfiguration` with
    the key."""
    path = Path(name_or_path)
    if path.suffix != ".toml":
        if name_or_path not in robot_names():
            known = ", ".join(robot_names())
            raise BadConfiguration(
                f"no robot is called {str(name_or_path)!r}; give a .toml file or one of: {known}"
            )
        path = ROBOTS / f"{name_or_path}.toml"
    return from_table(RobotProfile, read_toml(path), path.name)


HUSKY = load_profile("husky")
