"""Soak test of the console: what server and simulator hold while the robot drives for long.

The console runs in a process of its own and drives round the goals of a world, with its map open
in a headless Chromium where there is one. Every `PERIOD_S` the processes are looked at through
`/proc`, so only Linux is measured, and the state is asked for over HTTP, as any program may. Sizes
are proportional (PSS): pages that two processes share count half in each.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.table import Table

from app.bench.console.chromium import DevTools, NoBrowser, PageUse, page_use, watched_page
from app.bench.console.page import LATE, console_process, drive_around
from app.bench.console.process_use import ProcessUse, process_use
from app.runtime.record.provenance import machine, shipped_sha256, version
from app.runtime.start.segmenter_choice import Kind
from navcore.errors import BewareNavError
from navcore.files import write_whole
from sim.scenario.load import load_scenario

log = logging.getLogger(__name__)
PERIOD_S = 10.0
"""Time between two samples, seconds."""
POLL_S = 0.1
"""Time between two looks at the newest tick, seconds; images come every 0.1 s."""
WARM_UP_S = 600.0
"""Time after which nothing may grow any more, seconds; half of a shorter run."""
STOPS = 5
"""Number of stops whose latency is measured, at the start and at the end."""
LOOK_S = 0.005
"""Time between two looks for the command of zero after a stop, seconds."""
MOVING_S = 60.0
"""Longest wait for the robot to move before a stop, seconds."""
STOPPED_S = 5.0
"""Longest wait for a command of zero after a stop, seconds."""
WINDOW = (1280, 720)
"""Width and height of the browser's window, pixels."""
SETTLE_S = 5.0
"""Time in which the page is loaded, seconds."""
QUANTITIES = {
    "pss_mb": ("memory (PSS), MB", "{:.0f}"),
    "rss_mb": ("memory (RSS), MB", "{:.0f}"),
    "threads": ("threads", "{:.0f}"),
    "files": ("open files", "{:.0f}"),
    "sockets": ("of these, sockets", "{:.0f}"),
}
"""Field of `ProcessUse` → its name, and the format of its values."""


PAGE_QUANTITIES = {
    "pss_mb": ("Chromium's memory (PSS), MB", "{:.0f}"),
    "script_mb": ("memory of scripts, MB", "{:.1f}"),
    "elements": ("elements", "{:.0f}"),
}
"""The same of `PageUse`."""


class NotMeasured(BewareNavError):  # noqa: N818 - named after what happened, as all of them
    """The soak test needs Linux, or its console ended."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """One look at console and robot."""

    t_s: float
    """Time since the robot set off, seconds."""
    server: ProcessUse
    """The console's process."""
    simulator: ProcessUse
    """The simulator's process."""
    page: PageUse | None
    """The page with the map; None without a browser."""
    ticks_ms: tuple[float, ...]
    """Times of the ticks seen since the sample before, milliseconds."""
    ages_ms: tuple[float, ...]
    """Age of the picture that the robot acts on, at each look, milliseconds."""
    driving: float
    """Share of the looks at which the mission drove."""
    late: float
    """Share of the looks at which the gate held the robot for lateness."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """What is looked at."""

    program: httpx.Client
    """Client of the console's API."""
    server: int
    """Number of the console's process."""
    simulator: int
    """Number of the simulator's process."""
    page: DevTools | None
    """The page with the map, if there is a browser."""


