"""A robot that took itself for lost in its own new map finds its place by itself, if it is where it
was."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.config.localisation.localisation import LocalisationConfig
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationEstimate, LocalisationState
from navcore.localisation.localisation import Localisation
from navcore.localisation.relocalisation.relocalisation import SearchResult
from navcore.mapping.points.pose_ids import PoseIds
from navcore.robot.profile import HUSKY
from tests.navcore.localisation.plan_worlds import PlanWorld, drive, office, turn_on_spot
from tests.navcore.localisation.tracking.test_localiser import frame_at

WORLD, OTHER = office(3), office(7)
ROUTE = drive([(1.5, 0.0), (9.0, 0.0)])
ROUTE += turn_on_spot((9.0, 0.0), 0.0, 2.0 * np.pi + 0.5)
HERE = ROUTE[-1]
"""Turned aside: straight on, a corridor does not tell how far along it the robot is."""
PUSHED = HERE @ Pose2(x_m=-0.25, y_m=0.1, yaw_rad=0.1)
RULES = LocalisationConfig().relocalisation
COVERED, STANDING = 40, 25
"""Frames in which something else is before the camera, and in which the robot then stands."""


def lost_robot(*, asked: bool = False) -> tuple[Localisation, int]:
    """A robot that has made a map on its way, before whose camera something else was for so long
    that it took itself for lost, and its number of frames."""
    rng = np.random.default_rng(1)
    robot, count = Localisation(PoseIds(0.25, 10.0), LocalisationConfig(), HUSKY.depth_sensor), 0
    for pose in ROUTE:
        count += 1
        robot.follow(frame_at(pose, count), WORLD.scan(pose, rng))
    for _ in range(COVERED):
        count += 1
        scan = OTHER.scan(Pose2(x_m=3.0, y_m=3.0, yaw_rad=2.5), rng)
        estimate = robot.follow(frame_at(HERE, count), scan)
    assert estimate.state is LocalisationState.LOST
    if asked:
        robot.search(count)
    return robot, count


def standing(robot: Localisation, count: int, world: PlanWorld, at: Pose2) -> LocalisationEstimate:
    """The estimate after some seconds at a place, by odometry where it was, with the tasks that run
    beside the tick."""
    rng = np.random.default_rng(2)
    for k in range(count + 1, count + STANDING):
        estimate = robot.follow(frame_at(HERE, k), world.scan(at, rng))
        if (task := robot.next_task()) and (outcome := task.run(lambda: False)):
            robot.take(outcome)
    return estimate


@pytest.mark.parametrize("at", [HERE, PUSHED], ids=["where it was", "pushed aside"])
def test_a_robot_that_stands_about_where_it_was_knows_its_place_again(at: Pose2) -> None:
    found = standing(*lost_robot(), WORLD, at)
    assert found.is_known
    assert found.T_map_base.distance_to(at.x_m, at.y_m) < 0.1
    assert abs(found.T_map_base.yaw_rad - at.yaw_rad) < 0.03


def test_without_its_last_place_it_stays_lost_as_does_one_that_the_operator_has_look_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert not standing(*lost_robot(asked=True), WORLD, HERE).is_known
    monkeypatch.setattr(SearchResult, "still_there", lambda *_: None)
    assert not standing(*lost_robot(), WORLD, HERE).is_known


def test_an_answer_from_before_look_round_does_not_put_the_robot_back() -> None:
    robot, count = lost_robot()
    rng = np.random.default_rng(2)
    outcome = None
    for k in range(count + 1, count + STANDING):
        robot.follow(frame_at(HERE, k), WORLD.scan(HERE, rng))
        task = robot.next_task()
        outcome = task.run(lambda: False) if task else None
        if isinstance(outcome, SearchResult) and outcome.still_there(RULES):
            break
        if outcome:
            robot.take(outcome)
    assert isinstance(outcome, SearchResult)
    robot.search(k)
    robot.take(outcome)
    assert not robot.follow(frame_at(HERE, k + 1), WORLD.scan(HERE, rng)).is_known


@pytest.mark.parametrize("at", [ROUTE[20], Pose2(x_m=8.0, y_m=3.0, yaw_rad=2.5)])
def test_a_robot_that_was_carried_away_stays_lost(at: Pose2) -> None:
    assert not standing(*lost_robot(), WORLD, at).is_known
