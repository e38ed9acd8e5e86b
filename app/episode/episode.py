"""A mission without a console: simulated robot, pilot and referee, stepped in one thread as fast as
the machine allows."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from app.episode.ablation import Ablation, ablate, segmenter_for
from app.episode.informed_baseline import SensorModel
from app.episode.report import EpisodeRecord, Sample, report_of
from app.runtime.fault_injection import FaultInjector
from app.runtime.robot_controller import COMMAND_PERIOD_S, OperatorState, RobotController
from app.runtime.segmentation import Perception, colour_perception
from app.runtime.stage_timer import StageTimer
from navcore.config.navigator import NavigatorConfig
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, wrap_angle
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Goal, Mission, Phase
from navcore.mission.zone import Zone
from navcore.navigator import Navigator, Stages, TickResult
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.safety.gate import GateDecision
from navcore.warmup import warm_up
from sim.referee.detections import DetectionScore
from sim.scenario.schema import Scenario, map_grid
from sim.sensors.camera import FIELD_OF_VIEW_DEG
from sim.simulator import Simulator

STANDS, STANDS_M, STANDS_RAD = 60, 0.05, 0.05
"""A robot that has moved less than this for so many samples stands for good."""
SERIES_PERIOD_S = 1.0


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
        where = (
            f"goal {self.goal.id} ({self.goal.x_m:g}, {self.goal.y_m:g}), {self.distance_m:5.1f} m"
            if self.goal
            else "done"
        )
        return f"{self.goals_done} of {self.goals} goals, {where}, {self.sim_time_s:5.0f} s"


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
        as_found: bool = False,
        zones: tuple[tuple[tuple[float, float], ...], ...] = (),
        ablation: Ablation = Ablation.NONE,
        stages: Stages | None = None,
    ) -> None:
        """Without a perception the colour rules look for what is to beware of.

        `as_found`: a seed has made its changes to the scenario already. `zones`: polygons that the
        operator has drawn.
        """
        self.seed, self.zones, self.ablation, self._max_time_s = seed, zones, ablation, max_time_s
        self.spec = spec = map_grid(scenario)
        mission = Mission()
        for x_m, y_m in goals or scenario.goals:
            mission = mission.add(x_m, y_m, spec)
        if not mission.queue:
            raise BadConfiguration(
                f"scenario {scenario.name!r} has no goals of its own; give --goal X,Y"
            )
        self.goals = mission.queue
        self.simulator = Simulator(
            scenario, seed=seed, camera_size=camera_size, robot=robot, as_found=as_found
        )
        self.scenario, profile = self.simulator.scenario, self.simulator.profile
        self.simulator.referee.set_zones([np.array(zone) for zone in zones])
        config, perception = config or NavigatorConfig(), perception or colour_perception()
        self.inflation_m = profile.width_m / 2 + config.safety_margin_m
        """Room that the robot's middle keeps from everything."""
        across_rad = math.radians(FIELD_OF_VIEW_DEG[0])
        self.eyes = SensorModel(
            ahead_m=profile.camera.x_m, angle_rad=across_rad, range_m=config.points.max_range_m
        )
        """What is in the robot's view."""
        self._segmenter = segmenter_for(ablation, perception.segmenter, self.simulator)
        self.seen_by = (
            perception.identity if self._segmenter is perception.segmenter else str(ablation)
        )
        """What labels the pictures."""
        self._fault_injector = FaultInjector(lambda: self.simulator.faults, lambda: self.now_s)
        self.timer = StageTimer()
        """Durations of ticks and stages."""
        stages = self._fault_injector.wrap(ablate(stages or Stages(), ablation, profile, config))
        navigator = Navigator(
            spec=spec,
            profile=profile,
            segmenter=self._segmenter,
            config=config,
            stages=self.timer.wrap(stages),
        )
        drawn = () if ablation is Ablation.NO_ZONES else zones
        told = tuple(
            Zone(id=f"zone {i}", name=f"zone {i}", polygon=polygon)
            for i, polygon in enumerate(drawn, start=1)
        )
        self.pilot = RobotController(
            navigator=navigator,
            profile=profile,
            intent=OperatorState(mission=mission, beware=beware, zones=told),
            timer=self.timer,
        )
        self.finds = DetectionScore(self.scenario)
        """What came into view."""
        self._thinks_of: Frame | None = None
        self._thinks_until_s = 0.0
        self.on_verdict: Callable[[float, GateDecision], None] = lambda t_s, verdict: None
        """Told of each command as it is sent, with the simulated time."""
        self.on_decision: Callable[[float, TickResult], None] = lambda t_s, decision: None
        """Told of each tick's outcome, with the simulated time."""
        self.arrived: dict[int, float] = {}
        """Number of a goal → how far from it the robot truly was when it said that it was there …
        """
        self.believed: dict[int, float] = {}
        """… and how far by its odometry."""
        self.samples: list[Sample] = []
        """One a second."""
        self.driven: list[tuple[float, float]] = []
        """(x, y) where the robot truly was, once a command."""

    def run(
        self,
        on_progress: Callable[[Progress], None] = lambda progress: None,
        ended: Callable[[Simulator], bool] = lambda simulator: False,
        look_first_s: float = 0.0,
    ) -> dict[str, Any]:
        """Drive until every goal is reached, the time is up or `ended` says so; the report of the
        contract.

        Before it sets out the robot stands and looks for `look_first_s`. A robot that then stands
        for a minute has ended, too.
        """
        warm_up(self._segmenter)
        started = time.perf_counter()
        frame = self._look(look_first_s)
        self.pilot.change_mission(Mission.start)
        next_command_s, next_sample_s, cut_short = 0.0, 0.0, False
        while self.pilot.intent.mission.phase is Phase.DRIVING and self.now_s < self._max_time_s:
            self.simulator.step()
            if cut_short := ended(self.simulator):
                break
            if self.simulator.newest_frame() is not frame:
                frame = self.simulator.newest_frame()
                self._begin_tick(frame)
            self._end_tick()
            if self.now_s >= next_command_s:
                next_command_s += COMMAND_PERIOD_S
                self._command()
            if self.now_s >= next_sample_s:
                next_sample_s += SERIES_PERIOD_S
                self._sample()
                on_progress(self._progress())
                if self.stands:
                    break
        self._sample()
        on_progress(self._progress())
        return report_of(self._record(time.perf_counter() - started, cut_short=cut_short))

    def _record(self, wall_time_s: float, *, cut_short: bool) -> EpisodeRecord:
        driving = self.pilot.intent.mission.phase is Phase.DRIVING
        stopped = "by its judge" if cut_short else "standing" if self.stands else "time"
        return EpisodeRecord(
            scenario=self.scenario,
            seed=self.seed,
            simulator=self.simulator,
            segmenter=self.seen_by,
            ablation=str(self.ablation),
            goals=self.goals,
            zones=self.zones,
            ended=stopped if driving else "all goals",
            sim_time_s=self.now_s,
            wall_time_s=wall_time_s,
            spec=self.spec,
            inflation_m=self.inflation_m,
            sensor=self.eyes,
            goal_errors_m=self.arrived,
            goal_errors_by_odometry_m=self.believed,
            detections=self.finds,
            samples=tuple(self.samples),
            timer=self.timer,
            beware=self.pilot.intent.beware,
            map=self.pilot.navigator.map,
        )

    @property
    def stands(self) -> bool:
        """Whether it has not moved for a minute: nothing that it can still try takes as long."""
        since = self.samples[-1 - STANDS :]
        here = since[-1].pose if len(since) > STANDS else None
        return here is not None and all(
            here.distance_to(sample.pose.x_m, sample.pose.y_m) < STANDS_M
            and abs(wrap_angle(sample.pose.yaw_rad - here.yaw_rad)) < STANDS_RAD
            for sample in since
        )

    def close(self) -> None:
        """Free the simulator."""
        self.simulator.close()

    @property
    def now_s(self) -> float:
        """Simulated time."""
        return self.simulator.now_ns() / 1e9

    def _look(self, seconds: float) -> Frame | None:
        """Stand and look for so long, at least until there is a picture; the last one thought
        about, None without any."""
        seen: Frame | None = None
        while (newest := self.simulator.newest_frame()) is None or self.now_s < seconds:
            if newest is not None and newest is not seen:
                seen = newest
                self._think(newest)
            self.simulator.step()
        return seen

    def _begin_tick(self, frame: Frame | None) -> None:
        """A tick takes no simulated time, unless a fault makes it; frames that come in meanwhile
        are missed."""
        if frame is not None:
            self.finds.observe(frame, self.simulator.true_pose().matrix() @ frame.T_base_camera)
        if self._thinks_of is None:
            self._thinks_of, self._thinks_until_s = (
                frame,
                self.now_s + self._fault_injector.delay_s(),
            )

    def _end_tick(self) -> None:
        if self._thinks_of is None or self.now_s < self._thinks_until_s:
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
        decision = self.pilot.think(frame, clock=self.simulator.now_ns)
        if decision is not None:
            self.on_decision(self.now_s, decision)
        if goal is not None and goal in self.pilot.intent.mission.reached:
            truly, believed = self.simulator.true_pose(), self.simulator.odometry()
            self.arrived[goal.id] = truly.distance_to(goal.x_m, goal.y_m)
            self.believed[goal.id] = believed.distance_to(goal.x_m, goal.y_m)

    def _command(self) -> None:
        newest = self.simulator.newest_frame()
        verdict = self.pilot.command(
            self.simulator.now_ns, COMMAND_PERIOD_S, self.simulator.send, newest=newest
        )
        self.on_verdict(self.now_s, verdict)
        pose = self.simulator.true_pose()
        self.driven.append((pose.x_m, pose.y_m))
        self.simulator.referee.note_stop(verdict.reasons[0].cause if verdict.reasons else None)

    def _sample(self) -> None:
        explored = self.pilot.navigator.map.explored
        self.samples.append(
            Sample(
                t_s=self.now_s,
                pose=self.simulator.true_pose(),
                explored_m2=explored.area_m2,
                explored_m3=explored.volume_m3,
            )
        )

    def _progress(self) -> Progress:
        goal, pose = self.pilot.intent.mission.goal, self.simulator.odometry()
        return Progress(
            goal=goal,
            goals_done=len(self.pilot.intent.mission.reached),
            goals=len(self.goals),
            distance_m=pose.distance_to(goal.x_m, goal.y_m) if goal else 0.0,
            sim_time_s=self.now_s,
            share=self._share(pose),
        )

    def _share(self, pose: Pose2) -> float:
        places = [
            (self.scenario.start[0], self.scenario.start[1]),
            *((goal.x_m, goal.y_m) for goal in self.goals),
        ]
        legs = [math.dist(here, there) for here, there in pairwise(places)]
        done = len(self.pilot.intent.mission.reached)
        left = pose.distance_to(*places[done + 1]) if done < len(legs) else 0.0
        return min(max(1.0 - (left + sum(legs[done + 1 :])) / max(sum(legs), 1e-9), 0.0), 1.0)
