"""Drives on which something goes wrong, recorded command by command: what the figures of
`reliability` are made of."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from app.episode.episode import Episode
from app.runtime.fault_injection import FaultInjector
from app.runtime.loop import ControlLoop
from app.runtime.robot_controller import OperatorState, RobotController
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Mission
from navcore.navigator import Navigator, Stages
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause, GateDecision
from navcore.warmup import warm_up
from sim.scenario.load import load_scenario
from sim.scenario.schema import MapExtent, Scenario, map_grid
from sim.sensors.faults import Fault
from sim.simulator import Simulator

CAMERA = (212, 120)
"""Half of the camera's size: a drill is about stopping, not about seeing far."""
ROOM = "empty_room"
FRAME_S = 0.05
OPEN = Scenario(
    name="open floor",
    size_m=(24.0, 24.0),
    map=MapExtent(size_m=(24.0, 24.0)),
    start=(-8.0, 0.0, 0.0),
    goals=((8.0, 0.0),),
)
"""A floor without walls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent:
    """One command of a drive."""

    t_s: float
    """Simulated time."""
    moving: bool
    """Whether it was not zero."""
    causes: tuple[Cause, ...]
    """Why it was zero."""
    content_age_s: float
    """How old what the newest picture shows is in truth, whatever its stamp says."""
    map_version: int
    """Of the navigator's map."""


@dataclass
class Drill:
    """One episode, and every command of it."""

    episode: Episode
    """What is driven."""
    sent: list[Sent] = field(default_factory=list)
    """All commands, oldest first."""
    on_command: Callable[[float, Episode], None] = lambda t_s, episode: None
    """Called after each of them."""
    _shown: tuple[object, int] = (None, 0)

    def note(self, t_s: float, verdict: GateDecision) -> None:
        """One more command."""
        newest = self.episode.simulator.newest_frame()
        if newest is not None and newest.depth_m is not self._shown[0]:
            self._shown = (newest.depth_m, newest.stamp_ns)
        self.sent.append(
            Sent(
                t_s=t_s,
                moving=verdict.twist != STANDSTILL,
                causes=tuple(reason.cause for reason in verdict.reasons),
                content_age_s=t_s - self._shown[1] / 1e9,
                map_version=self.episode.pilot.navigator.map.version,
            )
        )
        self.on_command(t_s, self.episode)

    def between(self, from_s: float, until_s: float) -> list[Sent]:
        """The commands of a span of time."""
        return [sent for sent in self.sent if from_s <= sent.t_s < until_s]


def drill(
    *faults: Fault,
    seed: int,
    until_s: float,
    scenario: Scenario | None = None,
    on_command: Callable[[float, Episode], None] = lambda t_s, episode: None,
    stages: Stages | None = None,
) -> tuple[Drill, dict[str, object]]:
    """Drive for some simulated seconds with these faults; every command, and the episode's report."""
    world = dataclasses.replace(scenario or load_scenario(ROOM), faults=faults)
    episode = Episode(
        world,
        seed=seed,
        beware=default_beware_list(),
        max_time_s=until_s,
        camera_size=CAMERA,
        stages=stages,
    )
    record = Drill(episode=episode, on_command=on_command)
    episode.on_verdict = record.note
    try:
        report = episode.run()
    finally:
        episode.close()
    return record, report


def first_picture(seed: int = 0) -> Frame:
    """What the robot sees from the start of the room."""
    with Simulator(load_scenario(ROOM), seed=seed, camera_size=CAMERA) as simulator:
        return simulator.capture()


def standing_pilot(
    config: NavigatorConfig | None = None, stages: Stages | None = None
) -> RobotController:
    """A pilot in the room, with no goal yet."""
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
class Bench:
    """A robot on a bench, in real time: its wheels turn in the air, its camera always sees the
    same, with a little noise."""

    scene: Frame
    """What it sees."""
    pilot: RobotController | None = None
    """Whose commands it gets."""
    ages_s: list[float] = field(default_factory=list)
    """How old each command was that was not zero, as it was sent."""
    last: Twist = STANDSTILL
    """What was sent last."""
    newest: Frame | None = None
    """The last picture."""
    noise: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def now_ns(self) -> int:
        """The machine's monotonic clock."""
        return time.monotonic_ns()

    def newest_frame(self) -> Frame | None:
        """The last picture."""
        return self.newest

    def wait_frame(self, after: Frame | None, timeout_s: float) -> Frame | None:
        """The next picture."""
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
        """Note what comes."""
        command = self.pilot.thought.command if self.pilot is not None else None
        if twist != STANDSTILL and command is not None:
            self.ages_s.append((self.now_ns() - command.stamp_ns) / 1e9)
        self.last = twist

    def close(self) -> None:
        """Nothing to let go."""


@contextmanager
def bench(faults: Sequence[Fault]) -> Iterator[tuple[Bench, Callable[[], float]]]:
    """The console's threads on a bench, driving; `faults` may grow meanwhile, on the clock that is
    handed out."""
    warm_up()
    ended = threading.Event()
    began_s = time.monotonic()

    def now_s() -> float:
        return time.monotonic() - began_s if not ended.is_set() else float("inf")

    injector = FaultInjector(lambda: faults, now_s)
    injector.take_time(time.sleep)
    pilot = standing_pilot(stages=injector.wrap(Stages()))
    robot = Bench(
        scene=dataclasses.replace(first_picture(), pose=Pose2(x_m=-2.5, y_m=2.5, yaw_rad=0.0)),
        pilot=pilot,
    )
    pilot.change_mission(lambda mission: mission.add(2.0, 2.5, pilot.navigator.map.spec).start())
    loop = ControlLoop(
        robot, pilot, on_decision=lambda decision: None, on_verdict=lambda verdict: None
    )
    loop.start()
    try:
        yield robot, now_s
    finally:
        ended.set()
        loop.stop()
