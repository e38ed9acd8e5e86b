"""One operator, one real Chromium, one running simulator: a click into the camera image makes a
colour rule, its preview shows what it takes, applied it bends the path, undone it does not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest
from playwright.sync_api import Page, expect, sync_playwright

from app.console.application import ConsoleOptions, RunningConsole, console
from tests.system.conftest import BY_COLOUR, marked_room
from tests.web.page.chromium import ARGUMENTS, CHROMIUM, NEEDS_BROWSER, await_map, eventually

PATIENCE_MS = 90_000

pytestmark = NEEDS_BROWSER


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """A console in a room with a green marking between start and goal."""
    folder = tmp_path_factory.mktemp("marked")
    world = folder / "marked.toml"
    world.write_text(marked_room("green marking", (20, 170, 60), beware=False), encoding="utf-8")
    options = ConsoleOptions(scenario=str(world), port=0, data=folder / "data", choice=BY_COLOUR)
    with console(options) as started:
        yield started


def widest_m(program: httpx.Client) -> float:
    """Return how far the planned path leaves the straight line to the goal."""
    path = program.get("/api/v1/path").json()["path"]
    return float(np.abs(np.array(path)[:, 1]).max()) if path else float("nan")


def green_at(program: httpx.Client) -> tuple[float, float]:
    """Return the middle of what is green in the camera image, as shares of width and height."""
    data = np.frombuffer(program.get("/api/v1/camera.jpg").content, np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert image is not None
    blue, green, red = (image[..., channel].astype(int) for channel in range(3))
    rows, cols = np.nonzero((green > red + 40) & (green > blue + 40))
    assert len(rows) > 200
    return float(cols.mean()) / image.shape[1], float(rows.mean()) / image.shape[0]


def test_a_click_makes_a_colour_rule_that_bends_the_path_until_it_is_undone(
    marked: RunningConsole, tmp_path: Path
) -> None:
    expect.set_options(timeout=PATIENCE_MS)
    with (
        httpx.Client(base_url=marked.url, trust_env=False, timeout=60.0) as program,
        sync_playwright() as playwright,
    ):
        program.put("/api/v1/beware?force=true", json={"classes": []})
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = chromium.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{marked.url}/#map")
        expect(page.get_by_test_id("connection")).to_have_text("live")
        await_map(page)
        expect(page.get_by_test_id("beware-class")).to_have_count(0)
        page.get_by_test_id("goal-input").fill("2.5, 0")
        page.get_by_test_id("goal-add").click()
        expect(page.get_by_test_id("goal")).to_have_count(1)
        page.get_by_test_id("beware-add").click()
        expect(page.get_by_test_id("entry-eyes")).to_contain_text("Nothing can see it yet")
        page.get_by_test_id("entry-name").fill("green tape")
        page.get_by_test_id("entry-pick").click()
        click_image(page, *green_at(program))
        expect(page.get_by_test_id("entry-share")).to_contain_text("%")
        expect(page.get_by_test_id("camera-mask")).to_be_visible()
        expect(page.get_by_test_id("entry-note")).to_contain_text("cells appear")
        expect(page.get_by_test_id("entry-note")).to_contain_text("the path would be")
        page.screenshot(path=tmp_path / "preview.png")
        page.get_by_test_id("entry-apply").click()
        expect(page.get_by_test_id("beware-class")).to_have_count(1)
        page.get_by_test_id("start").click()
        eventually(page, lambda: widest_m(program) > 0.7)
        page.get_by_test_id("pause").click()
        expect(page.get_by_test_id("state-badge")).to_contain_text("PAUSED")
        page.get_by_test_id("map-canvas").focus()
        page.keyboard.press("Control+z")
        expect(page.get_by_test_id("beware-class")).to_have_count(0)
        page.get_by_test_id("resume").click()
        eventually(page, lambda: widest_m(program) < 0.4)
        page.get_by_test_id("cancel").click()
        chromium.close()


def click_image(page: Page, right: float, down: float) -> None:
    """Click the camera image with the mouse, at shares of its width and height."""
    box = page.get_by_test_id("camera").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + right * box["width"], box["y"] + down * box["height"])
