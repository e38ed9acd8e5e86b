"""Rows 12 and 13 of the reliability page: the emergency stop through the door, and a hand that goes
away."""

from __future__ import annotations

import json
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import httpx
import numpy as np
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from navcore.errors import Refused
from navcore.geometry.transform import STANDSTILL, Twist
from navcore.robot.profile import HUSKY
from navcore.safety.collision_monitor import braking_s
from sim.sensors.faults import Fault
from tests.reliability.console_rig import BenchConsole, bench_console, patiently
from tests.reliability.result import Measurement

SLOWLY = Twist(v_mps=0.3, w_radps=0.0)
SEND_S = 0.08
WATCH_S = 0.8
IDLE_S, LOADED_S = 0.05, 0.15


def emergency_stops(trials: int) -> Measurement:
    """Row 12: from the press to the first zero, with nothing else to do and with everything at
    once; and nothing after it."""
    waits: dict[bool, list[float]] = {False: [], True: []}
    missed = 0
    with bench_console() as console, console.client() as button:
        for number in range(trials):
            loaded = number % 2 == 1
            with _load(console) if loaded else _nothing(), _pushed(console):
                patiently(lambda: console.wheels.last != STANDSTILL)
                pressed_s = time.monotonic()
                button.post("/api/v1/stop", params={"by": "drill"}).raise_for_status()
                patiently(lambda: console.wheels.last == STANDSTILL)
                time.sleep(0.1)
                stood_s = console.wheels.stands_since()
                missed += console.wheels.last != STANDSTILL
            waits[loaded].append(stood_s - pressed_s)
            button.post("/api/v1/stop/reset").raise_for_status()
    p99_s = {
        loaded: float(np.quantile(values, 0.99)) if values else 0.0
        for loaded, values in waits.items()
    }
    return Measurement(
        trials=trials,
        measured=f"p99 {p99_s[False] * 1000:.0f} ms idle, {p99_s[True] * 1000:.0f} ms loaded, {missed} missed",
        met=p99_s[False] <= IDLE_S and p99_s[True] <= LOADED_S and missed == 0,
    )


def lost_teleop(trials: int) -> Measurement:
    """Row 13: from a page's last word, or the last that is not late, to standstill; closed, frozen,
    and held up on the way."""
    worst_s, drove = 0.0, 0
    with bench_console() as console:
        for number in range(trials):
            ways = (_closed, _frozen, _held_up)
            with connect(_address(console), proxy=None) as page:
                last_s = ways[number % len(ways)](console, page)
                time.sleep(WATCH_S)
                drove += any(
                    twist != STANDSTILL
                    for at_s, twist in console.wheels.sent
                    if at_s <= last_s + 0.1
                )
                stood_s = console.wheels.stands_since()
            worst_s = max(worst_s, stood_s - last_s + braking_s(SLOWLY, HUSKY))
            patiently(lambda: console.wheels.last == STANDSTILL)
            console.wheels.sent.clear()
    return Measurement(
        trials=trials,
        measured=f"stood at most {worst_s:.2f} s after the page's last word, braking included; drove before in {drove}",
        met=worst_s <= 0.5 and drove == trials,
    )


def _closed(console: BenchConsole, page: Connection) -> float:
    last_s = _drive(console, page)
    page.close()
    return last_s


def _frozen(console: BenchConsole, page: Connection) -> float:
    return _drive(console, page)


def _held_up(console: BenchConsole, page: Connection) -> float:
    """A second's worth of velocities arrives in one burst, long after they were sent."""
    last_s = _drive(console, page)
    sent_s = [last_s + SEND_S * n for n in range(1, 12)]
    time.sleep(max(0.0, sent_s[-1] + 0.4 - time.monotonic()))
    for at_s in sent_s:
        _send(page, at_s)
    return last_s


def _drive(console: BenchConsole, page: Connection) -> float:
    """Drive for half a second at least; when the last velocity was sent."""
    deadline_s = time.monotonic() + 0.5
    last_s = 0.0
    while time.monotonic() < deadline_s or console.wheels.last == STANDSTILL:
        last_s = time.monotonic()
        _send(page, last_s)
        time.sleep(SEND_S)
    return last_s


def _send(page: Connection, at_s: float) -> None:
    page.send(
        json.dumps({"type": "drive", "v_mps": SLOWLY.v_mps, "w_radps": 0.0, "t_ms": at_s * 1000})
    )


def _address(console: BenchConsole) -> str:
    return console.server.url.replace("http", "ws") + "/api/v1/control/live"


@contextmanager
def _pushed(console: BenchConsole) -> Iterator[None]:
    """Somebody who goes on pushing the robot by hand, stop or no stop."""
    ended = threading.Event()

    def push() -> None:
        while not ended.wait(0.04):
            try:
                console.operations.drive(SLOWLY)
            except Refused:
                continue

    with _beside(push, ended):
        yield


@contextmanager
def _load(console: BenchConsole) -> Iterator[None]:
    """The planner hangs, the database is locked, and somebody streams the cloud."""
    ended = threading.Event()
    console.faults.append(
        Fault(sensor="planner", kind="hang", from_s=console.now_s(), until_s=console.now_s() + 1.0)
    )
    locker = sqlite3.connect(console.store.path, isolation_level=None)
    locker.execute("BEGIN IMMEDIATE")

    def stream() -> None:
        with console.client() as reader:
            while not ended.is_set():
                try:
                    reader.get("/api/v1/cloud.ply")
                    reader.post(
                        "/api/v1/zones",
                        json={"name": "z", "geometry": {"type": "Polygon", "coordinates": [RING]}},
                    )
                except httpx.HTTPError:
                    continue

    try:
        with _beside(stream, ended):
            yield
    finally:
        locker.close()


RING = [[2.0, -3.0], [2.2, -3.0], [2.2, -2.8]]


@contextmanager
def _nothing() -> Iterator[None]:
    yield


@contextmanager
def _beside(act: Callable[[], None], ended: threading.Event) -> Iterator[None]:
    thread = threading.Thread(target=act, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(5.0)
