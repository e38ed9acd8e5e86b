"""The operator console with the simulated robot: builds the parts, joins them, and takes them down in the right order."""

from __future__ import annotations

import secrets
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import torch

from app.episode import map_of
from app.operations import LiveOperations
from app.pilot import Intent, Pilot
from app.recorder import Recorder
from app.simulator_process import SimulatorProcess
from app.storage import Store
from app.threads import Loop
from navcore.beware import default_beware_list
from navcore.config import NavigatorConfig
from navcore.mission import Mission
from navcore.navigator import Decision, Navigator
from navcore.robot import HUSKY
from navcore.safety import Verdict
from navcore.segment import ColourSegmenter
from navcore.warmup import warm_up
from sim.husky import husky_urdf
from sim.scenario import load_scenario
from web.server import ConsoleServer

LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningConsole:
    """A console that runs."""

    url: str
    """Where a browser finds it; carries the login when there is one."""
    operations: LiveOperations
    """The system behind it."""


@contextmanager
def console(*, scenario: str, host: str, port: int, data: Path, seed: int) -> Iterator[RunningConsole]:
    """Start simulator, loop and server; stop them in the reverse order, the wheels first of all."""
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    world = load_scenario(scenario)
    store = Store(data)
    token = None if host in LOOPBACK else secrets.token_urlsafe(16)
    try:
        with ConsoleServer.reserve(host, port) as place:
            warm_up()
            robot = SimulatorProcess(scenario, seed=seed, profile=HUSKY)
            try:
                pilot = _pilot(store, map_of(world))
                recorder = Recorder(pilot=pilot, store=store, referee=robot, scenario=world.name)
                operations = LiveOperations(
                    robot=robot, pilot=pilot, store=store, recorder=recorder, world=world.name, robot_urdf=husky_urdf()
                )
    finally:
        store.close()


def run_console(*, scenario: str, host: str, port: int, data: Path, seed: int) -> None:
    """Serve until the process is asked to end."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    with console(scenario=scenario, host=host, port=port, data=data, seed=seed) as running:
        print(f"The console is at {running.url} (stop it with Ctrl-C).", flush=True)
        ended.wait()
