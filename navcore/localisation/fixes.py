"""Position fixes by tags whose pose in the map is known, and the pose of a tag that the robot
sees."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from navcore.config.localisation.tags import DEFAULT_TAGS, TagConfig
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Matrix, Pose2
from navcore.perception.tags import TagDetection, detect_tags
from navcore.robot.fix import FixSource, PositionFix
from navcore.robot.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MappedTag:
    """A tag of the map."""

    id: int
    """Number in the family 36h11."""
    pose: Pose2
    """T_map_tag in the plane: position of the middle, and the direction that the tag faces."""
    size_m: float
    """Side of the black square in metres."""
    covariance: Matrix = field(default_factory=lambda: np.zeros((3, 3)))
    """(3, 3) covariance of x and y in metres and yaw in radians of `pose`, along the map's axes."""


@dataclass(frozen=True, slots=True, eq=False)
class TagMap:
    """The known tags of a map by their number; a value."""

    tags: Mapping[int, MappedTag] = field(default_factory=dict)
    """Tag of each number."""

    def size_of(self, number: int) -> float | None:
        """Return the side in metres of a tag; None for one that is not on the map."""
        known = self.tags.get(number)
        return None if known is None else known.size_m


def tag_seen(
    detection: TagDetection, size_m: float, T_map_base: Pose2, covariance: Matrix
) -> MappedTag:
    """Return a tag where one detection has it, seen from a T_map_base with a (3, 3) covariance."""
    return MappedTag(
        id=detection.id,
        pose=T_map_base @ detection.pose,
        size_m=size_m,
        covariance=_seen_covariance(detection, T_map_base, covariance),
    )


def tag_map(tags: Iterable[MappedTag]) -> TagMap:
    """Return the map of some tags; raises `BadConfiguration` for two of one number."""
    by_number: dict[int, MappedTag] = {}
    for tag in tags:
        if tag.id in by_number:
            raise BadConfiguration(f"two tags of the map have the number {tag.id}")
        by_number[tag.id] = tag
    return TagMap(by_number)


def tag_fixes(
    detections: Iterable[TagDetection],
    tags: TagMap,
    stamp_ns: int,
    config: TagConfig = DEFAULT_TAGS,
) -> tuple[PositionFix, ...]:
    """Return one fix for each detected tag of the map whose heading is sure enough."""
    most = math.radians(config.max_yaw_error_deg) ** 2
    return tuple(
        _fix(detection, tags.tags[detection.id], stamp_ns, config)
        for detection in detections
        if detection.id in tags.tags and detection.covariance[2, 2] <= most
    )


def fixes_of(
    frame: Frame, tags: TagMap, config: TagConfig = DEFAULT_TAGS
) -> tuple[PositionFix, ...]:
    """Return all fixes of a frame: those that the robot delivered, and those by the tags that its
    image shows."""
    if not tags.tags:
        return frame.fixes
    detections = detect_tags(frame, tags.size_of, config)
    return (*frame.fixes, *tag_fixes(detections, tags, frame.stamp_ns, config))


def _fix(detection: TagDetection, tag: MappedTag, stamp_ns: int, config: TagConfig) -> PositionFix:
    """Return T_map_base = T_map_tag · T_tag_base with the covariances of both."""
    base = tag.pose @ detection.pose.inverse()
    turn = _rotation(base.yaw_rad)
    # The base moves sideways by this for each radian that the tag is turned.
    lever = _LEFT @ turn @ (detection.pose.x_m, detection.pose.y_m)
    by_tag, by_view = np.eye(3), np.zeros((3, 3))
    by_tag[:2, 2] = -lever
    by_view[:2, :2], by_view[:2, 2], by_view[2, 2] = -turn, lever, -1.0
    covariance = by_tag @ tag.covariance @ by_tag.T + by_view @ detection.covariance @ by_view.T
    covariance[:2, :2] += _bend(turn @ (detection.pose.x_m, detection.pose.y_m), covariance[2, 2])
    return PositionFix(
        stamp_ns=stamp_ns,
        x_m=base.x_m,
        y_m=base.y_m,
        yaw_rad=base.yaw_rad,
        covariance=covariance,
        source=FixSource.TAG,
        source_id=tag.id,
        correlation_s=config.correlation_s,
    )


def _bend(to_tag: Matrix, variance: float) -> Matrix:
    """Return the (2, 2) part of the covariance that is of second order: by an error of the heading
    the base moves on a circle about the tag, which leaves the tangent by r·Δ²/2."""
    return np.asarray(0.75 * variance**2 * np.outer(to_tag, to_tag))


_LEFT = np.array([[0.0, -1.0], [1.0, 0.0]])


def _rotation(yaw_rad: float) -> Matrix:
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[cos, -sin], [sin, cos]])


def _seen_covariance(detection: TagDetection, T_map_base: Pose2, covariance: Matrix) -> Matrix:
    """Return the (3, 3) covariance of T_map_tag = T_map_base · T_base_tag."""
    turn = _rotation(T_map_base.yaw_rad)
    by_base, by_view = np.eye(3), np.eye(3)
    by_base[:2, 2] = _LEFT @ turn @ (detection.pose.x_m, detection.pose.y_m)
    by_view[:2, :2] = turn
    return np.asarray(by_base @ covariance @ by_base.T + by_view @ detection.covariance @ by_view.T)
