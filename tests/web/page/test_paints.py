"""How often the page draws in a real Chromium: counts of drawings, frames and writes."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import await_map, click_map, eventually
from web.server import ConsoleServer

WATCHED_S = 3.0
RESTED_S = 4.0
"""Without a frame for so long the 3D view rests."""
LOADED_S = 60.0
"""Longest time in which the 3D view loads its scene."""
MAX_DRAWS_PER_S = 10
WRITES = """window.writes = [];
const numbers = new WeakMap();
let last = 0;
const numbered = (node) => {
  if (!numbers.has(node)) numbers.set(node, last += 1);
  return numbers.get(node);
};
new MutationObserver((records) => {
  for (const { target, type, attributeName } of records) if (target.id !== "camera") {
    const node = target.nodeType === 1 ? target : target.parentElement;
    const name = `${node.tagName}#${node.id || node.className}`;
    window.writes.push(`${type} ${attributeName} ${name} ${numbered(node)}`);
  }
}).observe(document.body, {
  subtree: true, childList: true, characterData: true, attributes: true,
});"""
"""JavaScript: records every write to the page, apart from the camera image."""
PAINTED = """async () => {
  const { boundsOf, colourMixer, paint } = await import("/page/map/ground/cells.js");
  const [cols, rows] = [9, 7];
  const tile = (flags) => {
    const data = new Uint8ClampedArray(4 * cols * rows);
    flags.forEach((value, at) => { data[4 * at] = value; data[4 * at + 3] = 255; });
    return { cells: { cols, rows, data }, left: 3, top: 5 };
  };
  const before = Array.from({ length: cols * rows }, (_, at) => (at % 3 ? 1 : 0));
  const after = before.map((value, at) => (at === 20 || at === 41 ? 3 : value));
  const area = boundsOf({ cols, rows }, (at) => before[at] !== after[at]);
  const [colourAt, whole] = [colourMixer([], false), [0, 0, cols, rows]];
  const image = (paints) => {
    const pen = new OffscreenCanvas(40, 40).getContext("2d");
    for (const [flags, part] of paints) paint(pen, tile(flags), part, 2, colourAt);
    return pen.getImageData(0, 0, 40, 40).data.join();
  };
  return {
    area,
    none: boundsOf({ cols, rows }, () => false),
    inPart: image([[before, whole], [after, area]]),
    asAWhole: image([[after, whole]]),
    before: image([[before, whole]]),
  };
}"""
"""JavaScript: paints a tile in which two cells have changed, as a whole and in part."""
HIDE = """Object.defineProperty(document, "hidden", { get: () => true, configurable: true });
document.dispatchEvent(new Event("visibilitychange"));"""

SHOW = "delete document.hidden; document.dispatchEvent(new Event('visibilitychange'));"


def draws(page: Page) -> int:
    """Number of drawings of the map so far."""
    return int(page.evaluate("window.paints.map"))


def frames(page: Page) -> int:
    """Number of frames of the 3D view so far."""
    return int(page.evaluate("document.getElementById('viewer').contentWindow.framesDrawn ?? 0"))


def ask_frame(page: Page) -> None:
    """Ask for a frame of the 3D view, as its scripts do; see `is_given`."""
    page.evaluate("""() => { const inside = document.getElementById("viewer").contentWindow;
      inside.given = false; inside.requestAnimationFrame(() => { inside.given = true; }); }""")


def is_given(page: Page) -> bool:
    """Whether the frame that was asked for has come."""
    return bool(page.evaluate("document.getElementById('viewer').contentWindow.given"))


def rests(page: Page) -> bool:
    """Whether the 3D view gives no frame, although it is asked for one."""
    ask_frame(page)
    until_s = time.monotonic() + RESTED_S
    while time.monotonic() < until_s:
        if is_given(page):
            return False
        page.wait_for_timeout(100)
    return True


def settle(page: Page) -> None:
    """Wait until the map is drawn and the first answers have arrived."""
    await_map(page)
    expect(page.get_by_test_id("age-map")).to_have_text(re.compile("<"))
    page.wait_for_timeout(1500)


def while_ticking(
    page: Page, operations: FakeOperations, seconds: float, act: Callable[[], None] = lambda: None
) -> None:
    """Let the robot deliver ten frames a second."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        operations.step()
        act()
        page.wait_for_timeout(100)


