"""The page on a phone, in a real Chromium with touch: the stop is always visible."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from navcore.mission.mission import Phase
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import (
    IS_TOPMOST,
    IS_WITHIN_VIEWPORT,
    await_map,
    eventually,
    map_view,
    middle_of,
    tap_map,
)
from tests.web.page.states import SIZES, draw, furnish
from web.server import ConsoleServer

PHONE = (390, 844)
TABS = {
    "map": ["map-canvas", "mode-goal", "mode-draw", "tab-log"],
    "camera": ["camera", "start", "teleop-open"],
    "goals": ["start", "teleop-open", "goal-input", "missions"],
    "zones": ["zones-undo", "zone-sets"],
    "more": ["beware"],
}
Opener = Callable[[int, int], Page]


@pytest.fixture
def open_phone(new_context: Callable[..., BrowserContext], server: ConsoleServer) -> Opener:
    """Open the console in a window of a size, with touch."""

    def opened(width: int, height: int) -> Page:
        context = new_context(
            viewport={"width": width, "height": height}, is_mobile=True, has_touch=True
        )
        page = context.new_page()
        page.goto(server.url)
        expect(page.get_by_test_id("connection")).to_have_text("live")
        return page

    return opened


def tap_stop(page: Page) -> None:
    """Tap the middle of the stop."""
    stop = page.get_by_test_id("stop")
    assert stop.evaluate(IS_WITHIN_VIEWPORT) and stop.evaluate(IS_TOPMOST)
    page.touchscreen.tap(*middle_of(stop))
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")


def test_a_latched_stop_makes_the_header_no_higher(open_phone: Opener) -> None:
    page = open_phone(*PHONE)
    height = page.locator(".bar").evaluate("(bar) => bar.offsetHeight")
    tap_stop(page)
    reset = page.get_by_test_id("reset")
    expect(reset).to_be_enabled()
    assert page.locator(".bar").evaluate("(bar) => bar.offsetHeight") == height
    assert page.get_by_test_id("state-text").evaluate("(it) => it.scrollHeight <= it.clientHeight")
    page.touchscreen.tap(*middle_of(reset))
    expect(page.get_by_test_id("state-badge")).to_contain_text("IDLE")


def test_reasons_that_are_cut_off_are_read_whole_by_a_tap(
    open_phone: Opener, operations: FakeOperations
) -> None:
    page = open_phone(*PHONE)
    operations.goals.add(4.8, 0.0)
    operations.mission("start")
    operations.block_by_red()
    tap_stop(page)
    reasons, is_whole = (
        page.get_by_test_id("state-text"),
        "(it) => it.scrollHeight <= it.clientHeight",
    )
    expect(reasons).to_contain_text("no path")
    height = page.locator(".bar").evaluate("(bar) => bar.offsetHeight")
    assert not reasons.evaluate(is_whole)
    page.touchscreen.tap(*middle_of(reasons))
    assert reasons.evaluate(is_whole)
    page.touchscreen.tap(*middle_of(page.get_by_test_id("control-text")))
    assert page.locator(".bar").evaluate("(bar) => bar.offsetHeight") == height


def test_the_form_of_a_zone_is_scrolled_to_its_end_on_a_tablet(
    open_phone: Opener, operations: FakeOperations
) -> None:
    furnish(operations)
    page = open_phone(1024, 768)
    await_map(page)
    draw(page)
    page.get_by_test_id("page-tab-zones").tap()
    finish = page.get_by_test_id("zone-finish")
    page.mouse.move(*middle_of(page.locator("#draft-title")))
    page.mouse.wheel(0, 2000)
    eventually(page, lambda: bool(finish.evaluate(IS_WITHIN_VIEWPORT)))
    assert finish.evaluate(IS_TOPMOST)
    page.touchscreen.tap(*middle_of(finish))
    expect(page.get_by_test_id("zone")).to_have_count(3)


def test_the_form_of_a_class_far_down_the_list_and_the_next_tab_begin_at_their_top(
    open_phone: Opener,
) -> None:
    page = open_phone(*PHONE)
    page.get_by_test_id("page-tab-more").tap()
    last = page.get_by_test_id("beware-class").last
    last.get_by_test_id("beware-edit").tap()
    expect(page.locator("#entry-title")).to_be_in_viewport(ratio=1.0)
    page.get_by_test_id("entry-cancel").tap()
    last.scroll_into_view_if_needed()
    scrolled = "document.querySelector('main').scrollTop"
    assert page.evaluate(scrolled) > 0
    page.get_by_test_id("page-tab-goals").tap()
    assert page.evaluate(scrolled) == 0


def test_hints_leave_out_the_keys_and_the_list_of_keys_begins_at_its_top(
    open_phone: Opener,
) -> None:
    page = open_phone(*PHONE)
    await_map(page)
    page.get_by_test_id("mode-draw").tap()
    assert page.locator("#hint").inner_text().strip() == "Click the corners."
    page.get_by_test_id("help-button").tap()
    expect(page.get_by_test_id("help")).to_be_visible()
    expect(page.locator("#help-keys dt").first).to_be_in_viewport(ratio=1.0)


@pytest.mark.parametrize("size", [PHONE, (360, 640), (759, 900), (844, 390), (930, 700)])
def test_stop_and_state_are_on_the_screen_of_every_tab_and_nothing_is_wider(
    size: tuple[int, int], open_phone: Opener, operations: FakeOperations
) -> None:
    page = open_phone(*size)
    for name, shown in TABS.items():
        page.get_by_test_id(f"page-tab-{name}").tap()
        for part in shown:
            expect(page.get_by_test_id(part)).to_be_visible()
        for other in {part for parts in TABS.values() for part in parts} - set(shown):
            expect(page.get_by_test_id(other)).to_be_hidden()
        boxes = "[document.documentElement, document.body, document.querySelector('main')]"
        assert max(page.evaluate(f"{boxes}.map((box) => box.scrollWidth)")) <= size[0], name
        assert page.evaluate("document.documentElement.scrollHeight") <= size[1], name
        expect(page.get_by_test_id("state-badge")).to_be_in_viewport(ratio=1.0)
        tap_stop(page)
        expect(page.get_by_test_id("reset")).to_be_in_viewport(ratio=1.0)
        operations.reset_stop()
        expect(page.get_by_test_id("state-badge")).not_to_contain_text("STOPPED")


def test_the_list_of_keys_names_them_on_a_touch_screen_too(open_phone: Opener) -> None:
    page = open_phone(*PHONE)
    page.get_by_test_id("help-button").tap()
    expect(page.locator("#help-keys kbd").first).to_be_visible()
    expect(page.get_by_test_id("mode-goal").locator("kbd")).to_be_hidden()


def test_stop_is_at_the_bottom_over_the_full_width(open_phone: Opener) -> None:
    box = open_phone(*PHONE).get_by_test_id("stop").bounding_box()
    assert box is not None and box["height"] >= 56
    assert (box["x"], box["width"], box["y"] + box["height"]) == (0, *PHONE)


def test_the_map_and_the_camera_image_are_large_enough_to_work_with(open_phone: Opener) -> None:
    page = open_phone(*PHONE)
    for tab, part, height in (("map", "map-canvas", 300), ("camera", "camera", 180)):
        page.get_by_test_id(f"page-tab-{tab}").tap()
        box = page.get_by_test_id(part).bounding_box()
        assert box is not None and box["width"] >= 330 and box["height"] >= height, part


def test_a_message_lies_over_the_map_of_a_tablet_and_covers_no_list(
    open_phone: Opener, operations: FakeOperations
) -> None:
    furnish(operations)
    page = open_phone(*SIZES["tablet"])
    page.get_by_test_id("page-tab-zones").tap()
    page.get_by_test_id("zone-delete").first.tap()
    expect(page.get_by_test_id("toast-action")).to_be_visible()
    message = page.get_by_test_id("toasts").bounding_box()
    zones = page.get_by_test_id("zones").bounding_box()
    assert message is not None and zones is not None
    assert message["x"] + message["width"] <= zones["x"]


def test_the_log_can_be_read_on_a_phone(open_phone: Opener, operations: FakeOperations) -> None:
    said = "The newest camera image is 0.53 s old, at most 0.5 s are allowed."
    operations.insight.event_log.note(1.0, "stopped", said, (-3.0, 1.0))
    page = open_phone(*PHONE)
    page.get_by_test_id("tab-log").tap()
    words = page.get_by_test_id("log-entry").first.locator(".words")
    expect(words).to_be_in_viewport(ratio=1.0)
    width = words.evaluate("(part) => part.getBoundingClientRect().width")
    assert width > 0.8 * PHONE[0]
    rows = page.get_by_test_id("pane-log").evaluate("(pane) => pane.clientHeight")
    assert rows > PHONE[1] / 3
    page.get_by_test_id("tab-log").tap()
    expect(page.get_by_test_id("mode-draw")).to_be_visible()


def test_a_goal_is_picked_a_zone_drawn_and_the_robot_driven_by_touch(
    open_phone: Opener, operations: FakeOperations
) -> None:
    page = open_phone(*PHONE)
    await_map(page)
    page.get_by_test_id("mode-goal").tap()
    tap_map(page, 2.5, -1.0)
    expect(page.get_by_test_id("goal")).to_have_count(1)
    page.get_by_test_id("mode-draw").tap()
    for corner in ((-4.0, 3.0), (-2.0, 3.0), (-2.0, 5.0)):
        tap_map(page, *corner)
    expect(page.get_by_test_id("draft-note")).to_contain_text("3 corners")
    page.get_by_test_id("zone-finish").tap()
    expect(page.get_by_test_id("zone")).to_have_count(1)
    page.get_by_test_id("page-tab-zones").tap()
    page.get_by_test_id("zone-edit").tap()
    expect(page.get_by_test_id("map-canvas")).to_be_visible()
    page.get_by_test_id("zone-cancel").tap()
    page.get_by_test_id("page-tab-camera").tap()
    page.get_by_test_id("start").tap()
    expect(page.get_by_test_id("state-badge")).to_contain_text("DRIVING")
    assert operations.state().phase is Phase.DRIVING
    tap_stop(page)


def test_two_fingers_zoom_the_map_and_place_no_goal(
    open_phone: Opener, operations: FakeOperations
) -> None:
    page = open_phone(*PHONE)
    await_map(page)
    page.get_by_test_id("mode-goal").tap()
    (x, y), scale = middle_of(page.get_by_test_id("map-canvas")), map_view(page)[0]
    touch = page.context.new_cdp_session(page)

    def send(kind: str, *distances: float) -> None:
        touch.send(
            "Input.dispatchTouchEvent",
            {"type": kind, "touchPoints": [{"x": x + dx, "y": y} for dx in distances]},
        )

    send("touchStart", -40)
    send("touchStart", -40, 40)
    for distance in (50, 60, 70, 80):
        send("touchMove", -distance, distance)
    send("touchEnd", -80)
    send("touchEnd")
    page.wait_for_function(
        "was => parseFloat(document.getElementById('map-canvas').dataset.place) > 1.8 * was",
        arg=scale,
    )
    assert 1.8 * scale < map_view(page)[0] < 2.2 * scale
    expect(page.get_by_test_id("goal")).to_have_count(0)
    tap_map(page, 2.5, -1.0)
    expect(page.get_by_test_id("goal")).to_have_count(1)


def test_the_camera_of_a_standing_robot_is_shown_when_its_tab_is_opened(
    new_context: Callable[..., BrowserContext], server: ConsoleServer
) -> None:
    context = new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    page = context.new_page()
    page.goto(f"{server.url}/#map")
    expect(page.get_by_test_id("connection")).to_have_text("live")
    page.wait_for_timeout(500)
    page.get_by_test_id("page-tab-camera").tap()
    expect(page.get_by_test_id("camera")).to_have_attribute("data-serial", re.compile(r"\d+"))


def test_the_pad_of_driving_by_hand_opens_within_the_screen(open_phone: Opener) -> None:
    page = open_phone(*PHONE)
    page.get_by_test_id("page-tab-camera").tap()
    page.get_by_test_id("teleop-open").tap()
    for direction in ("forward", "left", "back", "right"):
        expect(page.get_by_test_id(f"drive-{direction}")).to_be_in_viewport(ratio=1.0)


def test_who_has_control_takes_two_rows_of_the_header_whoever_it_is(
    open_phone: Opener, server: ConsoleServer
) -> None:
    page = open_phone(*PHONE)
    height = page.locator(".bar").evaluate("(bar) => bar.offsetHeight")
    other = open_phone(*PHONE)
    other.get_by_test_id("control-take").tap()
    expect(page.get_by_test_id("control-ask")).to_be_visible()
    assert page.locator(".bar").evaluate("(bar) => bar.offsetHeight") <= height + 24


def test_a_place_that_is_proposed_from_another_tab_is_shown_on_the_map(
    open_phone: Opener, operations: FakeOperations
) -> None:
    page = open_phone(*PHONE)
    page.get_by_test_id("page-tab-goals").tap()
    page.get_by_test_id("sites-button").tap()
    page.get_by_test_id("dock-here").tap()
    page.get_by_test_id("dock-in").tap()
    proposal = page.get_by_test_id("place-proposal")
    expect(proposal).to_be_visible()
    for button in proposal.get_by_role("button").all():
        expect(button).to_be_in_viewport(ratio=1.0)
        assert button.evaluate("(button) => button.scrollWidth <= button.clientWidth")
