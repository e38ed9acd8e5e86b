"""Fixes by tags: the pose and the covariance that follow from a detection, and those of the tag."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Matrix, Pose2, wrap_angle
from navcore.localisation.fixes import MappedTag, TagMap, tag_fixes, tag_map, tag_seen
from navcore.perception.tags import TagDetection
from navcore.robot.fix import FixSource, check_fix

NUMBERS = st.floats(-20.0, 20.0)
POSES = st.builds(Pose2, x_m=NUMBERS, y_m=NUMBERS, yaw_rad=st.floats(-3.1, 3.1))
VIEW = np.diag([0.02, 0.03, 0.01]) ** 2
SURVEY = np.diag([0.01, 0.02, 0.03]) ** 2


def detected(pose: Pose2, covariance: Matrix = VIEW) -> TagDetection:
    return TagDetection(
        id=7,
        corners_px=np.zeros((4, 2)),
        pose=pose,
        z_m=0.6,
        covariance=covariance,
        residual_px=0.1,
    )


def known(pose: Pose2) -> TagMap:
    return tag_map([MappedTag(id=7, pose=pose, size_m=0.3, covariance=SURVEY)])


def as_array(pose: Pose2) -> Matrix:
    return np.array([pose.x_m, pose.y_m, pose.yaw_rad])


def as_pose(values: Matrix) -> Pose2:
    return Pose2(x_m=float(values[0]), y_m=float(values[1]), yaw_rad=float(values[2]))


def propagated(function: Callable[[Matrix], Pose2], at: Matrix, covariance: Matrix) -> Matrix:
    """Return the covariance of a function of a pose by differences."""
    columns = []
    for step in 1e-5 * np.eye(3):
        change = as_array(function(at + step)) - as_array(function(at - step))
        change[2] = wrap_angle(float(change[2]))
        columns.append(change / 2e-5)
    slope = np.column_stack(columns)
    return np.asarray(slope @ covariance @ slope.T)


@given(POSES, POSES)
def test_a_tag_seen_exactly_gives_the_exact_pose_of_the_robot(base: Pose2, tag: Pose2) -> None:
    (fix,) = tag_fixes([detected(base.inverse() @ tag)], known(tag), 5)
    assert base.distance_to(fix.x_m, fix.y_m) < 1e-9
    assert fix.yaw_rad is not None and abs(wrap_angle(fix.yaw_rad - base.yaw_rad)) < 1e-9
    assert (fix.stamp_ns, fix.source, fix.source_id) == (5, FixSource.TAG, 7)
    check_fix(fix)


@given(POSES, POSES)
def test_the_covariance_of_a_fix_is_that_of_its_view_and_of_its_tag(
    seen: Pose2, tag: Pose2
) -> None:
    (fix,) = tag_fixes([detected(seen)], known(tag), 0)
    by_view = propagated(lambda at: tag @ as_pose(at).inverse(), as_array(seen), VIEW)
    by_tag = propagated(lambda at: as_pose(at) @ seen.inverse(), as_array(tag), SURVEY)
    difference = fix.covariance - by_view - by_tag
    # What is of second order lies along the line of sight.
    sight = np.array([tag.x_m - fix.x_m, tag.y_m - fix.y_m])
    second = 0.75 * fix.covariance[2, 2] ** 2 * np.outer(sight, sight)
    np.testing.assert_allclose(difference[:2, :2], second, atol=1e-5)
    np.testing.assert_allclose(difference[2], 0.0, atol=1e-6)


@given(POSES, POSES)
def test_a_tag_is_where_it_was_seen_and_less_surely_known_than_the_robots_pose(
    base: Pose2, seen: Pose2
) -> None:
    own = np.diag([0.05, 0.04, 0.02]) ** 2
    tag = tag_seen(detected(seen), 0.3, base, own)
    np.testing.assert_allclose(as_array(tag.pose), as_array(base @ seen), atol=1e-9)
    expected = propagated(lambda at: as_pose(at) @ seen, as_array(base), own)
    expected += propagated(lambda at: base @ as_pose(at), as_array(seen), VIEW)
    np.testing.assert_allclose(tag.covariance, expected, rtol=1e-4, atol=1e-8)


def test_unknown_tags_are_left_out_and_numbers_are_unique() -> None:
    assert TagMap().size_of(7) is None
    assert tag_fixes([detected(Pose2(x_m=1, y_m=0, yaw_rad=0))], TagMap(), 0) == ()
    tag = MappedTag(id=7, pose=Pose2(x_m=0, y_m=0, yaw_rad=0), size_m=0.3)
    with pytest.raises(BadConfiguration, match="number 7"):
        tag_map([tag, tag])
