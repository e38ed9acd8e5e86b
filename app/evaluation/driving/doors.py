"""Evaluation of doors: from a drawn pose on one side of a door of the office, without people and
items, to a goal on the other.

A door is passed *at the first try* when the goal is reached without a violation, the robot has not
backed off from the line of the door, or turned back, before it was through, and it has not gone
round by another door.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from app.episode.episode import Episode, EpisodeSettings
from app.evaluation.campaign import HERE, Conclusion, Fleet, show_reports
from app.evaluation.driving.drawn_missions import EXAMPLES, drive_drawn
from app.evaluation.origin import origin_of_drives
from app.evaluation.suites import Suite
from app.evaluation.summary import rate_interval
from app.runtime.record.provenance import command_line
from navcore.config.navigator import config_for
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from sim.scenario.load import load_scenario
from sim.scenario.schema import Scenario
from sim.scenario.validation import check_standing
from sim.scenario.variation import randomise
from sim.truth.clearance import clearance_m, grown_obstacles, is_clear_ahead

WORLD = "office"
DOORS = (
    ((-10.0, 1.5), 1.0),
    ((3.0, 1.5), 1.0),
    ((9.0, 1.5), 1.0),
    ((-8.0, -1.5), -1.0),
    ((-1.0, -1.5), -1.0),
    ((11.0, -1.5), -1.0),
)
"""The doors between corridor and rooms: the middle, and the sign of y on the side of the room."""
ROOM_M, CORRIDOR_M = (1.5, 2.6), (1.2, 1.8)
"""Distance of start and goal from the line of the door, metres."""
ASIDE_M, TURNED_RAD = 1.5, 0.6
"""Largest distance of start and goal beside the middle of the door, and largest angle between the
robot's heading and the door."""
PATIENCE_S = 60.0
"""Time limit of an episode, simulated seconds."""
MOST_DRAWN = 100
"""Number of passages of a seed that are tried."""
RETREAT_M = 0.2
"""Distance by which the robot may come away again from the line of the door at the first try, as
where it turns on its way, metres."""
BESIDE_M = 1.0
"""Distance from the middle of the door within which the robot crosses its line, metres: the next
door is farther away."""
THROUGH_M = 0.5
"""Distance of its middle behind the line of the door from which a robot is through, metres."""
COLUMNS = (
    *("seed", "door", "into_room", "first_try", "retreat_m", "goals_reached", "collisions"),
    *("min_clearance_m", "distance_m", "shortest_m", "sim_time_s", "wall_time_s"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """A drive through a door, as drawn from a seed."""

    door: tuple[float, float]
    """Middle of the door."""
    into_room: bool
    """Whether the robot drives from the corridor into the room."""
    start: Pose2
    """Pose at the start."""
    goal: tuple[float, float]
    """Goal on the other side."""
    clear_m: float = math.inf
    """Clearance around the start, metres; infinite before the furniture is known."""

    def is_through(self, driven: Sequence[tuple[float, float]]) -> bool:
        """Return whether a robot that has driven through (x, y) positions has first crossed the
        line of the door in the door."""
        (door_x, door_y), onwards = self.door, math.copysign(1.0, self.goal[1] - self.door[1])
        crossed = (x for x, y in driven if onwards * (y - door_y) > 0.0)
        return abs(next(crossed, math.inf) - door_x) <= BESIDE_M

    def retreat_m(self, driven: Sequence[tuple[float, float]]) -> float:
        """Return by how much a robot that has driven through (x, y) positions has come away again
        from the line of the door before it was through, in metres."""
        onwards = math.copysign(1.0, self.goal[1] - self.door[1])
        retreat_m, farthest_m = 0.0, -math.inf
        for _, y in driven:
            past_m = onwards * (y - self.door[1])
            farthest_m = max(farthest_m, past_m)
            if farthest_m > THROUGH_M:
                break
            retreat_m = max(retreat_m, farthest_m - past_m)
        return retreat_m


def draw_passages(seed: int) -> Iterator[Passage]:
    """Yield passages of a seed, without end: the furniture, which the seed draws too, may stand in
    the way of the first ones."""
    rng = np.random.default_rng((seed, 0xD0025))
    while True:
        (x, y), room = DOORS[rng.integers(len(DOORS))]
        into_room = bool(rng.integers(2))
        before, beyond = (CORRIDOR_M, ROOM_M) if into_room else (ROOM_M, CORRIDOR_M)
        side = -room if into_room else room
        start_x, goal_x = x + rng.uniform(-ASIDE_M, ASIDE_M), x + rng.uniform(-ASIDE_M, ASIDE_M)
        start_y, goal_y = y + side * rng.uniform(*before), y - side * rng.uniform(*beyond)
        towards = math.atan2(y - start_y, x - start_x) + rng.uniform(-TURNED_RAD, TURNED_RAD)
        yield Passage(
            door=(x, y),
            into_room=into_room,
            start=Pose2(x_m=float(start_x), y_m=float(start_y), yaw_rad=float(towards)),
            goal=(float(goal_x), float(goal_y)),
        )


def quiet_office() -> Scenario:
    """Return the office without people, red floor and items."""
    return dataclasses.replace(load_scenario(WORLD), people=(), markings=(), items=())


def evaluate_doors(
    settings: EpisodeSettings, *, seeds: Iterable[int], fleet: Fleet = HERE, out: Path
) -> dict[str, Any]:
    """Drive one passage per seed, print a table, write `summary.json`; return the summary."""
    reports = drive_drawn(
        Suite.DOORS,
        (
            quiet_office(),
            RETREAT_M,
            BESIDE_M,
            THROUGH_M,
            *(next(draw_passages(seed)) for seed in EXAMPLES),
        ),
        drive_passage,
        dataclasses.replace(settings, max_time_s=PATIENCE_S),
        seeds=seeds,
        fleet=fleet,
        out=out,
    )
    return CONCLUSION.write(command_line(), reports, out)


def drive_passage(seed: int, settings: EpisodeSettings) -> dict[str, Any]:
    """Drive the passage of a seed; return its report with the drawn values."""
    passage, episode = first_clear(seed, settings)
    try:
        report = episode.run()
    finally:
        episode.close()
    retreat_m = passage.retreat_m(episode.driven)
    is_first_try = bool(report["success"]) and retreat_m <= RETREAT_M
    return {
        **report,
        "door": list(passage.door),
        "into_room": passage.into_room,
        "retreat_m": round(retreat_m, 3),
        "first_try": is_first_try and passage.is_through(episode.driven),
    }


def first_clear(seed: int, settings: EpisodeSettings) -> tuple[Passage, Episode]:
    """Return the first passage of a seed that the furniture leaves open and has clear floor up to
    where the camera sees it, and its episode; the robot is told how much clearance it has.

    Raises `BadConfiguration` where none of the first ones is so.
    """
    office = randomise(quiet_office(), seed)
    robot = settings.robot
    walls, config = grown_obstacles(office, {}, robot), settings.config or config_for(robot)
    for passage in islice(draw_passages(seed), MOST_DRAWN):
        start = passage.start
        clear_m = clearance_m(walls, start.x_m, start.y_m)
        if not is_clear_ahead(
            walls, start, ahead_m=config.start_ahead_m, width_m=settings.robot.width_m
        ):
            continue
        try:
            check_standing(office, start, robot, "start")
        except BadConfiguration:
            continue  # in a piece of furniture
        drawn = dataclasses.replace(
            settings,
            goals=(passage.goal,),
            start=start,
            randomised=True,
            config=dataclasses.replace(config, start_clear_m=min(config.start_clear_m, clear_m)),
        )
        episode = Episode(office, drawn, seed=seed)
        referee = episode.simulator.referee
        if referee.shortest_m(episode.spec, episode.inflation_m, [passage.goal]) is not None:
            return dataclasses.replace(passage, clear_m=clear_m), episode
        episode.close()
    raise BadConfiguration(
        f"seed {seed}: the robot {robot.name!r} passes none of {MOST_DRAWN} drawn doors"
    )


def summarise(command: str, reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the summary of a campaign as a JSON object, with Wilson's interval."""
    passed = [report for report in reports if report["first_try"]]
    return {
        **origin_of_drives(Suite.DOORS, command, reports),
        "first_try": round(len(passed) / len(reports), 4),
        "first_try_ci95": [round(end, 4) for end in rate_interval(len(passed), len(reports))],
        "not_at_first_try_seeds": [report["seed"] for report in reports if not report["first_try"]],
        "goals_reached": sum(report["goals_reached"] for report in reports),
        "collisions": sum(report["collisions"] for report in reports),
        "min_clearance_m": min(report["min_clearance_m"] for report in reports),
        "sim_time_s": round(float(np.mean([report["sim_time_s"] for report in reports])), 2),
    }


CONCLUSION = Conclusion(
    summarise=summarise,
    show=partial(show_reports, columns=COLUMNS, title=Suite.DOORS),
)
"""What is made of a campaign."""
