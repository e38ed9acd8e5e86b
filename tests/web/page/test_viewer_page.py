"""The 3D view as a hand and an eye meet it: a goal with a heading by drag, own layers, the robot
followed, and a background of the theme."""

from __future__ import annotations

import io
import math
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import BrowserContext, Page, expect

from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import eventually
from web.server import ConsoleServer


def open_3d(page: Page) -> tuple[float, float]:
    """Show the 3D view from above; returns the pixel in its middle."""
    page.get_by_test_id("view-3d").click()
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")
    page.get_by_test_id("look-top").click()
    box = page.get_by_test_id("view-3d-frame").bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_a_goal_gets_its_heading_by_drag_in_the_3d_view(
    page: Page, operations: FakeOperations
) -> None:
    x, y = open_3d(page)
    x, y = x - 80, y + 110  # free floor
    page.get_by_test_id("mode-goal").click()
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url))
    page.mouse.move(x, y)
    eventually(page, lambda: any(url.endswith("/preview") for url in sent))
    page.mouse.down()
    page.mouse.move(x + 10, y - 40, steps=4)
    page.mouse.move(x + 2, y - 90, steps=4)
    page.mouse.up()
    expect(page.get_by_test_id("goal")).to_have_count(1)
    (goal,) = operations.state().queue
    assert goal.yaw_rad is not None and abs(goal.yaw_rad - math.pi / 2) < 0.2
    # A click without a drag has no heading.
    page.mouse.click(x + 50, y + 20)
    expect(page.get_by_test_id("goal")).to_have_count(2)
    other = operations.state().queue[1]
    assert other.yaw_rad is None and other.x_m > goal.x_m and other.y_m < goal.y_m


def test_layers_and_following_are_remembered_by_the_browser(page: Page) -> None:
    open_3d(page)
    page.get_by_test_id("layers").click()
    page.get_by_test_id("layer-3d-floor").click()
    page.keyboard.press("Escape")
    follow = page.get_by_test_id("look-follow")
    expect(follow).to_have_attribute("aria-pressed", "false")
    follow.click()
    expect(follow).to_have_attribute("aria-pressed", "true")
    page.reload()
    expect(follow).to_have_attribute("aria-pressed", "true")
    expect(page.get_by_test_id("layer-3d-floor")).not_to_be_checked()
    expect(page.get_by_test_id("layer-3d-zones")).to_be_checked()


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_the_background_is_that_of_the_theme(
    theme: str, new_context: Callable[..., BrowserContext], server: ConsoleServer
) -> None:
    context = new_context(viewport={"width": 1280, "height": 720}, color_scheme=theme)
    page = context.new_page()
    page.goto(f"{server.url}/#3d")
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")
    stage = page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--stage')")
    wanted = np.frombuffer(bytes.fromhex(stage.strip()[1:]), dtype=np.uint8).astype(int)

    def is_behind() -> bool:
        shot = page.locator(".stage").screenshot()
        pixels = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)
        # From the south, the sky is in the upper corners.
        corners = [pixels[8, 8], pixels[8, -8]]
        return bool(np.abs(np.array(corners) - wanted).max() <= 3)

    eventually(page, is_behind)
