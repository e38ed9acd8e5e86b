"""What the page leaves unpainted in a real Chromium: counts of draws, frames and writes, never
processor time."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.web.fake_operations import FakeOperations
from tests.web.page.test_page import NO_BROWSER, await_map, browser, click_map, page  # noqa: F401 - fixtures
from web.server import ConsoleServer

pytestmark = pytest.mark.skipif(NO_BROWSER, reason="Debian's chromium is not installed")

WATCHED_S = 3.0
RESTED_S = 8.0
"""A frame of the 3D view can take seconds where a processor with other work draws it."""
MAX_DRAWS_PER_S = 10
WRITES = """window.writes = [];
const numbers = new WeakMap();
let last = 0;
const numbered = (node) => { if (!numbers.has(node)) numbers.set(node, last += 1); return numbers.get(node); };
new MutationObserver((records) => {
  for (const { target, type, attributeName } of records) if (target.id !== "camera") {
    const node = target.nodeType === 1 ? target : target.parentElement;
    window.writes.push(`${type} ${attributeName} ${node.tagName}#${node.id || node.className} ${numbered(node)}`);
  }
}).observe(document.body, { subtree: true, childList: true, characterData: true, attributes: true });"""
HIDE = """Object.defineProperty(document, "hidden", { get: () => true, configurable: true });
document.dispatchEvent(new Event("visibilitychange"));"""

SHOW = "delete document.hidden; document.dispatchEvent(new Event('visibilitychange'));"


def draws(page: Page) -> int:  # noqa: F811
    """How often the map was drawn so far."""
    return int(page.evaluate("window.paints.map"))


def frames(page: Page) -> int:  # noqa: F811
    """How many frames the 3D view was given so far."""
    return int(page.evaluate("document.getElementById('viewer').contentWindow.framesDrawn ?? 0"))


def eventually(page: Page, holds: Callable[[], bool]) -> None:  # noqa: F811
    """Wait until something holds; a frame of the 3D view takes seconds on a processor that has
    other work."""
    for _ in range(300):
        if holds():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it never came to hold")


def ask_frame(page: Page) -> None:  # noqa: F811
    """Ask for a frame of the 3D view, as whatever runs in it does; `is_given` says whether it came."""
    page.evaluate("""() => { const inside = document.getElementById("viewer").contentWindow;
      inside.given = false; inside.requestAnimationFrame(() => { inside.given = true; }); }""")


def is_given(page: Page) -> bool:  # noqa: F811
    """Whether the frame that was asked for has come."""
    return bool(page.evaluate("document.getElementById('viewer').contentWindow.given"))


def settle(page: Page) -> None:  # noqa: F811
    """Wait until the map stands and the first answers are in."""
    await_map(page)
    expect(page.get_by_test_id("age-map")).to_have_text(re.compile("<"))
    page.wait_for_timeout(1500)


def while_ticking(
    page: Page, operations: FakeOperations, seconds: float, act: Callable[[], None] = lambda: None
) -> None:  # noqa: F811
    """Let the robot's side deliver ten pictures a second."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        operations.step()
        act()
        page.wait_for_timeout(100)


def test_nothing_is_drawn_or_written_while_the_robot_stands(
    page: Page, operations: FakeOperations
) -> None:  # noqa: F811
    settle(page)
    while_ticking(page, operations, 1.0)
    before = draws(page)
    page.evaluate(WRITES)
    while_ticking(page, operations, WATCHED_S)
    assert draws(page) - before <= 1
    # The camera's picture is another one with each look; of all else what is new is written, and
    # not the same again and again.
    assert {
        what: count for what, count in Counter(page.evaluate("window.writes")).items() if count > 2
    } == {}


def test_a_robot_that_drives_is_drawn_and_not_oftener_than_ten_times_a_second(
    page: Page,  # noqa: F811
    operations: FakeOperations,
) -> None:
    settle(page)
    page.get_by_test_id("mode-goal").click()
    click_map(page, 6.0, 0.5)
    page.get_by_test_id("start").click()
    expect(page.get_by_test_id("state-badge")).to_contain_text("DRIVING")
    before, began_s = draws(page), time.monotonic()
    # Whatever else asks for a drawing meanwhile, a pointer that sweeps across the map above all.
    box = page.get_by_test_id("map-canvas").bounding_box()
    assert box is not None
    sweep = iter(range(1, 10_000))
    while_ticking(
        page,
        operations,
        WATCHED_S,
        lambda: page.mouse.move(box["x"] + 40 + next(sweep) * 3, box["y"] + 60, steps=5),
    )
    drawn, lasted_s = draws(page) - before, time.monotonic() - began_s
    assert 3 <= drawn <= MAX_DRAWS_PER_S * lasted_s + 1


def test_a_hidden_page_draws_nothing_and_catches_up_when_it_is_seen_again(
    page: Page, operations: FakeOperations
) -> None:  # noqa: F811
    settle(page)
    page.evaluate(HIDE)
    page.wait_for_timeout(300)
    before = draws(page)
    page.evaluate("document.querySelector('[data-zoom=in]').click()")
    while_ticking(page, operations, 1.0)
    assert draws(page) == before
    page.evaluate(SHOW)
    eventually(page, lambda: draws(page) > before)


def test_the_3d_view_is_made_when_it_is_asked_for_and_draws_only_while_it_is_seen(
    page: Page,  # noqa: F811
    operations: FakeOperations,
    server: ConsoleServer,
) -> None:
    # Without a graphics card the page opens on the map, and the view is not there.
    page.goto(server.url)
    expect(page.get_by_test_id("map-canvas")).to_be_visible()
    settle(page)
    expect(page.get_by_test_id("view-3d-frame")).to_have_count(0)
    page.get_by_test_id("view-3d").click()
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")
    eventually(page, lambda: frames(page) > 2)
    page.get_by_test_id("view-map").click()
    page.wait_for_timeout(500)
    before = frames(page)
    while_ticking(page, operations, WATCHED_S)
    assert frames(page) == before
    # The frames that were asked for meanwhile are given when it is seen again.
    page.get_by_test_id("view-3d").click()
    eventually(page, lambda: frames(page) > before)


def test_the_3d_view_rests_when_nothing_changes(page: Page) -> None:  # noqa: F811
    page.get_by_test_id("view-3d").click()
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")
    page.wait_for_timeout(9000)  # it is given frames freely until its scene stands
    ask_frame(page)
    page.wait_for_timeout(1000 * RESTED_S)
    assert not is_given(page)
    page.mouse.move(640, 400)
    page.mouse.move(660, 420)
    eventually(page, lambda: is_given(page))


def test_the_3d_view_of_a_hidden_page_gets_no_frames(
    page: Page, operations: FakeOperations
) -> None:  # noqa: F811
    page.get_by_test_id("view-3d").click()
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")
    eventually(page, lambda: frames(page) > 2)
    page.evaluate(HIDE)
    page.wait_for_timeout(1000)
    ask_frame(page)
    while_ticking(page, operations, RESTED_S)
    assert not is_given(page)
    page.evaluate(SHOW)
    eventually(page, lambda: is_given(page))


def test_a_view_that_nobody_looks_at_is_taken_away(page: Page) -> None:  # noqa: F811
    page.clock.install()
    page.get_by_test_id("view-3d").click()
    expect(page.get_by_test_id("view-3d-frame")).to_have_count(1)
    page.get_by_test_id("view-map").click()
    page.clock.run_for(10_000)
    expect(page.get_by_test_id("view-3d-frame")).to_have_count(1)
    page.clock.run_for(15_000)
    expect(page.get_by_test_id("view-3d-frame")).to_have_count(0)
