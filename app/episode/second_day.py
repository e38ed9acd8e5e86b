"""Episodes in a kept map: on the first day the robot maps the world by a drive of its own, and on
the second day it is switched on where it stood in the evening, with the map of the day before.

The world is the same on both days, but chairs and items stand a little elsewhere, people are
elsewhere, and odometry has other errors and begins at zero. The robot finds its place as in the
console: by its scans, where it stood last; where these do not tell, an operator shows its place.
Goals and zones of the second day are what an operator draws into the kept map, beside what it
shows, wherever its drift has put that.
"""

from __future__ import annotations

import dataclasses
import math
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.episode.episode import Episode, EpisodeSettings
from app.episode.latency import NO_LATENCY
from app.runtime.control.robot_controller import COMMAND_PERIOD_S
from app.runtime.record.map_persistence import load_map, save_map
from navcore.geometry.arrays import Points
from navcore.geometry.transform import IDENTITY, Pose2, wrap_angle
from navcore.mission.anchor import NumberedPoses
from navcore.mission.anchors import Item, anchored, placed
from navcore.mission.mission import Goal, Mission
from navcore.mission.zone import Zone
from navcore.navigator import TickResult
from sim.scenario.schema import Scenario
from sim.scenario.variation import another_day
from sim.truth.random_missions import SALT

