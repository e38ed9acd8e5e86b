"""On the second day the robot knows the world from the map that it made on the first."""

from __future__ import annotations

import dataclasses

from app.episode.second_day import FirstDay
from app.episode.task import Task, episode_of
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Goal
from navcore.mission.zone import Zone
from navcore.robot.profile import HUSKY
from sim.scenario.load import load_scenario

ROOM = load_scenario("empty_room")
TRUE_POSES = tuple(Pose2(x_m=0.5 * k, y_m=0.0, yaw_rad=0.0) for k in range(9))
DRIFT = Pose2(x_m=0.2, y_m=-0.1, yaw_rad=0.05)


def first_day(drift: Pose2) -> FirstDay:
    map_poses = tuple(drift @ pose for pose in TRUE_POSES)
    return FirstDay(true_poses=TRUE_POSES, map_poses=map_poses, last=None, report={})


def test_goals_and_zones_are_drawn_where_the_drift_of_the_map_has_put_their_places() -> None:
    goal = Goal(id=1, x_m=3.0, y_m=1.0)
    corners = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0))
    zone = Zone(id="z", name="z", polygon=corners)
    drifted, exact = first_day(DRIFT), first_day(IDENTITY)
    for told, true in (
        ((drifted.placed(goal).x_m, drifted.placed(goal).y_m), (3.0, 1.0)),
        *zip(drifted.placed(zone).polygon, corners, strict=True),
    ):
        seen = DRIFT @ Pose2(x_m=true[0], y_m=true[1], yaw_rad=0.0)
        assert seen.distance_to(*told) < 1e-9
    assert exact.placed(goal) == goal and exact.placed(zone) == zone
    far = dataclasses.replace(goal, y_m=30.0)
    assert drifted.placed(far) == far


def test_the_robot_finds_its_place_in_the_map_of_the_day_before_and_reaches_the_goal() -> None:
    """Odometry begins at zero, which is not where the robot stands in the map."""
    x_m, y_m, _ = ROOM.start
    near = dataclasses.replace(ROOM, goals=((x_m + 0.6, y_m),))
    task = Task(scenario=near, kept_map=True, max_time_s=20.0)
    episode = episode_of(task, 0, robot=HUSKY, beware=default_beware_list(), perception=None)
    try:
        known = episode.controller.navigator.map.explored.area_m2
        assert known > 5.0 and episode.simulator.odometry() == IDENTITY
        report = episode.run()
        place, true = episode.controller.place.T_map_base, episode.simulator.true_pose()
    finally:
        episode.close()
    assert report["success"] and report["map"] == "kept"
    assert report["first_day"]["goals_reached"] == 2 and report["first_day"]["map_error_m"] < 0.1
    assert place.distance_to(true.x_m, true.y_m) < 0.1
    assert report["goal_errors_by_odometry_m"]["1"] < 0.3