@pytest.mark.long
def test_a_changed_tile_is_painted_where_it_changed(page: Page) -> None:
    seen = page.evaluate(PAINTED)
    assert seen["area"] == [2, 2, 6, 5] and seen["none"] is None
    assert seen["inPart"] == seen["asAWhole"] != seen["before"]


@pytest.mark.long
def test_nothing_is_drawn_or_written_while_the_robot_stands(
    page: Page, operations: FakeOperations
) -> None:
    settle(page)
    while_ticking(page, operations, 1.0)
    before = draws(page)
    page.evaluate(WRITES)
    while_ticking(page, operations, WATCHED_S)
    assert draws(page) - before <= 1
    # The camera image changes with every frame; of the rest, no text is written repeatedly.
    assert {
        what: count for what, count in Counter(page.evaluate("window.writes")).items() if count > 2
    } == {}


@pytest.mark.long
def test_a_driving_robot_is_drawn_at_most_ten_times_a_second(
    page: Page,
    operations: FakeOperations,
) -> None:
    settle(page)
    page.get_by_test_id("mode-goal").click()
    click_map(page, 6.0, 0.5)
    page.get_by_test_id("start").click()
    expect(page.get_by_test_id("state-badge")).to_contain_text("DRIVING")
    before, began_s = draws(page), time.monotonic()
    # A pointer that moves across the map asks for drawings, too.
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


def test_a_hidden_page_draws_nothing_and_catches_up_when_it_is_visible_again(
    page: Page, operations: FakeOperations
) -> None:
    settle(page)
    page.evaluate(HIDE)
    page.wait_for_timeout(300)
    before = draws(page)
    page.evaluate("document.querySelector('[data-zoom=in]').click()")
    while_ticking(page, operations, 1.0)
    assert draws(page) == before
    page.evaluate(SHOW)
    eventually(page, lambda: draws(page) > before)


@pytest.mark.long
def test_the_3d_view_is_made_on_demand_and_draws_only_while_it_is_visible(
    page: Page,
    operations: FakeOperations,
    server: ConsoleServer,
) -> None:
    # Without a graphics card the page opens on the map, without a 3D view.
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
    # Frames that were asked for meanwhile are given when it is visible again.
    page.get_by_test_id("view-3d").click()
    eventually(page, lambda: frames(page) > before)


@pytest.mark.long
def test_the_3d_view_rests_when_nothing_changes(page: Page) -> None:
    page.get_by_test_id("view-3d").click()
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")
    # Frames are free until the scene is loaded.
    until_s = time.monotonic() + LOADED_S
    while not rests(page):
        assert time.monotonic() < until_s
    page.mouse.move(640, 400)
    page.mouse.move(660, 420)
    eventually(page, lambda: is_given(page))


@pytest.mark.long
def test_the_3d_view_of_a_hidden_page_gets_no_frames(
    page: Page, operations: FakeOperations
) -> None:
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


@pytest.mark.long
def test_a_hidden_3d_view_is_removed_after_a_while(page: Page) -> None:
    page.clock.install()
    page.get_by_test_id("view-3d").click()
    expect(page.get_by_test_id("view-3d-frame")).to_have_count(1)
    page.get_by_test_id("view-map").click()
    page.clock.run_for(10_000)
    expect(page.get_by_test_id("view-3d-frame")).to_have_count(1)
    page.clock.run_for(15_000)
    expect(page.get_by_test_id("view-3d-frame")).to_have_count(0)
