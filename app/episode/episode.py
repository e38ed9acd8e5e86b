"""A mission without a console: simulated robot, controller and referee, stepped in one thread as
fast as the machine allows."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from app.episode.ablation import Oracle, ablate, segmenter_for
from app.episode.ablations import Ablation
from app.episode.informed_baseline import SensorModel
from app.episode.latency import NO_LATENCY, Latency, TickSchedule
from app.episode.report import (
    PUSH_SETTLED_S,
    EpisodeRecord,
    Polygon,
    Sample,
    ToldPush,
    report_of,
)
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import COMMAND_PERIOD_S, RobotController
from app.runtime.control.stage_timer import StageTimer
from app.runtime.fault_injection import FaultInjector
from app.runtime.start.segmentation import Perception, colour_perception
from navcore.config.navigator import NavigatorConfig, config_for
from navcore.errors import BadConfiguration
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2, Twist, wrap_angle
from navcore.grid.grid import GridSpec
from navcore.localisation.estimate import LocalisationEstimate
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Goal, Mission, Phase
from navcore.mission.zone import Zone
from navcore.navigator import Navigator, TickResult
from navcore.robot.camera_stream import CameraStream
from navcore.robot.driver import Command
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, RobotProfile
from navcore.safety.gate import GateDecision
from navcore.stages import Stages
from navcore.warmup import warm_up
from sim.referee.detections import DetectionScore
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.schema import Scenario, map_grid
from sim.scenario.tags import given_tags
from sim.sensors.gnss_settings import GnssKind
from sim.simulator import Simulator

STUCK_SAMPLES, STUCK_M, STUCK_RAD = 60, 0.05, 0.05
"""Number of samples within which a stuck robot has moved less than this distance and angle."""
SERIES_PERIOD_S = 1.0
"""Time between two samples, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """Progress of an episode, for a progress bar."""

    goal: Goal | None
    """Present goal; None when all are reached."""
    goals_done: int
    """Number of goals reached so far."""
    goals: int
    """Total number of goals."""
    distance_m: float
    """Straight distance to the present goal, metres."""
    sim_time_s: float
    """Simulated time, seconds."""
    share: float
    """Completed share of the mission, 0 to 1, by straight distances."""

    def text(self) -> str:
        """Return one line for the progress bar."""
        where = (
            f"goal {self.goal.id} ({self.goal.x_m:g}, {self.goal.y_m:g}), {self.distance_m:5.1f} m"
            if self.goal
            else "done"
        )
        return f"{self.goals_done} of {self.goals} goals, {where}, {self.sim_time_s:5.0f} s"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EpisodeSettings:
    """Everything about an episode but its world and its seed."""

    beware: BewareList
    """Beware list of the operator."""
    goals: tuple[tuple[float, float], ...] = ()
    """Goals (x, y) in metres of the map frame; empty for those of the world."""
    config: NavigatorConfig | None = None
    """Configuration of the navigation; None for that of the robot."""
    max_time_s: float = 600.0
    """Simulated time in seconds after which the episode ends."""
    perception: Perception | None = None
    """Segmenter; None for the colour rules alone, as the configuration has them."""
    camera: CameraStream | None = None
    """Size and rate of the camera's images; None for those of the profile."""
    robot: RobotProfile = HUSKY
    """Profile of the platform."""
    randomised: bool = False
    """Whether the seed has changed the world already."""
    zones: tuple[Polygon, ...] = ()
    """Keep-out polygons (x, y) drawn by the operator, in metres of the map frame."""
    ablation: Ablation = Ablation.NONE
    """Part of the navigation that is left out."""
    odometry: OdometryGrade = OdometryGrade.TYPICAL
    """How good the odometry of the robot is."""
    latency: Latency = NO_LATENCY
    """Time that ticks take on the simulated clock."""
    start: Pose2 | None = None
    """True pose of the robot at the start; None for that of the world."""
    gnss: GnssKind | None = None
    """GNSS receiver of the robot; None for that of the world."""
    odometry_origin: Pose2 | None = None
    """Pose by odometry at the start; None for the true one."""
    stages: Stages = field(default_factory=Stages)
    """Stages of a tick, where some are to be replaced."""


