"""The status line: holds are filtered, the line is stable, a late stop is reported."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from navcore.safety.gate import Cause, StopReason
from tests.web.fake_operations import FakeOperations
from tests.web.page.test_overlays import press
from web.server import ConsoleServer

FILTERED = """async (held) => {
  const { holdFilter } = await import("/page/mission/calm.js");
  const isShown = holdFilter();
  return held.map((isHeld, i) => isShown(isHeld, 100 * i));
}"""
"""JavaScript: whether a hold is shown, with one state every 0.1 s."""
RATES = """async (states) => {
  const { rateMeter } = await import("/page/mission/calm.js");
  const rate = rateMeter();
  return states.map(([serial, seconds]) => rate(serial, 1000 * seconds));
}"""
TEXTS = """() => {
  window.texts = [];
  const line = document.getElementById("summary");
  const note = () => window.texts.push([performance.now(), line.textContent]);
  new MutationObserver(note).observe(line, { childList: true, characterData: true, subtree: true });
}"""
"""JavaScript: records every text of the status line with its time in milliseconds."""


def shown(page: Page, held: list[bool]) -> list[bool]:
    """Whether a hold is shown after each state."""
    result: list[bool] = page.evaluate(FILTERED, held)
    return result


def test_a_hold_is_shown_after_a_second_and_stays_two(page: Page) -> None:
    given = [False] * 5 + [True] * 15 + [False] * 40
    seen = shown(page, given)
    first, last = seen.index(True), len(seen) - seen[::-1].index(True)
    assert first in (14, 15)
    assert last - first in (20, 21)


def test_a_hold_with_short_gaps_is_one_and_short_holds_are_none(page: Page) -> None:
    often = shown(page, ([True] * 4 + [False]) * 20)
    assert all(often[often.index(True) :])
    assert not any(shown(page, ([True] * 2 + [False] * 3) * 20))


@pytest.mark.parametrize(("hertz", "expected"), [(10, 10.0), (2, 2.0)])
def test_the_rate_of_images_is_measured_over_seconds(
    page: Page, hertz: int, expected: float
) -> None:
    states = [(hertz * tenth // 10, tenth / 10) for tenth in range(100)]
    rates: list[Any] = page.evaluate(RATES, states)
    assert rates[:50] == [None] * 50
    assert rates[-1] == pytest.approx(expected, rel=0.1)


def test_the_line_changes_at_most_once_a_second_though_the_robot_says_more(
    page: Page, operations: FakeOperations
) -> None:
    operations.goals.add(3.0, 0.0)
    expect(page.get_by_test_id("state-text")).to_contain_text("Standing")
    page.evaluate(TEXTS)
    operations.mission("start")
    for step in range(1, 16):
        operations.mission("pause" if step % 2 else "resume")
        page.wait_for_timeout(100)
        operations.step()
        page.wait_for_timeout(100)
    times = [at for at, _ in page.evaluate("window.texts")]
    assert 1 <= len(times) <= 5
    # A busy machine notes a change late; without the rule there is one each 200 ms.
    assert all(later - earlier > 600 for earlier, later in pairwise(times))


@pytest.mark.parametrize("moving", [False, True])
def test_an_old_map_fades_only_around_a_robot_that_moves(
    page: Page, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch, moving: bool
) -> None:
    state = operations.state
    monkeypatch.setattr(
        operations, "state", lambda: replace(state(), frame_age_s=3.0, map_age_s=3.0, moving=moving)
    )
    expect(page.get_by_test_id("age-map")).to_have_text("▲ map 3.0 s")
    assert ("old-map" in (page.locator("body").get_attribute("class") or "")) is moving


def test_backing_off_is_one_click_beside_the_reason_of_a_robot_that_is_boxed_in(
    page: Page, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    button, state = page.get_by_test_id("back-off"), operations.state
    expect(button).to_be_hidden()
    reasons = (StopReason(cause=Cause.BOXED_IN, text="No motion keeps clear."),)
    monkeypatch.setattr(operations, "state", lambda: replace(state(), reasons=reasons))
    expect(page.get_by_test_id("status").get_by_test_id("back-off")).to_be_visible()
    with page.expect_response("**/mission/back-off"):
        press(button)
    assert operations.backed_off == 1


def test_a_stop_that_was_not_delivered_is_sent_until_it_is_and_then_says_so(
    new_context: Callable[..., BrowserContext], server: ConsoleServer, operations: FakeOperations
) -> None:
    page = new_context().new_page()
    page.goto(f"{server.url}/#map")
    expect(page.get_by_test_id("connection")).to_have_text("live")
    page.route("**/api/v1/stop**", lambda route: route.abort())
    page.evaluate(
        """() => { WebSocket.prototype.send = () => {}; }"""  # the second channel is lost, too
    )
    page.get_by_test_id("stop").click()
    expect(page.get_by_test_id("toasts")).to_contain_text("DID NOT REACH THE ROBOT")
    assert operations.stops == []
    page.unroute("**/api/v1/stop**")
    expect(page.get_by_test_id("toasts")).to_contain_text("delivered")
    expect(page.get_by_test_id("toasts")).not_to_contain_text("DID NOT REACH")
    assert operations.stops == ["console button"]
