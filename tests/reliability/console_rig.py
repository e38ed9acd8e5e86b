"""The whole console around a robot on a bench, in real time: for the figures about the door, the
stop and the hand."""

from __future__ import annotations

import dataclasses
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from app.console.operations import LiveOperations
from app.runtime.fault_injection import FaultInjector
from app.runtime.loop import ControlLoop
from app.runtime.recorder import Recorder
from app.runtime.segmentation import colour_perception
from app.storage import Store
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.navigator import Stages
from navcore.warmup import warm_up
from sim.sensors.faults import Fault
from tests.reliability.drills import Bench, first_picture, standing_pilot
from web.access import Access
from web.server import ConsoleServer

PATIENCE_S = 30.0
MIDDLE = Pose2(x_m=-2.5, y_m=2.5, yaw_rad=0.0)


@dataclass
class Wheels(Bench):
    """A bench that remembers every command, by the machine's monotonic clock."""

    sent: list[tuple[float, Twist]] = field(default_factory=list)
    """(seconds, velocity), oldest first."""

    def send(self, twist: Twist) -> None:
        """Note what comes."""
        super().send(twist)
        self.sent.append((time.monotonic(), twist))

    def stands_since(self) -> float:
        """Since when every command was zero."""
        for at_s, twist in reversed(self.sent):
            if twist != STANDSTILL:
                later = [other_s for other_s, _ in self.sent if other_s > at_s]
                return later[0] if later else float("inf")
        return float("-inf")


@dataclass(frozen=True, kw_only=True)
class BenchConsole:
    """A console that runs on a bench."""

    wheels: Wheels
    """What it sends to."""
    operations: LiveOperations
    """The system behind it."""
    server: ConsoleServer
    """Its door."""
    store: Store
    """What it keeps."""
    faults: list[Fault]
    """May grow; times are of `now_s`."""
    now_s: Callable[[], float]
    """Seconds since it began."""

    def client(self) -> httpx.Client:
        """A program that talks to it."""
        return httpx.Client(base_url=self.server.url, trust_env=False, timeout=PATIENCE_S)


@contextmanager
def bench_console(access: Access | None = None) -> Iterator[BenchConsole]:
    """Start it on a free port, with a data folder of its own."""
    warm_up()
    ended, faults = threading.Event(), list[Fault]()
    began_s = time.monotonic()

    def now_s() -> float:
        return time.monotonic() - began_s if not ended.is_set() else float("inf")

    injector = FaultInjector(lambda: faults, now_s)
    injector.take_time(time.sleep)
    pilot = standing_pilot(stages=injector.wrap(Stages()))
    wheels = Wheels(scene=dataclasses.replace(first_picture(), pose=MIDDLE), pilot=pilot)
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        store = Store(Path(folder))
        stack.callback(store.close)
        recorder = Recorder(pilot=pilot, store=store, referee=None, scenario="bench")
        operations = LiveOperations(
            robot=wheels,
            pilot=pilot,
            store=store,
            recorder=recorder,
            world="bench",
            robot_urdf=None,
            perception=colour_perception(),
            labelling=Path(folder) / "labelling",
            config=NavigatorConfig(),
        )
        loop = ControlLoop(
            wheels, pilot, on_decision=operations.note_decision, on_verdict=operations.note_verdict
        )
        loop.start()
        stack.callback(loop.stop)
        stack.callback(ended.set)
        server = ConsoleServer(operations, port=0, access=access or Access(ledger=store.audit))
        server.start()
        stack.callback(server.stop)
        console = BenchConsole(
            wheels=wheels,
            operations=operations,
            server=server,
            store=store,
            faults=faults,
            now_s=now_s,
        )
        patiently(lambda: operations.picture() is not None)
        yield console


def patiently(holds: Callable[[], bool]) -> None:
    """Wait until something holds; a bench on which it never does is broken."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not holds():
        if time.monotonic() > deadline_s:
            raise RuntimeError("the bench does not come to work")
        time.sleep(0.005)
