"""Runs with injected faults, recorded command by command: the raw data of the measurements of
`reliability`."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from app.episode.episode import Episode, EpisodeSettings
from app.runtime.control.loop import ControlLoop
from app.runtime.control.operator_state import OperatorState
from app.runtime.control.robot_controller import RobotController
from app.runtime.fault_injection import FaultInjector
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Mission
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.camera_stream import CameraStream
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause, GateDecision
from navcore.stages import Stages
from navcore.warmup import warm_up
from sim.scenario.load import load_scenario
from sim.scenario.schema import MapExtent, Scenario, map_grid
from sim.sensors.faults import Fault
from sim.simulator import Simulator

CAMERA = CameraStream(width=212, height=120)
"""Image size of the runs: half of the usual one, because they are about stopping, not about range.
"""
ROOM = "empty_room"
FRAME_S = 0.05
OPEN_FLOOR = Scenario(
    name="open floor",
    size_m=(24.0, 24.0),
    map=MapExtent(size_m=(24.0, 24.0)),
    start=(-8.0, 0.0, 0.0),
    goals=((8.0, 0.0),),
)
"""World of a floor without walls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SentCommand:
    """One command of a run."""

    t_s: float
    """Simulated time of the command."""
    moving: bool
    """Whether the velocity was not zero."""
    causes: tuple[Cause, ...]
    """Causes of a zero velocity."""
    content_age_s: float
    """True age of the content of the newest image, whatever its stamp says."""
    map_version: int
    """Version of the map of the navigator."""


@dataclass
class FaultRun:
    """One episode and all its commands."""

    episode: Episode
    """Episode of the run."""
    sent: list[SentCommand] = field(default_factory=list)
    """All commands, oldest first."""
    on_command: Callable[[float, Episode], None] = lambda t_s, episode: None
    """Called after each command with its time."""
    _shown: tuple[object, int] = (None, 0)

    def note(self, t_s: float, verdict: GateDecision) -> None:
        """Record one command."""
        newest = self.episode.simulator.newest_frame()
        if newest is not None and newest.depth_m is not self._shown[0]:
            self._shown = (newest.depth_m, newest.stamp_ns)
        self.sent.append(
            SentCommand(
                t_s=t_s,
                moving=verdict.twist != STANDSTILL,
                causes=tuple(reason.cause for reason in verdict.reasons),
                content_age_s=t_s - self._shown[1] / 1e9,
                map_version=self.episode.controller.navigator.map.version,
            )
        )
        self.on_command(t_s, self.episode)

    def between(self, from_s: float, until_s: float) -> list[SentCommand]:
        """Return the commands of an interval of time."""
        return [sent for sent in self.sent if from_s <= sent.t_s < until_s]


def fault_run(
    *faults: Fault,
    seed: int,
    until_s: float,
    scenario: Scenario | None = None,
    on_command: Callable[[float, Episode], None] = lambda t_s, episode: None,
    stages: Stages | None = None,
) -> tuple[FaultRun, dict[str, object]]:
    """Drive for `until_s` simulated seconds with these faults; return all commands, and the report
    of the episode."""
    world = dataclasses.replace(scenario or load_scenario(ROOM), faults=faults)
    episode = Episode(
        world,
        EpisodeSettings(
            beware=default_beware_list(),
            max_time_s=until_s,
            camera=CAMERA,
            stages=stages or Stages(),
        ),
        seed=seed,
    )
    record = FaultRun(episode=episode, on_command=on_command)
    episode.on_verdict = record.note
    try:
        report = episode.run()
    finally:
        episode.close()
    return record, report


def first_frame(seed: int = 0) -> Frame:
    """Return the frame at the start of the room."""
    with Simulator(load_scenario(ROOM), seed=seed, camera_size=CAMERA.size) as simulator:
        return simulator.capture()


def standing_controller(
    config: NavigatorConfig | None = None, stages: Stages | None = None
) -> RobotController:
    """Return a controller in the room that has no goal yet."""
    spec = map_grid(load_scenario(ROOM))
    navigator = Navigator(
        spec=spec,
        profile=HUSKY,
        segmenter=ColourSegmenter(),
        config=config or NavigatorConfig(),
        stages=stages,
    )
    return RobotController(
        navigator=navigator,
        profile=HUSKY,
        intent=OperatorState(mission=Mission(), beware=default_beware_list()),
    )


@dataclass
class BenchRobot:
    """A robot on a bench, in real time: its wheels turn in the air, and its camera always sees the
    same scene with a little noise."""

    scene: Frame
    """Frame of the scene."""
    controller: RobotController | None = None
    """Controller whose commands it gets."""
    ages_s: list[float] = field(default_factory=list)
    """Age of each non-zero command at the moment it was sent, in seconds."""
    last: Twist = STANDSTILL
    """Velocity that was sent last."""
    newest: Frame | None = None
    """Newest frame."""
    noise: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def now_ns(self) -> int:
        """Return the monotonic clock of the machine."""
        return time.monotonic_ns()

    def newest_frame(self) -> Frame | None:
        """Return the newest frame."""
        return self.newest

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame | None:
        """Return the next frame."""
        time.sleep(FRAME_S)
        rgb, depth_m = self.scene.rgb, self.scene.depth_m
        self.newest = dataclasses.replace(
            self.scene,
            stamp_ns=self.now_ns(),
            rgb=rgb ^ self.noise.integers(0, 2, rgb.shape, dtype=np.uint8),
            depth_m=depth_m * self.noise.uniform(0.999, 1.001, depth_m.shape).astype(np.float32),
            twist=self.last,
        )
        return self.newest

    def send(self, twist: Twist) -> None:
        """Record a command."""
        command = self.controller.tick_state.command if self.controller is not None else None
        if twist != STANDSTILL and command is not None:
            self.ages_s.append((self.now_ns() - command.stamp_ns) / 1e9)
        self.last = twist

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


@contextmanager
def bench_run(faults: Sequence[Fault]) -> Iterator[tuple[BenchRobot, Callable[[], float]]]:
    """Run the threads of the console on a driving bench robot; `faults` may grow meanwhile, on the
    yielded clock."""
    warm_up()
    ended = threading.Event()
    began_s = time.monotonic()

    def now_s() -> float:
        return time.monotonic() - began_s if not ended.is_set() else float("inf")

    injector = FaultInjector(lambda: faults, now_s)
    injector.take_time(time.sleep)
    controller = standing_controller(stages=injector.wrap(Stages()))
    robot = BenchRobot(
        scene=dataclasses.replace(first_frame(), pose=Pose2(x_m=-2.5, y_m=2.5, yaw_rad=0.0)),
        controller=controller,
    )
    controller.change_mission(
        lambda mission: mission.add(2.0, 2.5, controller.navigator.map.spec).start()
    )
    loop = ControlLoop(
        robot, controller, on_decision=lambda decision: None, on_verdict=lambda verdict: None
    )
    loop.start()
    try:
        yield robot, now_s
    finally:
        ended.set()
        loop.stop()