class Episode:
    """One seeded mission from start to end; `run` returns the episode report."""

    def __init__(self, scenario: Scenario, settings: EpisodeSettings, *, seed: int) -> None:
        self.seed, self.zones, self.ablation = seed, settings.zones, settings.ablation
        self._max_time_s, self.latency = settings.max_time_s, settings.latency
        zones, ablation = settings.zones, settings.ablation
        robot = replace(settings.robot, stream=settings.camera or settings.robot.stream)
        spec = map_grid(scenario)
        mission = Mission()
        for x_m, y_m in settings.goals or scenario.goals:
            mission = mission.add(x_m, y_m, spec)
        if not mission.queue:
            raise BadConfiguration(
                f"scenario {scenario.name!r} has no goals of its own; give --goal X,Y"
            )
        self.goals = mission.queue
        self.simulator = Simulator(
            scenario,
            seed=seed,
            robot=robot,
            randomised=settings.randomised,
            start=settings.start,
            odometry=settings.odometry,
            odometry_origin=settings.odometry_origin,
            gnss=settings.gnss,
        )
        self.scenario, profile = self.simulator.scenario, self.simulator.profile
        self.simulator.referee.set_zones([np.array(zone) for zone in zones])
        config = settings.config or config_for(settings.robot)
        perception = settings.perception or colour_perception(config=config.perception)
        self.inflation_m = profile.width_m / 2 + config.safety_margin_m
        """Inflation radius: distance of the robot's centre from obstacles, metres."""
        lens = self.simulator.camera.intrinsics
        across_rad = 2 * math.atan(lens.width / 2 / lens.fx)
        self.sensor = SensorModel(
            ahead_m=profile.camera.x_m, angle_rad=across_rad, range_m=config.points.max_range_m
        )
        """Field of view of the camera."""
        self._segmenter = segmenter_for(ablation, perception.segmenter, self.simulator)
        self.segmenter_identity = (
            perception.identity if self._segmenter is perception.segmenter else str(ablation)
        )
        """Identity of the segmenter."""
        self._fault_injector = FaultInjector(lambda: self.simulator.faults, lambda: self.now_s)
        self.timer = StageTimer()
        """Durations of the ticks and their stages."""
        stages = self._fault_injector.wrap(ablate(settings.stages, ablation, profile, config))
        navigator = Navigator(
            spec=spec,
            profile=profile,
            segmenter=self._segmenter,
            config=config,
            stages=self.timer.wrap(stages),
        )
        navigator.localisation.tags = given_tags(self.scenario.tags)
        drawn = () if ablation is Ablation.NO_ZONES else zones
        told = tuple(
            Zone(id=f"zone {i}", name=f"zone {i}", polygon=polygon)
            for i, polygon in enumerate(drawn, start=1)
        )
        self.controller = RobotController(
            navigator=navigator,
            profile=profile,
            intent=OperatorState(mission=mission, beware=settings.beware, zones=told),
            timer=self.timer,
        )
        self.detections = DetectionScore(self.scenario)
        """Items that came into view."""
        delays_s = settings.latency.delays_s(seed)
        self._schedule = TickSchedule(lambda: next(delays_s) + self._fault_injector.delay_s())
        self._newest: Frame | None = None
        self._next_command_s = 0.0
        self.on_verdict: Callable[[float, GateDecision], None] = lambda t_s, verdict: None
        """Called with the simulated time in seconds and each command as it is sent."""
        self.on_decision: Callable[[float, TickResult], None] = lambda t_s, decision: None
        """Called with the simulated time in seconds and the result of each tick."""
        self.before_start: Callable[[], None] = lambda: None
        """Called when the robot has looked around, before its mission starts."""
        self.goal_errors_m: dict[int, float] = {}
        """True distance to each goal when it was reported reached, metres, by goal id."""
        self.odometry_errors_m: dict[int, float] = {}
        """Distance by odometry to each goal when it was reported reached, metres, by goal id."""
        self.estimate_errors_m: dict[int, float] = {}
        """Distance by the robot's estimate to each goal when it was reported reached, metres, by
        goal id."""
        self.pushes: list[ToldPush] = []
        """Pushes that the robot has noticed."""
        self._error_m = 0.0  # of the estimated position at the newest tick
        self.first_day: dict[str, Any] | None = None
        """How the kept map was made; None in a new map."""
        self.placed: Callable[[Points], Points] = lambda outline: outline
        """Returns where the map shows what an (N, 2) outline of the true world covers."""
        self.samples: list[Sample] = []
        """Samples of the episode, one per second."""
        self.driven: list[tuple[float, float]] = []
        """True positions (x, y) in metres of the map frame, one per command."""

    def run(
        self,
        on_progress: Callable[[Progress], None] = lambda progress: None,
        ended: Callable[[Simulator], bool] = lambda simulator: False,
        look_first_s: float = 0.0,
    ) -> dict[str, Any]:
        """Drive until every goal is reached, the time is over, the robot is stuck or `ended` says
        so; returns the episode report.

        The robot first stands and observes for `look_first_s` seconds.
        """
        warm_up(self._segmenter)
        started = time.perf_counter()
        self.observe(look_first_s)
        self.before_start()
        self.controller.change_mission(Mission.start)
        next_sample_s, cut_short = self._next_command_s, False
        while (
            self.controller.intent.mission.phase is Phase.DRIVING and self.now_s < self._max_time_s
        ):
            self.simulator.step()
            if cut_short := ended(self.simulator):
                break
            self._work()
            if self.now_s >= next_sample_s:
                next_sample_s += SERIES_PERIOD_S
                self._sample()
                on_progress(self._progress())
                if self.is_stuck:
                    break
        self._sample()
        on_progress(self._progress())
        return report_of(self._record(time.perf_counter() - started, cut_short=cut_short))

    def _record(self, wall_time_s: float, *, cut_short: bool) -> EpisodeRecord:
        return EpisodeRecord(
            scenario=self.scenario,
            seed=self.seed,
            simulator=self.simulator,
            segmenter=self.segmenter_identity,
            ablation=str(self.ablation),
            latency=self.latency.name,
            first_day=self.first_day,
            placed=self.placed,
            goals=self.goals,
            zones=self.zones,
            ended=self._end(cut_short=cut_short),
            sim_time_s=self.now_s,
            wall_time_s=wall_time_s,
            spec=self.spec,
            inflation_m=self.inflation_m,
            sensor=self.sensor,
            goal_errors_m=self.goal_errors_m,
            goal_errors_by_odometry_m=self.odometry_errors_m,
            goal_errors_by_estimate_m=self.estimate_errors_m,
            pushes=tuple(self.pushes),
            detections=self.detections,
            samples=tuple(self.samples),
            timer=self.timer,
            beware=self.controller.intent.beware,
            map=self.controller.navigator.map,
        )

    def _end(self, *, cut_short: bool) -> str:
        """Return why the episode ended."""
        phase = self.controller.intent.mission.phase
        if cut_short:
            return "by its judge"
        if phase is Phase.DRIVING:
            return "standing" if self.is_stuck else "time"
        # A robot that does not know its place stands until an operator resumes; here there is none.
        return "position lost" if phase is Phase.PAUSED else "all goals"

    @property
    def spec(self) -> GridSpec:
        """Present grid of the map."""
        return self.controller.navigator.map.spec

    @property
    def is_stuck(self) -> bool:
        """Whether the robot has not moved for a minute; no recovery takes as long."""
        since = self.samples[-1 - STUCK_SAMPLES :]
        here = since[-1].pose if len(since) > STUCK_SAMPLES else None
        return here is not None and all(
            here.distance_to(sample.pose.x_m, sample.pose.y_m) < STUCK_M
            and abs(wrap_angle(sample.pose.yaw_rad - here.yaw_rad)) < STUCK_RAD
            for sample in since
        )

    def close(self) -> None:
        """Close the simulator."""
        self.simulator.close()

    @property
    def now_s(self) -> float:
        """Simulated time, seconds."""
        return self.simulator.now_ns() / 1e9

    def drive_by_hand(self, twist: Twist, seconds: float) -> None:
        """Drive with a twist by teleoperation, through the gate, until the simulated time
        `seconds`."""
        while self.now_s < seconds:
            command = Command(twist=twist, stamp_ns=self.simulator.now_ns())
            self.controller.change(partial(replace, by_hand=command))
            self.simulator.step()
            self._work()

    def _work(self) -> None:
        """Process the newest frame and send a command, each when it is time."""
        self._receive()
        if (frame := self._schedule.advance(self._newest, self.now_s)) is not None:
            self._guarded(partial(self._think, frame), frame)
        if not self._schedule.is_overdue(self.now_s):
            steer = partial(self.controller.steer, self.simulator.now_ns, newest=self._newest)
            self._guarded(steer, self._newest)
        if self.now_s >= self._next_command_s:
            self._next_command_s += COMMAND_PERIOD_S
            self._command()

    def observe(self, seconds: float) -> None:
        """Stand and observe until the simulated time `seconds`, at least until the first frame;
        here ticks take no time, and commands begin afterwards."""
        while (newest := self.simulator.newest_frame()) is None or self.now_s < seconds:
            if newest is not None and newest is not self._newest:
                self._newest = newest
                self._note_truth(newest)
                self._schedule.skip(newest)
                self._guarded(partial(self._think, newest), newest)
            self.simulator.step()
        # Commands that were not due while the robot stood are not made up for.
        self._next_command_s = max(self._next_command_s, seconds)

    def _receive(self) -> None:
        """Take the newest frame, which is judged even if no tick gets it."""
        newest, taken = self.simulator.newest_frame(), self.simulator.taken_frame()
        if newest is None or newest is self._newest or taken is None:
            return
        self._newest = newest
        self._note_truth(newest)
        # A fault of the sensors must not decide what counts as seen.
        self.detections.observe(
            taken,
            self.simulator.true_pose().matrix() @ taken.T_base_camera,
            self.simulator.moving_poses()[: len(self.scenario.people)],
        )

    def _note_truth(self, frame: Frame) -> None:
        """Let an oracle see what the frame shows, as long as the simulator still shows it."""
        if isinstance(self._segmenter, Oracle):
            self._segmenter.look(frame)

    def _guarded(self, decide: Callable[[], None], frame: Frame | None) -> None:
        """Decide by a frame; only an injected fault may make it fail."""
        try:
            decide()
        except Exception as error:
            if not self.simulator.faults:
                raise
            self.controller.note_failure(frame, error)

    def _think(self, frame: Frame) -> None:
        goal = self.controller.intent.mission.goal
        decision = self.controller.think(frame, clock=self.simulator.now_ns)
        if decision is not None:
            self._note_push(decision.place)
            self.on_decision(self.now_s, decision)
        if (failed := self.controller.failed) is not None:
            raise failed
        if goal is not None and goal in self.controller.intent.mission.reached:
            truly, believed = self.simulator.true_pose(), self.simulator.dead_reckoning()
            (true_goal,) = (one for one in self.goals if one.id == goal.id)
            self.goal_errors_m[goal.id] = truly.distance_to(true_goal.x_m, true_goal.y_m)
            self.odometry_errors_m[goal.id] = believed.distance_to(true_goal.x_m, true_goal.y_m)
            self.estimate_errors_m[goal.id] = self.pose().distance_to(goal.x_m, goal.y_m)

    def _note_push(self, place: LocalisationEstimate) -> None:
        true, before_m = self.simulator.true_pose(), self._error_m
        self._error_m = place.T_map_base.distance_to(true.x_m, true.y_m)
        if place.pushed_m > 0.0:
            push = ToldPush(t_s=self.now_s, by_m=place.pushed_m, error_before_m=before_m)
            self.pushes.append(push)
        self.pushes = [
            replace(push, error_after_m=self._error_m)
            if self.now_s - push.t_s <= PUSH_SETTLED_S
            else push
            for push in self.pushes
        ]

    def _command(self) -> None:
        newest = self.simulator.newest_frame()
        verdict = self.controller.command(
            self.simulator.now_ns, COMMAND_PERIOD_S, self.simulator.send, newest=newest
        )
        self.on_verdict(self.now_s, verdict)
        pose = self.simulator.true_pose()
        self.driven.append((pose.x_m, pose.y_m))
        self.simulator.referee.note_stop(verdict.reasons[0].cause if verdict.reasons else None)

    def _sample(self) -> None:
        explored = self.controller.navigator.map.explored
        self.samples.append(
            Sample(
                t_s=self.now_s,
                pose=self.simulator.true_pose(),
                distance_m=self.simulator.referee.distance_m,
                explored_m2=explored.area_m2,
                explored_m3=explored.volume_m3,
            )
        )

    def _progress(self) -> Progress:
        goal, pose = self.controller.intent.mission.goal, self.pose()
        return Progress(
            goal=goal,
            goals_done=self.controller.intent.mission.reached_count,
            goals=len(self.goals),
            distance_m=pose.distance_to(goal.x_m, goal.y_m) if goal else 0.0,
            sim_time_s=self.now_s,
            share=self._share(pose),
        )

    def pose(self) -> Pose2:
        """Return T_map_base as the robot estimates it."""
        return self.controller.place.T_map_odom @ self.simulator.odometry()

    def _share(self, pose: Pose2) -> float:
        positions = [
            (self.scenario.start[0], self.scenario.start[1]),
            *((goal.x_m, goal.y_m) for goal in self.goals),
        ]
        legs = [math.dist(here, there) for here, there in pairwise(positions)]
        done = self.controller.intent.mission.reached_count
        left = pose.distance_to(*positions[done + 1]) if done < len(legs) else 0.0
        return min(max(1.0 - (left + sum(legs[done + 1 :])) / max(sum(legs), 1e-9), 0.0), 1.0)
