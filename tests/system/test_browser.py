"""One operator, one real Chromium, one running simulator: draw a zone, pick a goal, see the robot
arrive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import shapely
from playwright.sync_api import expect, sync_playwright

from app.console.application import RunningConsole
from tests.web.page.chromium import ARGUMENTS, CHROMIUM, NEEDS_BROWSER, await_map, click_map

PATIENCE_MS = 90_000
ZONE = ((-3.0, -0.6), (-2.2, -0.6), (-2.2, 0.2), (-3.0, 0.2))
GOAL = (-2.6, 2.4)

pytestmark = NEEDS_BROWSER


def test_an_operator_draws_a_zone_picks_a_goal_and_sees_the_robot_arrive_round_it(
    running: RunningConsole, client: httpx.Client, tmp_path: Path
) -> None:
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = chromium.new_page(viewport={"width": 1280, "height": 720})
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{running.url}/#map")
        expect(page.get_by_test_id("connection")).to_have_text("live")
        await_map(page)
        page.get_by_test_id("mode-draw").click()
        for corner in ZONE:
            click_map(page, *corner)
        page.get_by_test_id("zone-name").fill("Wet floor")
        page.get_by_test_id("zone-finish").click()
        expect(page.get_by_test_id("zone")).to_have_attribute("data-name", "Wet floor")
        page.get_by_test_id("mode-goal").click()
        click_map(page, *GOAL)
        expect(page.get_by_test_id("goal")).to_have_count(1)
        page.get_by_test_id("start").click()
        expect(page.get_by_test_id("state-badge")).to_contain_text("DRIVING")
        positions: list[dict[str, float]] = []
        state: dict[str, Any] = {"phase": "driving"}
        while state["phase"] == "driving":
            state = client.get("/api/v1/state").json()
            positions.append(state["pose"])
        expect(page.get_by_test_id("state-badge")).to_contain_text("IDLE")
        expect(page.get_by_test_id("goal-reached").last).to_be_visible()
        page.screenshot(path=tmp_path / "arrived.png")
        chromium.close()
    assert np.hypot(positions[-1]["x_m"] - GOAL[0], positions[-1]["y_m"] - GOAL[1]) < 0.3
    zone = shapely.Polygon(
        client.get("/api/v1/zones").json()["features"][0]["geometry"]["coordinates"][0]
    )
    assert zone.area == pytest.approx(0.64, rel=0.2)
    # The robot's centre keeps at least half its width from the zone in any orientation.
    assert min(zone.distance(shapely.Point(pose["x_m"], pose["y_m"])) for pose in positions) > 0.35
    run = client.get("/api/v1/runs").json()[0]
    assert (run["goals_reached"], run["zone_intrusions"], run["collisions"]) == (1, 0, 0)
