"""Times of the ticks of a driving console on two processor cores, as episodes replay them.

The console runs in a process of its own with the simulated robot and the network that it chooses by
itself, without a page and with one that shows its map; it is asked for its newest tick over HTTP.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.table import Table

from app.bench.console.chromium import NoBrowser, watched_page
from app.bench.console.page import LATE, console_process, drive_around
from app.runtime.record.provenance import machine, shipped_sha256, version
from navcore.errors import BewareNavError
from navcore.files import write_whole
from navcore.robot.camera_stream import CameraStream
from sim.scenario.load import load_scenario

CORES = 2
"""Number of processor cores that console and simulator share."""
SETTLE_S = 5.0
"""Time for which the robot drives before the first tick counts, seconds."""
PAGE_SIZE = (1440, 900)
"""Size of the page in pixels, width and height."""
POLL_S = 0.02
"""Time between two looks at the newest tick, seconds; images come every 0.1 s or more often."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Watch:
    """What was seen of a driving console."""

    ticks_ms: list[float]
    """Times of the ticks, in order."""
    ages_s: list[float]
    """Age of the image by which the motion was decided, at each look."""
    map_ages_s: list[float]
    """Age of the newest image on the map, with its labels, at each look."""
    driving_s: float
    """Time for which the robot drove, seconds."""
    held: float
    """Share of the looks at which lateness held the robot."""


def latency_table(
    scenario: str, seconds: float, *, camera: CameraStream | None = None, ticks: Path | None = None
) -> Table:
    """Drive the console's robot round the goals of a world for `seconds`, without a page and with
    its map open in Chromium, where that is installed; write the record of the first to the file
    `ticks`, if given, and return the figures of both."""
    watches = dict[str, _Watch]()
    with (
        _on_cores(CORES),
        console_process(scenario, segmenter="network", camera=camera) as program,
    ):
        drive_around(program, load_scenario(scenario).goals)
        time.sleep(SETTLE_S)
        segmenter = program.get("/api/v1/state").json()["segmenter"]
        watches["no page"] = watch_drive(program, seconds)
        load_average = round(os.getloadavg()[0], 1)
        with suppress(NoBrowser), watched_page(f"{program.base_url}/#map", PAGE_SIZE):
            time.sleep(SETTLE_S)
            watches["map open"] = watch_drive(program, seconds)
    record = {
        "command": f"bewarenav bench latency --scenario {scenario} --seconds {seconds:g}"
        + ("" if camera is None else f" --camera {camera}"),
        "version": version(),
        "machine": f"{machine()}, {CORES} of the cores used",
        "load_average": load_average,
        "date": time.strftime("%Y-%m-%d"),
        "segmenter": segmenter,
        "weights_sha256": shipped_sha256(),
        "ticks_ms": [round(duration, 1) for duration in watches["no page"].ticks_ms],
    }
    if ticks is not None:
        write_whole(ticks, f"{json.dumps(record)}\n".encode())
    images = "the console's camera" if camera is None else f"camera {camera}"
    title = f"console, {scenario}, {images}, {segmenter}, load average {load_average}"
    table = Table("while the robot drives", *watches, title=title)
    for name, row in (
        ("driving", [f"{one.driving_s / seconds:.0%} of the time" for one in watches.values()]),
        (
            "ticks a second",
            [f"{len(one.ticks_ms) / one.driving_s:.1f}" for one in watches.values()],
        ),
        ("tick, ms: p50, p95, p99", [_percentiles(one.ticks_ms) for one in watches.values()]),
        (
            "age of the image that decides, ms: p50, p95, p99",
            [_percentiles([1e3 * age_s for age_s in one.ages_s]) for one in watches.values()],
        ),
        (
            "age of the labels, ms: p50, p95, p99",
            [_percentiles([1e3 * age_s for age_s in one.map_ages_s]) for one in watches.values()],
        ),
        ("held for lateness", [f"{one.held:.1%}" for one in watches.values()]),
    ):
        table.add_row(name, *row)
    return table


def _percentiles(values: list[float]) -> str:
    return ", ".join(f"{value:.0f}" for value in np.percentile(values, [50, 95, 99]))


def watch_drive(program: httpx.Client, seconds: float) -> _Watch:
    """Look at the console while its robot drives; raises `BewareNavError` where it never does."""
    ticks_ms, ages_s, map_ages_s = dict[int, float](), list[float](), list[float]()
    late = list[bool]()
    looked_s, driving_s, state = time.monotonic(), 0.0, dict[str, Any]()
    until_s = looked_s + seconds
    while time.monotonic() < until_s:
        state = program.get("/api/v1/state").json()
        since_s, looked_s = looked_s, time.monotonic()
        if state["phase"] == "driving":
            driving_s += looked_s - since_s
            ticks_ms.setdefault(state["picture_serial"], state["tick_ms"])
            ages_s.append(state["frame_age_s"])
            map_ages_s.append(state["map_age_s"])
            late.append(any(reason["code"] in LATE for reason in state["reasons"]))
        time.sleep(POLL_S)
    if not ticks_ms:
        reasons = " ".join(reason["text"] for reason in state["reasons"])
        raise BewareNavError(f"the robot did not drive: the mission is {state['phase']}. {reasons}")
    return _Watch(
        ticks_ms=list(ticks_ms.values()),
        ages_s=ages_s,
        map_ages_s=map_ages_s,
        driving_s=driving_s,
        held=float(np.mean(late)),
    )


@contextmanager
def _on_cores(count: int) -> Iterator[None]:
    """Let this process and those that it starts use so many cores; only Linux can."""
    if not sys.platform.startswith("linux"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(allowed)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
