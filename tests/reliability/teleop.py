"""Rows 12 and 13: the emergency stop through the API, and a teleoperating page that disappears."""

from __future__ import annotations

import functools
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
from tests.reliability.console_rig import BenchConsole, bench_console, wait_until
from tests.reliability.result import Measurement

SLOW = Twist(v_mps=0.3, w_radps=0.0)
SEND_S = 0.08
WATCH_S = 0.8
IDLE_S, LOADED_S = 0.05, 0.15


def emergency_stops(trials: int) -> Measurement:
    """Row 12: time from the press to the first zero, idle and loaded, and motion after it."""
    waits: dict[bool, list[float]] = {False: [], True: []}
    missed = 0
    uploads: list[int] = []
    with bench_console() as console, console.client() as button:
        for number in range(trials):
            loaded = number % 2 == 1
            files = (_many_zones, _one_ring)
            load = _loaded(console, files[number // 2 % 2](), uploads) if loaded else _idle()
            with load, _teleoperated(console):
                wait_until(lambda: console.robot.last != STANDSTILL)
                pressed_s = time.monotonic()
                button.post("/api/v1/stop", params={"by": "drill"}).raise_for_status()
                wait_until(lambda: console.robot.last == STANDSTILL)
                time.sleep(0.1)
                stood_s = console.robot.stands_since()
                missed += console.robot.last != STANDSTILL
            waits[loaded].append(stood_s - pressed_s)
            button.post("/api/v1/stop/reset").raise_for_status()
    p99_s = {
        loaded: float(np.quantile(values, 0.99)) if values else 0.0
        for loaded, values in waits.items()
    }
    return Measurement(
        trials=trials,
        measured=f"p99 {p99_s[False] * 1000:.0f} ms idle, {p99_s[True] * 1000:.0f} ms loaded, "
        f"{missed} missed, {len(uploads)} uploads",
        met=p99_s[False] <= IDLE_S
        and p99_s[True] <= LOADED_S
        and missed == 0
        and set(uploads) <= {REFUSED},
    )


def lost_teleop(trials: int) -> Measurement:
    """Row 13: time from the last timely velocity of a page to standstill; the page is closed,
    frozen, or its messages are delayed."""
    worst_s, drove = 0.0, 0
    with bench_console() as console:
        for number in range(trials):
            failures = (_closed, _frozen, _congested)
            with connect(_address(console), proxy=None) as page:
                last_s = failures[number % len(failures)](console, page)
                time.sleep(WATCH_S)
                drove += any(
                    twist != STANDSTILL
                    for at_s, twist in console.robot.sent
                    if at_s <= last_s + 0.1
                )
                stood_s = console.robot.stands_since()
            worst_s = max(worst_s, stood_s - last_s + braking_s(SLOW, HUSKY))
            wait_until(lambda: console.robot.last == STANDSTILL)
            console.robot.sent.clear()
    return Measurement(
        trials=trials,
        measured=f"stood at most {worst_s:.2f} s after the last message of the page, "
        f"braking included; drove before in {drove}",
        met=worst_s <= 0.5 and drove == trials,
    )


def _closed(console: BenchConsole, page: Connection) -> float:
    last_s = _drive(console, page)
    page.close()
    return last_s


def _frozen(console: BenchConsole, page: Connection) -> float:
    return _drive(console, page)


def _congested(console: BenchConsole, page: Connection) -> float:
    """Send a second of velocities in one burst, long after their time."""
    last_s = _drive(console, page)
    sent_s = [last_s + SEND_S * n for n in range(1, 12)]
    time.sleep(max(0.0, sent_s[-1] + 0.4 - time.monotonic()))
    for at_s in sent_s:
        _send(page, at_s)
    return last_s


def _drive(console: BenchConsole, page: Connection) -> float:
    """Drive for at least half a second; return the time of the last velocity."""
    deadline_s = time.monotonic() + 0.5
    last_s = 0.0
    while time.monotonic() < deadline_s or console.robot.last == STANDSTILL:
        last_s = time.monotonic()
        _send(page, last_s)
        time.sleep(SEND_S)
    return last_s


def _send(page: Connection, at_s: float) -> None:
    page.send(
        json.dumps({"type": "drive", "v_mps": SLOW.v_mps, "w_radps": 0.0, "t_ms": at_s * 1000})
    )


def _address(console: BenchConsole) -> str:
    return console.server.url.replace("http", "ws") + "/api/v1/control/live"


@contextmanager
def _teleoperated(console: BenchConsole) -> Iterator[None]:
    """Drive by hand continuously, whether stopped or not."""
    ended = threading.Event()

    def push() -> None:
        while not ended.wait(0.04):
            try:
                console.operations.drive(SLOW)
            except Refused:
                continue

    with _in_background(push, ended):
        yield


@contextmanager
def _loaded(console: BenchConsole, file: bytes, uploads: list[int]) -> Iterator[None]:
    """Upload a large file again and again, and append the status of each answer to `uploads`; once
    the first was refused as it must be, hang the planner, lock the database and stream the cloud,
    too."""
    ended, before = threading.Event(), len(uploads)

    def upload() -> None:
        headers = {"Content-Type": "application/json"}
        with console.client() as writer:
            while not ended.is_set():
                try:
                    answer = writer.post("/api/v1/zones/import", content=file, headers=headers)
                except httpx.HTTPError:
                    continue
                uploads.append(answer.status_code)

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

    with _in_background(upload, ended):
        wait_until(lambda: REFUSED in uploads[before:])
        now_s = console.now_s()
        console.faults.append(
            Fault(sensor="planner", kind="hang", from_s=now_s, until_s=now_s + 1.0)
        )
        locker = sqlite3.connect(console.store.path, isolation_level=None)
        locker.execute("BEGIN IMMEDIATE")
        try:
            with _in_background(stream, ended):
                yield
        finally:
            locker.close()


REFUSED = 422
RING = [[2.0, -3.0], [2.2, -3.0], [2.2, -2.8]]


@functools.cache
def _many_zones() -> bytes:
    """Return a file of 20 MB with as many zones as are imported at once; the first is none, so
    that it is read whole and refused."""
    angles = np.linspace(0.0, 2.0 * np.pi, 1000)
    ring = np.column_stack([np.cos(angles), np.sin(angles)]).tolist()
    features = [
        {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [corners]}}
        for corners in (RING[:1], *[ring] * 499)
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


@functools.cache
def _one_ring() -> bytes:
    """Return a file of 20 MB with one zone, which has too many corners."""
    ring = np.random.default_rng(0).uniform(-5.0, 5.0, (500_000, 2)).tolist()
    feature = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [ring]}}
    return json.dumps({"type": "FeatureCollection", "features": [feature]}).encode()


@contextmanager
def _idle() -> Iterator[None]:
    yield


@contextmanager
def _in_background(act: Callable[[], None], ended: threading.Event) -> Iterator[None]:
    thread = threading.Thread(target=act, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(5.0)