def soak_table(
    scenario: str, seconds: float, *, segmenter: Kind = "network", record: Path | None = None
) -> Table:
    """Drive for `seconds`; write the samples to the file `record`, if given, and return their
    table.

    Raises `NotMeasured` on systems without `/proc` and when the console ends.
    """
    if not sys.platform.startswith("linux"):
        raise NotMeasured("the soak test is not run: it reads /proc, which only Linux has")
    goals = load_scenario(scenario).goals
    with console_process(scenario, segmenter=segmenter) as program:
        server, simulator = console_pids(os.getpid())
        title = program.get("/api/v1/state").json()["segmenter"]
        with _page(program) as page:
            watched = Watched(program=program, server=server, simulator=simulator, page=page)
            drive_around(program, goals)
            first_stops, last_stops = list(_stops_ms(program)), list[float]()
            samples = list[Sample]()
            try:
                samples.extend(_samples(watched, goals, seconds))
                last_stops += _stops_ms(program)
            finally:  # what was measured is kept, even if the end is missing
                if record is not None:
                    stops_ms = {"start": first_stops, "end": last_stops}
                    command = f"--scenario {scenario} --seconds {seconds:g} --segmenter {segmenter}"
                    _write(record, f"bewarenav bench soak {command}", title, stops_ms, samples)
    return _table(f"{scenario}, {title}, {seconds / 60:.1f} min", samples, first_stops, last_stops)


def _write(
    record: Path,
    command: str,
    segmenter: str,
    stops_ms: dict[str, list[float]],
    samples: Sequence[Sample],
) -> None:
    document = {
        "command": command,
        "version": version(),
        "machine": machine(),
        "date": time.strftime("%Y-%m-%d"),
        "segmenter": segmenter,
        "weights_sha256": shipped_sha256(),
        "stops_ms": stops_ms,
        "samples": [asdict(sample) for sample in samples],
    }
    write_whole(record, f"{json.dumps(document)}\n".encode())


def console_pids(root: int) -> tuple[int, int]:
    """Return the ids of the console that a process started and of its simulator; raises
    `NotMeasured` without them."""
    server = next((pid for pid in _children(root) if "console" in _arguments(pid)), None)
    if server is None:
        raise NotMeasured("the soak test is not run: the console did not start")
    size = {pid: process_use(pid).rss_mb for pid in _children(server)}
    if not size:
        raise NotMeasured("the soak test is not run: the console has no simulator")
    return server, max(size, key=lambda pid: size[pid])  # beside multiprocessing's small helper


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text().split()]


def process_tree(root: int) -> list[int]:
    """Return the ids of a process and of all that it and they started."""
    return [root, *(pid for child in _children(root) for pid in process_tree(child))]


