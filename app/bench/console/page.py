"""Cost of an open page: processor time of a headless Chromium beside the console with the simulated
robot.

The console runs in a process of its own, with the colour rules, so that the figures are those of
the page. Chromium has no graphics card: WebGL is drawn by the processor, which is the worst case.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import httpx
import numpy as np
from rich.table import Table

from app.bench.console.chromium import chromium, chromium_cpu_s
from app.bench.console.visit import visit_table
from navcore.errors import BewareNavError
from navcore.robot.camera_stream import CameraStream
from navcore.safety.gate import Cause
from sim.scenario.load import load_scenario
from web.port import reserve

if TYPE_CHECKING:
    from playwright.sync_api import Page

SETTLE_S = 8.0
POLL_S = 0.1
START_S = 600.0
KINDS = {"gpu-process": "gpu", "renderer": "page", "browser": "main", "utility": "net"}
"""Kind of a process of Chromium → the column of its share."""
LATE = {Cause.STALE_FRAME, Cause.STALE_COMMAND}
PAINTS = """Object.values(window.paints).reduce((sum, count) => sum + count, 0)
  + (document.getElementById("viewer")?.contentWindow.framesDrawn ?? 0)"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A state of page and robot in which the cost is measured."""

    title: str
    """First column of the table."""
    drives: bool
    """Whether the robot drives its scenario's goals, again and again."""
    view: str | None
    """Test id of the tab that is shown; None for no page at all."""


CONDITIONS = (
    Condition(title="no page, standing", drives=False, view=None),
    Condition(title="map, standing", drives=False, view="view-map"),
    Condition(title="3D view, standing", drives=False, view="view-3d"),
    Condition(title="no page, driving", drives=True, view=None),
    Condition(title="map, driving", drives=True, view="view-map"),
    Condition(title="3D view, driving", drives=True, view="view-3d"),
)


def page_tables(scenario: str, seconds: float) -> Iterator[Table]:
    """Yield the figures of a first visit, and the cost of every condition measured for `seconds`;
    raises `NoBrowser` without Chromium or Playwright."""
    columns = [*KINDS.values(), "all", "paints/s", "tick p50", "p95 ms", "late"]
    table = Table(
        "page, robot",
        *columns,
        title="Chromium's shares of a core in %; times of a tick; share of time held for lateness",
    )
    with chromium() as browser, console_process(scenario, segmenter="colour") as program:
        yield visit_table(program, browser)
        goals = load_scenario(scenario).goals
        for condition in CONDITIONS:
            if condition.drives:
                drive_around(program, goals)
            page = None
            if condition.view is not None:
                page = browser.new_page(viewport={"width": 1280, "height": 720})
                page.goto(f"{program.base_url}")
                page.get_by_test_id(condition.view).click()
                page.wait_for_timeout(1000 * SETTLE_S)
            table.add_row(condition.title, *_row(program, page, seconds))
            if page is not None:
                page.close()
    yield table


def _row(program: httpx.Client, page: Page | None, seconds: float) -> list[str]:
    began_s, used_before, painted = time.monotonic(), chromium_cpu_s(os.getpid()), _paints(page)
    ticks_ms, late = _watch(program, seconds)
    used, wall_s = chromium_cpu_s(os.getpid()), time.monotonic() - began_s
    shares = {kind: 100 * (used[kind] - used_before[kind]) / wall_s for kind in KINDS}
    figures = [*shares.values(), sum(shares.values()), (_paints(page) - painted) / wall_s]
    ticks = np.percentile(ticks_ms, [50, 95])
    return [
        *(f"{value:.1f}" for value in figures),
        *(f"{value:.0f}" for value in ticks),
        f"{late:.1%}",
    ]


def _paints(page: Page | None) -> int:
    return 0 if page is None else int(page.evaluate(PAINTS))


def _watch(program: httpx.Client, seconds: float) -> tuple[list[float], float]:
    """Times of the ticks in milliseconds, and the share of the time in which lateness held the
    robot."""
    ticks_ms: dict[int, float] = {}
    looks = late = 0
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        state: dict[str, Any] = program.get("/api/v1/state").json()
        ticks_ms[state["picture_serial"]] = state["tick_ms"]
        looks += 1
        late += any(reason["code"] in LATE for reason in state["reasons"])
        time.sleep(POLL_S)
    return list(ticks_ms.values()), late / looks


class NoConsole(BewareNavError):  # noqa: N818 -- as `NotMeasured`
    """The console that is to be measured does not run."""


@contextmanager
def console_process(
    scenario: str, *, segmenter: str, camera: CameraStream | None = None
) -> Iterator[httpx.Client]:
    """A console in a process of its own, by default with the camera that it chooses itself, and a
    program that talks to it; raises `NoConsole` when it ends, or sees nothing for ten minutes."""
    with reserve("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
    with tempfile.TemporaryDirectory() as data:
        command = [
            "console",
            "--scenario",
            scenario,
            "--segmenter",
            segmenter,
            "--port",
            str(port),
            "--data",
            data,
            *(() if camera is None else ("--camera", str(camera))),
        ]
        process = subprocess.Popen(
            [sys.executable, "-m", "app", *command],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            with httpx.Client(
                base_url=f"http://127.0.0.1:{port}", trust_env=False, timeout=30.0
            ) as program:
                if not _waits(lambda: process.poll() is not None or _answers(program)):
                    raise NoConsole(f"the console was not ready after {START_S:g} s")
                if process.poll() is not None:
                    raise NoConsole(
                        f"the console ended at its start, exit code {process.returncode}"
                    )
                yield program
        finally:
            process.terminate()
            process.wait()


def _answers(program: httpx.Client) -> bool:
    try:
        answer = program.get("/api/v1/state")
    except httpx.TransportError:
        return False
    # While the console starts, its port answers with a page that says what it waits for.
    return answer.is_success and answer.json()["picture_serial"] is not None


def _waits(holds: Callable[[], bool]) -> bool:
    until_s = time.monotonic() + START_S
    while not (held := holds()) and time.monotonic() < until_s:
        time.sleep(0.2)
    return held


def drive_around(program: httpx.Client, goals: tuple[tuple[float, float], ...]) -> None:
    """Send the robot round the goals, unless it is on its way."""
    if program.get("/api/v1/state").json()["phase"] == "driving":
        return
    for x_m, y_m in goals:
        program.post("/api/v1/goals", json={"x_m": x_m, "y_m": y_m}).raise_for_status()
    program.put("/api/v1/mission/loop", json={"loop": True}).raise_for_status()
    program.post("/api/v1/mission/start").raise_for_status()
