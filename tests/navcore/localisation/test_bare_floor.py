"""Where a person is all there is to see, the robot goes by its wheels."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig, ScanConfig
from navcore.geometry.transform import Pose2, Twist
from navcore.localisation.localisation import Localisation
from navcore.localisation.scans.scan import Scan
from navcore.mapping.points.pose_ids import PoseIds
from navcore.perception.ground import flat_ground
from navcore.perception.labels import Labels
from navcore.robot.profile import HUSKY
from tests.navcore.scene import Box, picture

TENTH_NS = 100_000_000


def seen(*points: tuple[float, float]) -> Scan:
    count = len(points)
    return Scan(
        points_base=np.array(points).reshape(-1, 2),
        variance_m2=np.full(count, 1e-4),
        normals=np.zeros((count, 2)),
        origin=np.array([0.3, 0.0]),
    )


def side(x_m: float, y_m: float, width_m: float) -> tuple[tuple[float, float], ...]:
    """Return points across the x axis."""
    return tuple((x_m, y_m + width_m * (k / 10 - 0.5)) for k in range(11))


def test_a_narrow_thing_alone_may_be_a_person_and_a_wall_or_two_things_may_not() -> None:
    assert seen(*side(3.0, 0.5, 0.6)).may_be_a_person()
    assert not seen(*side(3.0, 0.5, 0.6), *side(3.5, -1.0, 0.6)).may_be_a_person()
    assert not seen(*side(3.0, 0.0, 2.0)).may_be_a_person()
    # A wall close before the camera: its ends are out of view.
    assert not seen(*side(0.8, 0.0, 0.9)).may_be_a_person()
    assert not seen().may_be_a_person()


def correction_m(*, person_m: float) -> float:
    """Return by how much the pose was moved off that of perfect wheels while the robot drove 0.9 m
    towards a person who came towards it and was not recognised."""
    config = LocalisationConfig(scan=ScanConfig(column_step=1, person_m=person_m))
    localisation, moved_m = (
        Localisation(PoseIds(spacing_m=0.1, spacing_deg=5.0), config, HUSKY.depth_sensor),
        0.0,
    )
    for k in range(15):
        came_m = 3.2 - 0.04 * k
        person = Box(x=(came_m - 0.12, came_m + 0.12), y=(-0.25, 0.25), z=(0.0, 1.75))
        pose = Pose2(x_m=0.06 * k, y_m=0.0, yaw_rad=0.0)
        forward = Twist(v_mps=0.6, w_radps=0.0)
        frame = picture(person, pose=pose, stamp_ns=k * TENTH_NS, twist=forward)
        labels = Labels(
            class_ids=np.zeros(frame.depth_m.shape, np.uint8),
            confidence=np.ones(frame.depth_m.shape, np.float32),
        )
        estimate = localisation.update(frame, labels, (), flat_ground(frame.intrinsics.width))
        moved_m = max(moved_m, abs(estimate.T_map_odom.x_m))
    return moved_m


def test_on_a_bare_floor_the_pose_does_not_follow_a_person() -> None:
    assert correction_m(person_m=ScanConfig().person_m) == pytest.approx(0.0, abs=1e-6)
    # The control: taken for a post, the person pulls the robot forward.
    assert correction_m(person_m=0.0) > 0.02
