"""AprilTags in the colour image: which, and where relative to the robot.

The pose of an upright tag has four unknowns, its position and the direction that it faces; the four
corners in the image measure eight numbers, and least squares finds the pose whose corners project
nearest to them. Seen from the front, a small tag may face a little to the left or to the right and
look the same: where both directions fit, the result is the mean of the two, and its covariance
spans both.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navcore.config.localisation.tags import DEFAULT_TAGS, TagConfig
from navcore.geometry.camera import Intrinsics, project
from navcore.geometry.transform import Matrix, Pose2, invert, transform_points, wrap_angle
from navcore.robot.frame import Frame

Corners = npt.NDArray[np.float64]
"""(4, 2) columns and rows in pixels: upper left, upper right, lower right, lower left as seen by
the observer of an upright tag."""
_SCALE = 2
"""Enlargement of the image: in one of 424 × 240 pixels the corners of a tag of 20 pixels come out
0.36 pixels too far inside, in the enlarged one 0.13."""
_WINDOW_PX = 5
"""Half the side of the window in which a corner is refined, in pixels of the enlarged image."""
_ITERATIONS = 12
_STEPS = 1e-5 * np.eye(4)
"""Differences of x, y, z in metres and of yaw in radians for derivatives."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagDetection:
    """One tag in one image."""

    id: int
    """Number in the family 36h11."""
    corners_px: Corners
    """(4, 2) corners in the image."""
    pose: Pose2
    """T_base_tag in the plane of a base with a vertical z axis: position of the middle of the tag,
    and the direction that it faces."""
    z_m: float
    """Height in metres of the middle of the tag above the base."""
    covariance: Matrix
    """(3, 3) covariance of x and y in metres and yaw in radians of `pose`, along the axes of the
    base."""
    residual_px: float
    """Root mean square distance in pixels between the corners and those of the pose."""


def detect_tags(
    frame: Frame, size_of: Callable[[int], float | None], config: TagConfig = DEFAULT_TAGS
) -> tuple[TagDetection, ...]:
    """Return the tags of a frame in order of their number.

    `size_of` tells the side in metres of the black square of a number; None leaves the tag out.
    """
    grey = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)
    large = cv2.resize(grey, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_CUBIC)
    found, numbers, _ = _detector().detectMarkers(large)
    T_camera_level = invert(frame.T_level_camera)
    tags = []
    for quad, number in zip(found, [] if numbers is None else numbers.ravel(), strict=True):
        size_m, corners = size_of(int(number)), _in_image(quad)
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
        if size_m is None or sides.min() < config.min_side_px:
            continue
        view = _View(
            corners_px=corners, size_m=size_m, T_camera_level=T_camera_level, lens=frame.intrinsics
        )
        tag = _located(int(number), view, config)
        if tag.residual_px <= config.max_residual_px:
            tags.append(tag)
    return tuple(sorted(tags, key=lambda tag: tag.id))


@cache
def _detector() -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.cornerRefinementWinSize = _WINDOW_PX
    parameters.relativeCornerRefinmentWinSize = 1.0
    return cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), parameters
    )


