"""The operator console of a robot, simulated or recorded: builds the parts, joins them, takes them down in the right order."""

from __future__ import annotations

import secrets
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import torch

from app.faults import Sabotage
from app.known_world import keep, recall
from app.operations import LiveOperations
from app.pilot import Intent, Pilot
from app.ports import taken_port
from app.recorder import Recorder
from app.robots import BackEnd, recorded, simulated
from app.segmenter import Perception, compose
from app.segmenter_choice import SegmenterChoice
from app.storage import Store
from app.threads import Clockwork, Loop, put_robot_first
from navcore.beware import default_beware_list
from navcore.config import NavigatorConfig, load_config
from navcore.grid import GridSpec
from navcore.mission import Mission
from navcore.navigator import Navigator
from navcore.robot import HUSKY
from navcore.warmup import warm_up
from sim.husky import husky_urdf
from web.access import Access
from web.access.attendance import Unattended
from web.access.roles import Role
from web.access.users import new_user
from web.server import ConsoleServer

EXPIRY_S = 1.0
"""How often the zones' expiry is looked at."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningConsole:
    """A console that runs."""

    url: str
    """Where a browser finds it."""
    operations: LiveOperations
    """The system behind it."""
    password: str | None = None
    """Of the first admin, who has just been made; nobody can look it up later."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsoleOptions:
    """What a console is started with."""

    scenario: str
    """Name of a built-in world, or a world file."""
    recording: Path | None = None
    """Folder of a recording that plays instead of the simulated robot."""
    level: bool = False
    """Its world has z up and the floor at 0: look for none."""
    data: Path
    """Folder for all that is kept."""
    host: str = "127.0.0.1"
    """Address to listen on; any but loopback asks for a login."""
    port: int = 8000
    """0 for a free one."""
    seed: int = 0
    """Of the simulator."""
    choice: SegmenterChoice = field(default_factory=SegmenterChoice)
    """What labels the pictures."""
    prior: Path | None = None
    """A Nav2 map whose obstacles count until they are seen free."""
    kept: Path | None = None
    """The map of an earlier session; it is written again at the end."""
    navigation: Path | None = None
    """How the navigation is set, as of `load_config`; None for as it comes."""
    login: bool = False
    """Ask for a login on loopback too."""
    unattended: Unattended = "go on"
    """What a mission does when whoever was in control has gone silent."""


@contextmanager
def console(options: ConsoleOptions, *, listener: socket.socket | None = None) -> Iterator[RunningConsole]:
    """Start simulator, loop and server; stop them in the reverse order, so that the wheels stand before anything goes."""
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    with ExitStack() as stack:
        listener = stack.enter_context(listener or taken_port(options.host, options.port))
        config = NavigatorConfig() if options.navigation is None else load_config(options.navigation)
        store = Store(options.data)
        stack.callback(store.close)
        perception = compose(options.choice)
        warm_up(perception.segmenter)
        back_end = _back_end(options, config)
        robot = back_end.robot
        stack.callback(robot.close)
        pilot, began_ns = _pilot(store, back_end.spec, perception, config), robot.now_ns()
        if back_end.faults:
            sabotage = Sabotage(pilot.navigator, lambda: back_end.faults, lambda: (robot.now_ns() - began_ns) / 1e9)
            sabotage.take_time(time.sleep)
        recall(pilot.navigator.map, pilot.intent.beware, prior=options.prior, kept=options.kept)
        stack.callback(lambda: keep(pilot.navigator.map, pilot.intent.beware, options.kept))  # when the loop has stopped
        recorder = Recorder(pilot=pilot, store=store, referee=back_end.referee, scenario=back_end.name)
        stack.callback(recorder.close)
        recorder.watch_zones(pilot.intent.zones)
        operations = LiveOperations(
            robot=robot,
            pilot=pilot,
            store=store,
            recorder=recorder,
            world=back_end.name,
            robot_urdf=husky_urdf(),
            perception=perception,
            labelling=options.data / "labelling",
            config=config,
        )
        expiry = Clockwork(operations.zones.expire, period_s=EXPIRY_S, name="expiry of zones")
        expiry.start()
        stack.callback(expiry.stop)
        operations.insight.start()
        stack.callback(operations.insight.stop)
        loop = Loop(robot, pilot, on_decision=operations.note_decision, on_verdict=operations.note_verdict)
        loop.start()
        stack.callback(loop.stop)
        locked = options.login or options.host not in LOOPBACK
        password = _first_admin(store) if locked else None
        access = Access.by_login(store.users, store.audit) if locked else Access(ledger=store.audit)
        server = ConsoleServer(
            operations, options.host, options.port, listener=listener, access=access, unattended=options.unattended
        )
        server.start()
        stack.callback(server.stop)
        put_robot_first()
        stack.callback(loop.stop)  # again, to be the first: the robot stands before anything goes
        yield RunningConsole(url=server.url, operations=operations, password=password)


def _first_admin(store: Store) -> str | None:
    """Where nobody can log in yet, somebody can from now on: the password, which is kept as a hash only."""
    if store.users.all():
        return None
    password = secrets.token_urlsafe(12)
    store.users.add(new_user("admin", Role.ADMIN, password))
    return password


def _back_end(options: ConsoleOptions, config: NavigatorConfig) -> BackEnd:
    if options.recording is not None:
        return recorded(options.recording, config=config, level=options.level)
    return simulated(options.scenario, seed=options.seed, profile=HUSKY)


def _pilot(store: Store, spec: GridSpec, perception: Perception, config: NavigatorConfig) -> Pilot:
    """A pilot that remembers the zones and the beware list of the last session, and stands."""
    navigator = Navigator(spec=spec, profile=HUSKY, segmenter=perception.segmenter, config=config)
    intent = Intent(mission=Mission(), beware=store.beware() or default_beware_list(), zones=store.zones())
    return Pilot(navigator=navigator, profile=HUSKY, intent=intent)


def run_console(options: ConsoleOptions, *, listener: socket.socket | None = None) -> None:
    """Serve until the process is asked to end."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    with console(options, listener=listener) as running:
        print(f"The console is at {running.url} (stop it with Ctrl-C).", flush=True)
        if running.password is not None:
            print(f"Log in as admin with the password {running.password} - it is shown this once.", flush=True)
        ended.wait()
