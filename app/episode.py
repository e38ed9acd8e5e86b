"""A mission without a console: simulated robot, pilot and referee, stepped in one thread as fast as the machine allows."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from app.faults import Sabotage
from app.pilot import COMMAND_PERIOD_S, Intent, Pilot
from app.segmenter import Perception, colour_perception
from app.timing import Stopwatch
from navcore.beware import BewareList
from navcore.config import NavigatorConfig
from navcore.errors import BadConfiguration
from navcore.frame import Frame
from navcore.grid import GridSpec
from navcore.mission import Goal, Mission, Phase
from navcore.navigator import Navigator
from navcore.robot import HUSKY, RobotProfile
from navcore.safety import Verdict
from navcore.transform import Pose2
from navcore.warmup import warm_up
from sim.scenario import Scenario
from sim.simulator import Simulator

SERIES_PERIOD_S = 1.0
GOAL_RADIUS_M = 0.3
"""The robot must finally stand this near to a goal, judged from the ground truth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """Where an episode is, for a progress bar."""

    goal: Goal | None
    """The present goal; None when all are done."""
    goals_done: int
    """Goals reached so far."""
    goals: int
    """Goals in all."""
    distance_m: float
    """Straight distance to the present goal."""
    sim_time_s: float
    """Simulated time."""
    share: float
    """How much of the mission is done, 0 to 1, by straight distances."""

    def text(self) -> str:
        """One line for the bar."""
        where = f"goal {self.goal.id} ({self.goal.x_m:g}, {self.goal.y_m:g}), {self.distance_m:5.1f} m" if self.goal else "done"
        return f"{self.goals_done} of {self.goals} goals, {where}, {self.sim_time_s:5.0f} s"


def map_of(scenario: Scenario) -> GridSpec:
    """The map's grid for a world."""
    return GridSpec.centred(size_m=scenario.map.size_m, resolution_m=scenario.map.resolution_m)