OTHER_DAY = 1000
"""Added to a seed for another day: chairs stand elsewhere, other people are about."""
FIRST_DAY = 2
"""Time limit of the first day, there and back, by that of the second."""
FIRST_LOOK_S = 0.5
"""Time in seconds for which the robot stands before its place is asked for."""
PATIENCE_S = 8.0
"""Longest time for which the robot looks for its place before the operator shows it, seconds."""
ELSEWHERE_M = 1.0
"""Distance in metres from which an operator sees that the robot is not where the map shows it."""
DRAWN = "first day"
"""Numbering of the poses of the first day."""
SHOWN = np.array([0.25, 0.25, math.radians(5.0)])
"""Standard deviations of a place that the operator shows: metres along x and y, and radians."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FirstDay:
    """What is left of the first day besides the file of the map."""

    true_poses: tuple[Pose2, ...]
    """True T_map_base at which each pose of the map was first seen, by pose ID."""
    map_poses: tuple[Pose2, ...]
    """The same poses in the map, after all corrections."""
    last: Pose2 | None
    """T_map_base at which the robot was last known to be; None if it never was."""
    report: dict[str, Any]
    """How the drive went, for the report of the second day."""

    def placed(self, item: Item) -> Item:
        """Return a zone or goal of the true world where an operator draws it in the map: at the
        same place relative to the poses beside it. Far from all of them it stays."""
        drawn = anchored(item, NumberedPoses(numbering=DRAWN, poses=self.true_poses))
        return placed(drawn, NumberedPoses(numbering=DRAWN, poses=self.map_poses))

    def placed_outline(self, outline: Points) -> Points:
        """Return where the map shows what an (N, 2) outline of the true world covers."""
        corners = tuple((float(x), float(y)) for x, y in outline)
        return np.array(self.placed(Zone(id="", name="", polygon=corners)).polygon)


def second_day(world: Scenario, settings: EpisodeSettings, *, seed: int) -> Episode:
    """Drive the first day and return the episode of the second, in the map that was kept.

    `world` is what the seed has made of it, with the start of the robot.
    """
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) / "map.npz"
        first = drive_first_day(world, settings, seed=seed, kept=kept)
        return switched_on(world, settings, seed=seed, kept=kept, first=first)


def switched_on(
    world: Scenario, settings: EpisodeSettings, *, seed: int, kept: Path, first: FirstDay
) -> Episode:
    """Return the episode of the second day in the map of a file."""
    episode = Episode(world, dataclasses.replace(settings, odometry_origin=IDENTITY), seed=seed)
    try:
        navigator = episode.controller.navigator
        load_map(navigator.map, settings.beware, prior=None, kept=kept)
    except BaseException:
        episode.close()
        raise
    navigator.adopt_map(first.last)
    episode.controller.change(
        lambda intent: dataclasses.replace(
            intent,
            mission=dataclasses.replace(
                intent.mission, queue=tuple(map(first.placed, intent.mission.queue))
            ),
            zones=tuple(map(first.placed, intent.zones)),
        )
    )
    episode.first_day, episode.placed = dict(first.report), first.placed_outline
    episode.before_start = partial(_look_for_place, episode, episode.first_day, first)
    return episode


def _look_for_place(episode: Episode, report: dict[str, Any], first: FirstDay) -> None:
    """Stand until the robot takes itself to be somewhere; an operator shows the place of one that
    does not, or that is elsewhere, as well as a click and a drag do."""
    x_m, y_m, yaw_rad = episode.scenario.start
    shown = first.placed(Goal(id=0, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad))
    episode.observe(FIRST_LOOK_S)
    while not episode.controller.place.is_known and episode.now_s < PATIENCE_S:
        episode.observe(episode.now_s + COMMAND_PERIOD_S)
    place = episode.controller.place
    is_elsewhere = place.T_map_base.distance_to(shown.x_m, shown.y_m) > ELSEWHERE_M
    told = is_elsewhere or not place.is_known
    report["place_shown"] = told
    if told:
        dx, dy, turn = SHOWN * np.random.default_rng((episode.seed, SALT, 2)).standard_normal(3)
        pose = Pose2(
            x_m=shown.x_m + float(dx),
            y_m=shown.y_m + float(dy),
            yaw_rad=wrap_angle(yaw_rad + float(turn)),
        )
        episode.controller.place_robot(pose, np.diag(SHOWN**2))


def drive_first_day(
    world: Scenario, settings: EpisodeSettings, *, seed: int, kept: Path
) -> FirstDay:
    """Map a world by a drive to its goals and back to the start, without zones and with the time
    that both ways may take; write the map to the file `kept`.

    A drive that ends early leaves the map that it has made.
    """
    goals, home = settings.goals or world.goals, world.start_pose
    episode = Episode(
        another_day(world, seed + OTHER_DAY),
        dataclasses.replace(
            settings,
            goals=(*goals, (home.x_m, home.y_m)),
            zones=(),
            latency=NO_LATENCY,  # so that a tick is of the moment whose true pose is noted
            max_time_s=FIRST_DAY * settings.max_time_s,
        ),
        seed=seed + OTHER_DAY,
    )
    navigator, true_poses = episode.controller.navigator, list[Pose2]()
    last: Pose2 | None = None

    def note(_: float, result: TickResult) -> None:
        nonlocal last
        last = result.place.T_map_base if result.place.is_known else last
        new = len(navigator.map.pose_ids) - len(true_poses)
        true_poses.extend([episode.simulator.true_pose()] * new)

    def homewards(mission: Mission) -> Mission:
        goal = dataclasses.replace(mission.queue[-1], yaw_rad=home.yaw_rad)
        return mission.change(goal, navigator.map.spec)

    episode.on_decision = note
    try:
        episode.controller.change_mission(homewards)
        driven = episode.run()
        save_map(navigator.map, settings.beware, kept)
        map_poses = navigator.map.poses
    finally:
        episode.close()
    away_m = [
        true.distance_to(pose.x_m, pose.y_m)
        for true, pose in zip(true_poses, map_poses, strict=True)
    ]
    report = {
        "ended": driven["ended"],
        "goals_reached": driven["goals_reached"],
        "goals": len(goals) + 1,
        "distance_m": driven["distance_m"],
        "sim_time_s": driven["sim_time_s"],
        "map_error_m": round(max(away_m, default=0.0), 3),
        "pushes": driven["pushes"],
    }
    return FirstDay(true_poses=tuple(true_poses), map_poses=map_poses, last=last, report=report)