def _in_image(quad: npt.NDArray[np.float32]) -> Corners:
    """Return the corners in the image of those in the enlarged one; pixel (0, 0) is the middle of
    the first pixel in both."""
    return (quad.reshape(4, 2).astype(np.float64) + 0.5) / _SCALE - 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _View:
    """The corners of a tag and how they were seen."""

    corners_px: Corners
    size_m: float
    T_camera_level: Matrix
    lens: Intrinsics

    def residuals(self, place: Matrix) -> Matrix:
        """Return (8,) differences in pixels for a tag at (x, y, z, yaw) of the level base frame."""
        points = transform_points(self.T_camera_level, upright_corners(place, self.size_m))
        ahead = np.column_stack([points[:, :2], np.maximum(points[:, 2], 1e-3)])
        return np.asarray((project(ahead, self.lens) - self.corners_px).ravel())

    def jacobian(self, place: Matrix) -> Matrix:
        """Return (8, 4) derivatives of the residuals."""
        return np.column_stack(
            [
                (self.residuals(place + step) - self.residuals(place - step)) / (2 * step.sum())
                for step in _STEPS
            ]
        )

    def first_guesses(self) -> list[Matrix]:
        """Return the place of the best solution of a plane square, by the pose of all six degrees
        of freedom, and the same place facing the other side of the line of sight."""
        half = self.size_m / 2
        square = half * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
        lens = self.lens
        camera = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1.0]])
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            square, self.corners_px, camera, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        T_level_camera = invert(self.T_camera_level)
        normal = T_level_camera[:3, :3] @ cv2.Rodrigues(turns[0])[0][:, 2]
        (position,) = transform_points(T_level_camera, shifts[0].reshape(1, 3).astype(np.float64))
        to_camera = T_level_camera[:2, 3] - position[:2]
        sight, yaw = math.atan2(to_camera[1], to_camera[0]), math.atan2(normal[1], normal[0])
        return [np.array([*position, yaw]), np.array([*position, 2 * sight - yaw])]


def upright_corners(place: Matrix, size_m: float) -> Matrix:
    """Return the (4, 3) corners of an upright tag at (x, y, z, yaw), in the order of detection."""
    x, y, z, yaw = place
    half = size_m / 2
    right = half * np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    up = np.array([0.0, 0.0, half])
    middle = np.array([x, y, z])
    return np.array(
        [middle - right + up, middle + right + up, middle + right - up, middle - right - up]
    )


def _located(number: int, view: _View, config: TagConfig) -> TagDetection:
    """Return the tag at the mean of the poses that fit, weighted by their likelihood."""
    places = [_fitted(guess, view) for guess in view.first_guesses()]
    costs = np.array([float(np.sum(view.residuals(place) ** 2)) for place in places])
    variance = config.corner_error_px**2
    shares = np.exp(-(costs - costs.min()) / (2 * variance))
    shares /= shares.sum()
    best = places[int(costs.argmin())]
    offsets = [_difference(place, best) for place in places]
    shift = np.sum([share * offset for share, offset in zip(shares, offsets, strict=True)], axis=0)
    covariance = np.zeros((4, 4))
    for place, share, offset in zip(places, shares, offsets, strict=True):
        slope = view.jacobian(place)
        own = variance * np.linalg.pinv(slope.T @ slope)
        covariance += share * (own + np.outer(offset - shift, offset - shift))
    mean = best + shift
    planar = [0, 1, 3]
    floor = np.diag([config.position_floor_m] * 2 + [math.radians(config.yaw_floor_deg)]) ** 2
    return TagDetection(
        id=number,
        corners_px=view.corners_px,
        pose=Pose2(x_m=float(mean[0]), y_m=float(mean[1]), yaw_rad=wrap_angle(float(mean[3]))),
        z_m=float(mean[2]),
        covariance=covariance[np.ix_(planar, planar)] + floor,
        residual_px=math.sqrt(float(costs.min()) / 4),
    )


def _difference(place: Matrix, other: Matrix) -> Matrix:
    apart = place - other
    apart[3] = wrap_angle(float(apart[3]))
    return apart


def _fitted(place: Matrix, view: _View) -> Matrix:
    """Return the place of least squares by Levenberg–Marquardt."""
    damping, residuals = 1e-3, view.residuals(place)
    for _ in range(_ITERATIONS):
        slope = view.jacobian(place)
        normal = slope.T @ slope
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), slope.T @ residuals)
        there = view.residuals(place + step)
        if there @ there < residuals @ residuals:
            place, residuals, damping = place + step, there, damping / 10
        else:
            damping *= 10
        if np.abs(step).max() < 1e-6:
            break
    return place
