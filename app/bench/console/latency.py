"""Times of the ticks of a driving console on two processor cores, as episodes replay them.

The console runs in a process of its own with the simulated robot and the network that it chooses by
itself, and no open page; it is asked for its newest tick over HTTP.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.table import Table

from app.bench.console.page import console_process, drive_around
from app.runtime.record.provenance import machine, shipped_sha256, version
from navcore.files import write_whole
from sim.scenario.load import load_scenario

CORES = 2
"""Number of processor cores that console and simulator share."""
SETTLE_S = 5.0
"""Time for which the robot drives before the first tick counts, seconds."""
POLL_S = 0.05
"""Time between two looks at the newest tick, seconds; images come every 0.1 s."""


def latency_table(scenario: str, seconds: float, *, ticks: Path | None = None) -> Table:
    """Drive the console's robot round the goals of a world for `seconds`; write the record to the
    file `ticks`, if given, and return its figures."""
    with _on_cores(CORES), console_process(scenario, segmenter="network") as program:
        drive_around(program, load_scenario(scenario).goals)
        time.sleep(SETTLE_S)
        segmenter = program.get("/api/v1/state").json()["segmenter"]
        ticks_ms = _ticks_ms(program, seconds)
    record = {
        "command": f"bewarenav bench latency --scenario {scenario} --seconds {seconds:g}",
        "version": version(),
        "machine": f"{machine()}, {CORES} of the cores used",
        "load_average": round(os.getloadavg()[0], 1),
        "date": time.strftime("%Y-%m-%d"),
        "segmenter": segmenter,
        "weights_sha256": shipped_sha256(),
        "ticks_ms": [round(duration, 1) for duration in ticks_ms],
    }
    if ticks is not None:
        write_whole(ticks, f"{json.dumps(record)}\n".encode())
    p50, p95, p99 = np.percentile(ticks_ms, [50, 95, 99])
    table = Table("what", "figure", title=f"console, {scenario}, {segmenter}")
    table.add_row("ticks seen", f"{len(ticks_ms)} in {seconds:g} s")
    table.add_row("p50, ms", f"{p50:.0f}")
    table.add_row("p95, ms", f"{p95:.0f}")
    table.add_row("p99, ms", f"{p99:.0f}")
    table.add_row("load average of the machine", f"{record['load_average']}")
    return table


def _ticks_ms(program: httpx.Client, seconds: float) -> list[float]:
    """Return the times of the ticks seen while the robot drives, in order."""
    seen: dict[int, float] = {}
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        state: dict[str, Any] = program.get("/api/v1/state").json()
        if state["phase"] == "driving":
            seen.setdefault(state["picture_serial"], state["tick_ms"])
        time.sleep(POLL_S)
    return list(seen.values())


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
