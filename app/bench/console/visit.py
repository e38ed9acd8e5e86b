"""A first visit of the page: bytes, times, memory, and the way to a first goal by clicks, in a
headless Chromium with an empty cache."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import httpx
from rich.table import Table

from app.bench.console.chromium import page_use
from navcore.errors import BewareNavError

if TYPE_CHECKING:
    from playwright.sync_api import Browser, CDPSession, Page, Position

WATCH_S = 20.0
"""Time over which bytes per second are counted."""
AHEAD_M = 1.5
"""Distance of the first goal, straight ahead of the robot."""
LONGEST_S = 60.0
PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? null"


class _Bytes:
    """What the page receives."""

    def __init__(self, session: CDPSession) -> None:
        self.http = self.socket = self.requests = 0
        session.on("Network.loadingFinished", self._loaded)
        session.on("Network.webSocketFrameReceived", self._frame)
        session.send("Network.enable")

    def _loaded(self, event: dict[str, Any]) -> None:
        self.http += int(event["encodedDataLength"])
        self.requests += 1

    def _frame(self, event: dict[str, Any]) -> None:
        self.socket += len(event["response"]["payloadData"])


def visit_table(program: httpx.Client, browser: Browser) -> Table:
    """Measure one visit of the map of a console whose robot stands."""
    table = Table("first visit, empty cache", "value", title="The page of the console")
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    session = page.context.new_cdp_session(page)
    received = _Bytes(session)
    began_s = time.monotonic()
    page.goto(f"{program.base_url}/#map")
    page.locator("[data-testid=connection] :text-is('live')").wait_for(
        state="attached", timeout=1000 * LONGEST_S
    )
    live_s = time.monotonic() - began_s
    canvas = page.locator("[data-testid=map-canvas][data-place]")
    canvas.wait_for(timeout=1000 * LONGEST_S)
    drawn_s = time.monotonic() - began_s
    table.add_row("first contentful paint", f"{page.evaluate(PAINT) / 1000:.2f} s")
    table.add_row("connected; the stop works", f"{live_s:.2f} s")
    table.add_row("map drawn; a goal can be picked", f"{drawn_s:.2f} s")
    table.add_row("until then: requests", f"{received.requests}")
    table.add_row("until then: HTTP, websocket", _kilobytes(received.http, received.socket))
    before = (received.http, received.socket)
    page.wait_for_timeout(1000 * WATCH_S)
    http, socket = (
        (now - then) / WATCH_S
        for now, then in zip((received.http, received.socket), before, strict=True)
    )
    table.add_row("a second, robot standing", _kilobytes(http, socket))
    clicks, seconds = _first_goal(page, program)
    table.add_row("clicks to the first goal", str(clicks))
    table.add_row("from the first click until the robot drives", f"{seconds:.2f} s")
    use = page_use(session)
    table.add_row("script memory, elements", f"{use.script_mb:.1f} MB, {use.elements}")
    table.add_row("processes of Chromium (PSS)", f"{use.pss_mb:.0f} MB")
    program.post("/api/v1/mission/cancel")
    page.close()
    return table


def _first_goal(page: Page, program: httpx.Client) -> tuple[int, float]:
    """Pick a goal ahead of the robot and start, by clicks; return their number and the time until
    the robot drives."""
    pose = program.get("/api/v1/state").json()["pose"]
    x_m = pose["x_m"] + AHEAD_M * math.cos(pose["yaw_rad"])
    y_m = pose["y_m"] + AHEAD_M * math.sin(pose["yaw_rad"])
    at = _on_canvas(page, x_m, y_m)
    clicks: list[Callable[[], None]] = [
        page.get_by_test_id("mode-goal").click,
        lambda: page.get_by_test_id("map-canvas").click(position=at),
        page.get_by_test_id("start").click,
    ]
    began_s = time.monotonic()
    for click in clicks:
        click()
    while program.get("/api/v1/state").json()["phase"] != "driving":
        if time.monotonic() - began_s > LONGEST_S:
            raise BewareNavError("the robot did not drive to the goal that was clicked")
        time.sleep(0.01)
    return len(clicks), time.monotonic() - began_s


def _on_canvas(page: Page, x_m: float, y_m: float) -> Position:
    """Return the pixel of the map's canvas at a point; the canvas says its scale and middle."""
    canvas = page.get_by_test_id("map-canvas")
    scale, middle_x, middle_y = map(float, (canvas.get_attribute("data-place") or "").split())
    box = canvas.bounding_box()
    if box is None:
        raise BewareNavError("the map is not on the screen")
    return {
        "x": box["width"] / 2 + (x_m - middle_x) * scale,
        "y": box["height"] / 2 - (y_m - middle_y) * scale,
    }


def _kilobytes(http: float, socket: float) -> str:
    return f"{http / 1000:.1f}, {socket / 1000:.1f} kB"
