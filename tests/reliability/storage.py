"""Rows 14 to 17: stored data when processes die, disks fail, editors collide and clocks jump."""

from __future__ import annotations

import json
import random
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import httpx

from app.storage import Store
from navcore.errors import StorageFailed
from navcore.mission.zone import Zone
from tests.reliability.console_rig import BenchConsole, bench_console
from tests.reliability.fault_runs import fault_run
from tests.reliability.result import Measurement

CORNERS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
MARKS = 4
HOUR_S = 3600.0


def kills(trials: int, *, kind: str = "store") -> Measurement:
    """Row 14: acknowledged saves that are lost after `kill -9`; `kind` "file" is the control."""
    with tempfile.TemporaryDirectory() as folder:
        worker = [
            sys.executable,
            "-m",
            "tests.reliability.kill_worker",
            folder,
            str(trials),
            "0",
            kind,
        ]
        counts = json.loads(
            subprocess.run(worker, check=True, capture_output=True, text=True).stdout
        )
    return Measurement(
        trials=trials,
        measured=f"{counts['lost']} of {counts['acknowledged']} acknowledged saves lost",
        met=counts["lost"] == 0 and counts["acknowledged"] >= trials,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DiskFault:
    """A condition under which a disk does not accept writes."""

    name: str
    """Name of the condition."""
    begin: Callable[[Store], object]
    """Function that causes the condition."""
    end: Callable[[Store], object]
    """Function that ends the condition."""


def _pragma(text: str) -> Callable[[Store], object]:
    return lambda store: store._database._connection.execute(f"PRAGMA {text}")


def _fill(store: Store) -> None:
    pages = store._database.rows("PRAGMA page_count")[0][0]
    store._database._connection.execute(f"PRAGMA max_page_count = {pages}")


DISK_FAULTS = (
    DiskFault(name="full", begin=_fill, end=_pragma("max_page_count = 1000000")),
    DiskFault(name="read-only", begin=_pragma("query_only = ON"), end=_pragma("query_only = OFF")),
)


def refusing_disks(trials: int) -> Measurement:
    """Row 15: the disk is full, read-only, or the database locked by another process."""
    kept = 0
    for number in range(trials):
        with tempfile.TemporaryDirectory() as folder:
            store = Store(Path(folder))
            zones = tuple(Zone(id=f"z{n}", name="n" * 50, polygon=CORNERS) for n in range(5))
            for zone in zones:
                store.site.save_zone(zone)
            with _failing_disk(store, number):
                refused = (
                    all(_is_refused(store, n) for n in range(100, 103))
                    and store.site.zones() == zones
                )
            more = Zone(id="more", name="n", polygon=CORNERS)
            store.site.save_zone(more)
            kept += refused and store.site.zones() == (*zones, more)
            store.close()
    measured = f"refused with a reason, old data whole, and saved again afterwards: {kept}"
    return Measurement(trials=trials, measured=measured, met=kept == trials)


@contextmanager
def _failing_disk(store: Store, number: int) -> Iterator[None]:
    if number % 3 == 2:
        locker = sqlite3.connect(store.path, isolation_level=None)
        locker.execute("BEGIN IMMEDIATE")
        yield
        locker.close()
        return
    fault = DISK_FAULTS[number % 3]
    fault.begin(store)
    yield
    fault.end(store)


def _is_refused(store: Store, number: int) -> bool:
    try:
        store.site.save_zone(Zone(id=f"z{number}", name="n" * 5000, polygon=CORNERS))
    except StorageFailed as refusal:
        return "not saved" in str(refusal)
    return False


def two_editors(trials: int, *, careful: bool = True) -> Measurement:
    """Row 16: two operators add marks to the name of one zone at random moments; a missing mark is
    a lost update."""
    lost, collisions = 0, 0
    with bench_console() as console:
        for number in range(trials):
            zone_id = _new_zone(console)
            editors = [
                _Editor(console, zone_id, mark, careful, seed=2 * number + n)
                for n, mark in enumerate("ab")
            ]
            threads = [threading.Thread(target=editor.run) for editor in editors]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            name = {zone.id: zone.name for zone in console.operations.zones.stored}[zone_id]
            lost += 2 * MARKS - sum(name.count(mark) for mark in "ab")
            collisions += sum(editor.collisions for editor in editors)
            console.operations.zones.delete(zone_id)
    return Measurement(
        trials=trials,
        measured=f"{collisions} edits refused with both versions, {lost} lost",
        met=lost == 0,
    )


def _new_zone(console: BenchConsole) -> str:
    with console.client() as program:
        ring = [[2.0, -3.0], [2.2, -3.0], [2.2, -2.8]]
        zone = {"name": "-", "geometry": {"type": "Polygon", "coordinates": [ring]}}
        return str(program.post("/api/v1/zones", json=zone).raise_for_status().json()["id"])


class _Editor:
    """One operator: reads, waits, writes, and retries after a conflict."""

    def __init__(
        self, console: BenchConsole, zone_id: str, mark: str, careful: bool, *, seed: int
    ) -> None:
        self._console, self._path, self._mark, self._careful = (
            console,
            f"/api/v1/zones/{zone_id}",
            mark,
            careful,
        )
        self._rng = random.Random(seed)
        self.collisions = 0

    def run(self) -> None:
        """Add all marks."""
        with self._console.client() as program:
            for _ in range(MARKS):
                while not self._added(program):
                    self.collisions += 1

    def _added(self, program: httpx.Client) -> bool:
        read = program.get(self._path)
        zone = read.json()
        zone["properties"]["name"] += self._mark
        time.sleep(self._rng.uniform(0.0, 0.004))
        headers = {"If-Match": read.headers["etag"]} if self._careful else {}
        answer = program.put(self._path, json=zone, headers=headers)
        if answer.status_code == 409:
            body = answer.json()
            assert (
                body["stored_version"] != body["given_version"]
                and body["stored"]["id"] == zone["id"]
            )
            return False
        answer.raise_for_status()
        return True


def jumping_clocks(trials: int) -> Measurement:
    """Row 17: the same run with the wall clock an hour off, and off by another hour in the middle
    of it."""
    differences = 0
    for seed in range(trials):
        plain, jumped = _commands(seed, 0.0), _commands(seed, HOUR_S if seed % 2 else -HOUR_S)
        differences += plain != jumped
    return Measurement(
        trials=trials, measured=f"{differences} drives with another command", met=differences == 0
    )


def _commands(seed: int, off_s: float) -> list[object]:
    real_s, real_ns = time.time, time.time_ns
    began_s = time.monotonic()

    def wall_s() -> float:
        return real_s() + off_s * (1 + (time.monotonic() - began_s > 1.0))

    with (
        patch("time.time", wall_s),
        patch("time.time_ns", lambda: real_ns() + round(1e9 * (wall_s() - real_s()))),
    ):
        record, _ = fault_run(seed=seed, until_s=3.0)
    return list(record.sent)
