"""The whole console around a bench robot, in real time: for the measurements of security, stop and
teleoperation."""

from __future__ import annotations

import dataclasses
import functools
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from app.console.operations import LiveOperations
from app.runtime.control.loop import ControlLoop
from app.runtime.fault_injection import FaultInjector
from app.runtime.record.recorder import Recorder
from app.runtime.start.live_perception import LivePerception
from app.runtime.start.segmentation import colour_perception, compose
from app.storage import Store
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.robot.profile import HUSKY
from navcore.stages import Stages
from navcore.warmup import warm_up
from sim.sensors.faults import Fault
from tests.reliability.fault_runs import BenchRobot, first_frame, standing_controller
from web.auth.access import Access
from web.server import ConsoleServer

TIMEOUT_S = 30.0
BENCH_POSE = Pose2(x_m=-2.5, y_m=2.5, yaw_rad=0.0)


@dataclass
class RecordingRobot(BenchRobot):
    """A bench robot that records every command, on the monotonic clock of the machine."""

    sent: list[tuple[float, Twist]] = field(default_factory=list)
    """(seconds, velocity) of every command, oldest first."""

    def send(self, twist: Twist) -> None:
        """Record a command."""
        super().send(twist)
        self.sent.append((time.monotonic(), twist))

    def stands_since(self) -> float:
        """Return the time of the first command of the present unbroken run of zeros; infinite while
        the robot moves."""
        for at_s, twist in reversed(self.sent):
            if twist != STANDSTILL:
                later = [other_s for other_s, _ in self.sent if other_s > at_s]
                return later[0] if later else float("inf")
        return float("-inf")


@dataclass(frozen=True, kw_only=True)
class BenchConsole:
    """A console that runs on a bench robot."""

    robot: RecordingRobot
    """Robot that the console commands."""
    operations: LiveOperations
    """Operations behind the API."""
    server: ConsoleServer
    """Web server."""
    store: Store
    """Data store."""
    faults: list[Fault]
    """Injected faults, which may grow; times are on the clock of `now_s`."""
    now_s: Callable[[], float]
    """Function that returns the seconds since the start."""

    def client(self) -> httpx.Client:
        """Return an HTTP client of the console."""
        return httpx.Client(base_url=self.server.url, trust_env=False, timeout=TIMEOUT_S)


@contextmanager
def bench_console(access: Access | None = None) -> Iterator[BenchConsole]:
    """Start a console on a free port, with a data folder of its own."""
    warm_up()
    ended, faults = threading.Event(), list[Fault]()
    began_s = time.monotonic()

    def now_s() -> float:
        return time.monotonic() - began_s if not ended.is_set() else float("inf")

    injector = FaultInjector(lambda: faults, now_s)
    injector.take_time(time.sleep)
    controller = standing_controller(stages=injector.wrap(Stages()))
    robot = RecordingRobot(
        scene=dataclasses.replace(first_frame(), pose=BENCH_POSE), controller=controller
    )
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        store = Store(Path(folder))
        stack.callback(store.close)
        recorder = Recorder(controller=controller, store=store, referee=None, scenario="bench")
        operations = LiveOperations(
            robot=robot,
            controller=controller,
            store=store,
            recorder=recorder,
            robot_urdf=None,
            perception=LivePerception(colour_perception()),
            data=Path(folder),
            config=NavigatorConfig(),
            compose=functools.partial(compose, sensor=HUSKY.depth_sensor),
        )
        loop = ControlLoop(
            robot,
            controller,
            on_decision=operations.note_decision,
            on_verdict=operations.note_verdict,
        )
        loop.start()
        stack.callback(loop.stop)
        stack.callback(ended.set)
        server = ConsoleServer(operations, port=0, access=access or Access(audit_log=store.audit))
        server.start()
        stack.callback(server.stop)
        console = BenchConsole(
            robot=robot,
            operations=operations,
            server=server,
            store=store,
            faults=faults,
            now_s=now_s,
        )
        wait_until(lambda: operations.newest_tick() is not None)
        yield console


def wait_until(holds: Callable[[], bool]) -> None:
    """Wait until a condition holds; raise `RuntimeError` when it never does."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while not holds():
        if time.monotonic() > deadline_s:
            raise RuntimeError(f"the condition did not hold within {TIMEOUT_S:g} s")
        time.sleep(0.005)