class Episode:
    """One seeded mission from start to end; `run` returns the episode report."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        seed: int,
        beware: BewareList,
        goals: tuple[tuple[float, float], ...] = (),
        config: NavigatorConfig | None = None,
        max_time_s: float = 600.0,
        perception: Perception | None = None,
        camera_size: tuple[int, int] = (424, 240),
        robot: RobotProfile = HUSKY,
    ) -> None:
        """Without a perception the colour rules look for what is to beware of."""
        self.scenario, self.seed, self._max_time_s = scenario, seed, max_time_s
        spec = map_of(scenario)
        mission = Mission()
        for x_m, y_m in goals or scenario.goals:
            mission = mission.add(x_m, y_m, spec)
        if not mission.queue:
            raise BadConfiguration(f"scenario {scenario.name!r} has no goals of its own; give --goal X,Y")
        self._goals = mission.queue
        self.simulator = Simulator(scenario, seed=seed, camera_size=camera_size, robot=robot)
        profile = self.simulator.profile
        self._config = config or NavigatorConfig()
        self._perception = perception or colour_perception()
        navigator = Navigator(spec=spec, profile=profile, segmenter=self._perception.segmenter, config=self._config)
        self._sabotage = Sabotage(navigator, lambda: self.simulator.faults, lambda: self._now_s)
        self.stopwatch = Stopwatch(navigator)
        self.pilot = Pilot(navigator=navigator, profile=profile, intent=Intent(mission=mission, beware=beware))
        self._thinks_of: Frame | None = None
        self._thinks_until_s = 0.0
        self.on_verdict: Callable[[float, Verdict], None] = lambda t_s, verdict: None
        """Told of each command as it is sent, with the simulated time."""
        self._arrived: dict[int, float] = {}
        self._explored: list[tuple[float, float, float]] = []
        self.driven: list[tuple[float, float]] = []
        """(x, y) where the robot truly was, once a command."""

    def run(
        self,
        on_progress: Callable[[Progress], None] = lambda progress: None,
        ended: Callable[[Simulator], bool] = lambda simulator: False,
        look_first_s: float = 0.0,
    ) -> dict[str, Any]:
        """Drive until every goal is reached, the time is up or `ended` says so; the report of the contract.

        Before it sets out the robot stands and looks for `look_first_s`.
        """
        warm_up(self._perception.segmenter)
        started = time.perf_counter()
        frame = self._look(look_first_s)
        self.pilot.change_mission(Mission.start)
        next_command_s, next_sample_s = 0.0, 0.0
        while self.pilot.intent.mission.phase is Phase.DRIVING and self._now_s < self._max_time_s:
            self.simulator.step()
            if ended(self.simulator):
                break
            if self.simulator.newest_frame() is not frame:
                frame = self.simulator.newest_frame()
                self._begin_tick(frame)
            self._end_tick()
            if self._now_s >= next_command_s:
                next_command_s += COMMAND_PERIOD_S
                self._command()
            if self._now_s >= next_sample_s:
                next_sample_s += SERIES_PERIOD_S
                self._sample()
                on_progress(self._progress())
        self._sample()
        on_progress(self._progress())
        return self._report(time.perf_counter() - started)

    def close(self) -> None:
        """Free the simulator."""
        self.simulator.close()

    @property
    def _now_s(self) -> float:
        return self.simulator.now_ns() / 1e9

    def _look(self, seconds: float) -> Frame | None:
        """Stand and look for so long, at least until there is a picture; the last one thought about, None without any."""
        seen: Frame | None = None
        while (newest := self.simulator.newest_frame()) is None or self._now_s < seconds:
            if newest is not None and newest is not seen:
                seen = newest
                self._think(newest)
            self.simulator.step()
        return seen

    def _begin_tick(self, frame: Frame | None) -> None:
        """A tick takes no simulated time, unless a fault makes it; frames that come in meanwhile are missed."""
        if self._thinks_of is None:
            self._thinks_of, self._thinks_until_s = frame, self._now_s + self._sabotage.delay_s()

    def _end_tick(self) -> None:
        if self._thinks_of is None or self._now_s < self._thinks_until_s:
            return
        frame, self._thinks_of = self._thinks_of, None
        try:
            self._think(frame)
        except Exception as error:
            if not self.simulator.faults:
                raise
            self.pilot.note_failure(frame, error)

    def _think(self, frame: Frame) -> None:
        goal = self.pilot.intent.mission.goal
        self.pilot.think(frame, clock=self.simulator.now_ns)
        if goal is not None and goal in self.pilot.intent.mission.reached:
            pose = self.simulator.true_pose()
            self._arrived[goal.id] = pose.distance_to(goal.x_m, goal.y_m)

    def _command(self) -> None:
        now_ns, newest = self.simulator.now_ns(), self.simulator.newest_frame()
        verdict = self.pilot.command(now_ns, COMMAND_PERIOD_S, self.simulator.send, newest=newest)
        self.on_verdict(self._now_s, verdict)
        pose = self.simulator.true_pose()
        self.driven.append((pose.x_m, pose.y_m))
        self.simulator.referee.note_stop(verdict.reasons[0].cause if verdict.reasons else None)

    def _sample(self) -> None:
        world = self.pilot.navigator.map
        self._explored.append((self._now_s, world.explored.area_m2, world.explored.volume_m3))

    def _progress(self) -> Progress:
        goal, pose = self.pilot.intent.mission.goal, self.simulator.odometry()
        return Progress(
            goal=goal,
            goals_done=len(self.pilot.intent.mission.reached),
            goals=len(self._goals),
            distance_m=pose.distance_to(goal.x_m, goal.y_m) if goal else 0.0,
            sim_time_s=self._now_s,
            share=self._share(pose),
        )

    def _share(self, pose: Pose2) -> float:
        places = [(self.scenario.start[0], self.scenario.start[1]), *((goal.x_m, goal.y_m) for goal in self._goals)]
        legs = [math.dist(here, there) for here, there in pairwise(places)]
        done = len(self.pilot.intent.mission.reached)
        left = pose.distance_to(*places[done + 1]) if done < len(legs) else 0.0
        return min(max(1.0 - (left + sum(legs[done + 1 :])) / max(sum(legs), 1e-9), 0.0), 1.0)

    def _report(self, wall_time_s: float) -> dict[str, Any]:
        referee, watch = self.simulator.referee, self.stopwatch
        reached = [goal for goal in self._goals if self._arrived.get(goal.id, float("inf")) <= GOAL_RADIUS_M]
        everywhere = len(reached) == len(self._goals)
        shortest_m = self._shortest_m()
        longest_m = max(referee.distance_m, shortest_m or 0.0)
        return {
            "scenario": self.scenario.name,
            "seed": self.seed,
            "robot": self.simulator.profile.name,
            "segmenter": self._perception.identity,
            "goals": [[goal.x_m, goal.y_m] for goal in self._goals],
            "goals_reached": len(reached),
            "success": everywhere and referee.violations() == 0,
            "sim_time_s": round(self._now_s, 3),
            "wall_time_s": round(wall_time_s, 3),
            "distance_m": round(referee.distance_m, 3),
            "shortest_m": None if shortest_m is None else round(shortest_m, 3),
            "spl": 0.0 if shortest_m is None or not everywhere else round(shortest_m / longest_m, 4),
            "collisions": referee.collisions,
            "struck_while_standing": referee.struck_while_standing,
            "min_clearance_m": round(referee.min_clearance_m, 4),
            "beware_intrusions": referee.beware_intrusions,
            "beware_intrusion_s": round(referee.beware_intrusion_s, 3),
            "zone_intrusions": referee.zone_intrusions,
            "zone_intrusion_s": round(referee.zone_intrusion_s, 3),
            "goal_errors_m": {str(goal_id): round(error, 3) for goal_id, error in self._arrived.items()},
            "replans": len(watch.ms["plan"]),
            "plan_ms": watch.summary("plan"),
            "tick_ms": watch.summary("tick"),
            "segment_ms": watch.summary("label"),
            "series": self._series(),
            "stops": referee.stops,
        }

    def _series(self) -> dict[str, list[float]]:
        return {
            "t_s": [round(t_s, 3) for t_s, _, _ in self._explored],
            "distance_m": [round(self.simulator.referee.distance_at(t_s), 3) for t_s, _, _ in self._explored],
            "explored_m2": [round(area, 2) for _, area, _ in self._explored],
            "explored_m3": [round(volume, 3) for _, _, volume in self._explored],
        }

    def _shortest_m(self) -> float | None:
        """The shortest way through all goals on the true map with the same inflation; None when there is none."""
        inflation_m = self.simulator.profile.width_m / 2 + self._config.safety_margin_m
        goals = [(goal.x_m, goal.y_m) for goal in self._goals]
        return self.simulator.referee.shortest_m(map_of(self.scenario), inflation_m, goals)