def _arguments(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")


@contextmanager
def _page(program: httpx.Client) -> Iterator[DevTools | None]:
    """Show the map of the console; None without a browser."""
    try:
        with watched_page(f"{program.base_url}/#map", WINDOW) as page:
            time.sleep(SETTLE_S)
            yield page
    except NoBrowser as missing:
        log.warning("%s", missing)
        yield None


def _samples(
    watched: Watched, goals: tuple[tuple[float, float], ...], seconds: float
) -> Iterator[Sample]:
    began_s = time.monotonic()
    while (t_s := time.monotonic() - began_s) < seconds:
        looks = _looks(watched.program, min(PERIOD_S, seconds - t_s))
        ticks_ms = {look["picture_serial"]: look["tick_ms"] for look in looks}
        ages_s = [look["frame_age_s"] for look in looks if look["frame_age_s"] is not None]
        late = [any(reason["code"] in LATE for reason in look["reasons"]) for look in looks]
        driving = float(np.mean([look["phase"] == "driving" for look in looks]))
        try:
            yield Sample(
                t_s=round(time.monotonic() - began_s, 1),
                server=process_use(watched.server),
                simulator=process_use(watched.simulator),
                page=None if watched.page is None else page_use(watched.page),
                ticks_ms=tuple(ticks_ms.values()),
                ages_ms=tuple(round(1000 * age_s, 1) for age_s in ages_s),
                driving=driving,
                late=float(np.mean(late)),
            )
        except OSError:
            raise NotMeasured("the console ended during the soak test") from None
        if not driving:  # a goal that it gave up ended the mission
            set_off_again(watched.program, goals)


def set_off_again(program: httpx.Client, goals: tuple[tuple[float, float], ...]) -> None:
    """Send the robot round its goals; where the console refuses that, say why: the next sample
    tries again."""
    try:
        for goal in program.get("/api/v1/goals").json()["queue"]:
            program.delete(f"/api/v1/goals/{goal['id']}").raise_for_status()
        drive_around(program, goals)
    except httpx.HTTPStatusError as refused:
        log.warning("the robot does not set off: %s", refused.response.text)


def _looks(program: httpx.Client, seconds: float) -> list[dict[str, Any]]:
    """Return the states of the console in a while, at least one."""
    looks: list[dict[str, Any]] = []
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s or not looks:
        looks.append(_state(program))
        time.sleep(POLL_S)
    return looks


def _stops_ms(program: httpx.Client) -> Iterator[float]:
    """Stop the moving robot `STOPS` times and let it go on; yield the milliseconds from each
    request to the command of zero in the state. A robot that does not set off is not stopped."""
    for _ in range(STOPS):
        if not _waits(program, standing=False, seconds=MOVING_S):
            return
        began_s = time.perf_counter()
        program.post("/api/v1/stop").raise_for_status()
        stopped = _waits(program, standing=True, seconds=STOPPED_S)
        latency_ms = (time.perf_counter() - began_s) * 1e3
        program.post("/api/v1/stop/reset").raise_for_status()
        program.post("/api/v1/mission/resume").raise_for_status()
        yield round(latency_ms, 1) if stopped else float("inf")


def _waits(program: httpx.Client, *, standing: bool, seconds: float) -> bool:
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        command = _state(program)["command"]
        if (command["v_mps"] == 0 and command["w_radps"] == 0) == standing:
            return True
        time.sleep(LOOK_S if standing else POLL_S)
    return False


def _state(program: httpx.Client) -> dict[str, Any]:
    state: dict[str, Any] = program.get("/api/v1/state").json()
    return state


def growth_per_hour(times_s: Sequence[float], values: Sequence[float]) -> float:
    """Return the slope of the fitted line, per hour; 0 for fewer than two values."""
    if len(values) < 2:
        return 0.0
    return float(np.polyfit(np.array(times_s) / 3600, np.array(values), 1)[0])


def _table(
    title: str, samples: Sequence[Sample], first_stops: list[float], last_stops: list[float]
) -> Table:
    """Return the table: medians of a sixth of the samples at the start, after the warm-up and at
    the end, and the growth after the warm-up."""
    driving = np.mean([sample.driving for sample in samples])
    table = Table(
        "what",
        "start",
        "warmed up",
        "end",
        "growth per hour",
        title=f"{title}, driving {driving:.0%} of the time",
    )
    warm_s = min(WARM_UP_S, samples[-1].t_s / 2)
    warm = [sample for sample in samples if sample.t_s >= warm_s]
    count = max(1, len(samples) // 6)
    parts = (samples[:count], warm[:count], samples[-count:])
    times_s = [sample.t_s for sample in warm]
    processes = {"server": QUANTITIES, "simulator": QUANTITIES}
    if samples[0].page is not None:
        processes["page"] = PAGE_QUANTITIES
    for process, quantities in processes.items():
        for name, (words, form) in quantities.items():
            values = [getattr(getattr(sample, process), name) for sample in warm]
            medians = [
                float(np.median([getattr(getattr(sample, process), name) for sample in part]))
                for part in parts
            ]
            growth = growth_per_hour(times_s, values)
            table.add_row(
                f"{process}: {words}", *(form.format(value) for value in medians), f"{growth:+.1f}"
            )
    ticks = [[ms for sample in part for ms in sample.ticks_ms] for part in parts]
    ages = [[ms for sample in part for ms in sample.ages_ms] for part in parts]
    late = [float(np.mean([sample.late for sample in part])) for part in parts]
    table.add_row("tick p99, ms", *(_percentile(times, 99) for times in ticks), "")
    table.add_row("age of the picture p95, ms", *(_percentile(times, 95) for times in ages), "")
    table.add_row("held for lateness", *(f"{share:.1%}" for share in late), "")
    table.add_row(
        "stop, longest, ms", _percentile(first_stops, 100), "", _percentile(last_stops, 100), ""
    )
    return table


def _percentile(values: Sequence[float], share: float) -> str:
    return f"{np.percentile(values, share):.0f}" if values else "–"
