"""The map that can be touched, in a real Chromium: select, drag, the menu of a place, fit."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from navcore.localisation.estimate import LocalisationState
from navcore.mission.zone import Zone
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import (
    IS_TOPMOST,
    IS_WITHIN_VIEWPORT,
    await_map,
    click_map,
    eventually,
    map_view,
    middle_of,
    on_page,
)
from web.interface.drafts import ZoneDraft
from web.interface.localisation import PlaceOut
from web.server import ConsoleServer

SQUARE = ((-4.0, 2.0), (-2.6, 2.0), (-2.6, 3.2), (-4.0, 3.2))
IN_SQUARE = (-3.6, 2.4)
SELECTED = re.compile(r"\bselected\b")


def add_zone(operations: FakeOperations, name: str = "Wet floor") -> Zone:
    """Store a square zone."""
    return operations.zones.add(ZoneDraft(name=name, polygon=SQUARE))


def press_item(page: Page, name: str) -> None:
    """Click an item of the menu of a place by mouse."""
    item = page.get_by_test_id(f"map-{name}")
    expect(item).to_be_visible()
    assert item.evaluate(IS_TOPMOST) and item.evaluate(IS_WITHIN_VIEWPORT), name
    page.mouse.click(*middle_of(item))
    expect(page.get_by_test_id("map-menu")).to_be_hidden()


def right_click(page: Page, x: float, y: float) -> None:
    """Open the menu of a place in metres."""
    page.mouse.click(*on_page(page, x, y), button="right")
    expect(page.get_by_test_id("map-menu")).to_be_visible()


def choose_by_keyboard(page: Page, name: str) -> None:
    """Choose an item of the menu of the map, which has the focus, by keys."""
    page.keyboard.press("Shift+F10")
    item = page.get_by_test_id(f"map-{name}")
    expect(item).to_be_visible()
    while not item.evaluate("(item) => item === document.activeElement"):
        page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")


def await_target(page: Page, x: float, y: float) -> None:
    """Wait until the map has something to grab at a point in metres, which the pointer shows: the
    row in a list may be there before."""

    def is_there() -> bool:
        right, down = on_page(page, x, y)
        page.mouse.move(right + 1, down)
        page.mouse.move(right, down)
        return page.locator("#map-canvas.point").count() == 1

    eventually(page, is_there)


def drag_map(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag with the mouse from a point in metres to another."""
    (x, y), (to_x, to_y) = on_page(page, *start), on_page(page, *end)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move((x + to_x) / 2, (y + to_y) / 2, steps=3)
    page.mouse.move(to_x, to_y, steps=3)
    page.mouse.up()


def test_a_click_selects_a_zone_or_a_goal_with_its_row_and_a_click_elsewhere_nothing(
    page: Page, operations: FakeOperations
) -> None:
    add_zone(operations)
    operations.goals.add(5.0, -3.0, name="Nurse station")
    await_map(page)
    zone, goal = page.get_by_test_id("zone"), page.get_by_test_id("goal")
    expect(zone).to_have_count(1)
    expect(goal).to_have_count(1)
    click_map(page, *IN_SQUARE)
    expect(zone).to_have_class(SELECTED)
    click_map(page, 5.0, -3.0)
    expect(goal).to_have_class(SELECTED)
    expect(zone).not_to_have_class(SELECTED)
    click_map(page, -6.0, -4.0)
    expect(goal).not_to_have_class(SELECTED)
    page.mouse.click(*middle_of(zone.locator(".swatch")))
    expect(zone).to_have_class(SELECTED)
    page.keyboard.press("Escape")
    expect(zone).not_to_have_class(SELECTED)


def test_a_goal_is_dragged_and_taken_back_by_one_click(
    page: Page, operations: FakeOperations
) -> None:
    operations.goals.add(5.0, -3.0)
    await_map(page)
    expect(page.get_by_test_id("goal")).to_have_count(1)
    await_target(page, 5.0, -3.0)
    drag_map(page, (5.0, -3.0), (6.0, -1.0))
    expect(page.get_by_test_id("toasts")).to_contain_text("moved")
    (goal,) = operations.state().queue
    assert (goal.x_m, goal.y_m) == pytest.approx((6.0, -1.0), abs=0.1)
    page.mouse.click(*middle_of(page.get_by_test_id("toast-action")))
    eventually(
        page, lambda: [(goal.x_m, goal.y_m) for goal in operations.state().queue] == [(5.0, -3.0)]
    )


def test_a_selected_zone_is_dragged_and_another_one_lets_the_map_pan(
    page: Page, operations: FakeOperations
) -> None:
    add_zone(operations)
    await_map(page)
    expect(page.get_by_test_id("zone")).to_have_count(1)
    await_target(page, *IN_SQUARE)
    scale, x, y = map_view(page)
    drag_map(page, IN_SQUARE, (IN_SQUARE[0] + 1.0, IN_SQUARE[1]))
    expect(page.get_by_test_id("draft")).to_be_hidden()
    # The map is drawn after the last move of the pointer; only then is its place known.
    eventually(page, lambda: map_view(page) == pytest.approx((scale, x - 1.0, y), abs=0.1))
    click_map(page, *IN_SQUARE)
    expect(page.get_by_test_id("zone")).to_have_class(SELECTED)
    drag_map(page, IN_SQUARE, (IN_SQUARE[0] + 1.0, IN_SQUARE[1] - 1.0))
    expect(page.get_by_test_id("draft")).to_be_visible()
    assert operations.zones.stored[0].polygon == SQUARE  # not before it is finished
    page.mouse.click(*middle_of(page.get_by_test_id("zone-finish")))
    expect(page.get_by_test_id("draft")).to_be_hidden()
    assert operations.zones.stored[0].polygon[0] == pytest.approx((-3.0, 1.0), abs=0.1)


def test_a_right_click_says_what_is_there_and_offers_a_goal_a_zone_and_a_measurement(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    right_click(page, 4.0, 2.5)
    expect(page.get_by_test_id("map-menu-what")).to_contain_text("An obstacle")
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("map-menu")).to_be_hidden()
    right_click(page, -0.5, 0.0)
    expect(page.get_by_test_id("map-menu-what")).to_contain_text("Red floor of the beware list")
    page.mouse.click(*middle_of(page.get_by_test_id("stop")))
    expect(page.get_by_test_id("map-menu")).to_be_hidden()
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
    assert operations.stops == ["console button"]

    right_click(page, 3.0, -4.0)
    press_item(page, "goal-here")
    expect(page.get_by_test_id("goal")).to_have_count(1)
    (goal,) = operations.state().queue
    assert (goal.x_m, goal.y_m) == pytest.approx((3.0, -4.0), abs=0.05)

    right_click(page, -3.0, 3.0)
    press_item(page, "zone-here")
    expect(page.get_by_test_id("zone-tool")).to_have_value("circle")
    page.mouse.click(*middle_of(page.get_by_test_id("zone-finish")))
    expect(page.get_by_test_id("zone")).to_have_count(1)

    right_click(page, -4.0, -4.0)
    press_item(page, "measure")
    page.mouse.move(*on_page(page, -2.0, -4.0))
    click_map(page, -1.0, -4.0)
    expect(page.get_by_test_id("toasts")).to_contain_text(re.compile(r"(2\.9[5-9]|3\.0\d) m"))


def test_the_menu_of_a_zone_and_of_a_goal_edits_and_removes_them(
    page: Page, operations: FakeOperations
) -> None:
    add_zone(operations)
    operations.goals.add(5.0, -3.0, name="Nurse station")
    operations.goals.add(-5.0, -3.0, name="Ward")
    await_map(page)
    expect(page.get_by_test_id("zone")).to_have_count(1)
    expect(page.get_by_test_id("goal")).to_have_count(2)
    right_click(page, *IN_SQUARE)
    expect(page.get_by_test_id("map-menu-what")).to_contain_text("Zone “Wet floor”: keep out")
    press_item(page, "switch-zone")
    expect(page.get_by_test_id("zone")).to_have_class(re.compile(r"\boff\b"))
    right_click(page, *IN_SQUARE)
    press_item(page, "delete-zone")
    expect(page.get_by_test_id("zone")).to_have_count(0)
    page.mouse.click(*middle_of(page.get_by_test_id("toast-action")))
    expect(page.get_by_test_id("zone")).to_have_count(1)
    right_click(page, -5.0, -3.0)
    press_item(page, "goal-first")
    expect(page.get_by_test_id("goal-name").first).to_have_value("Ward")
    right_click(page, -5.0, -3.0)
    press_item(page, "goal-delete")
    expect(page.get_by_test_id("goal")).to_have_count(1)


def test_the_menu_key_opens_the_menu_and_arrows_choose(
    page: Page, operations: FakeOperations
) -> None:
    add_zone(operations)
    await_map(page)
    expect(page.get_by_test_id("zone")).to_have_count(1)
    click_map(page, *IN_SQUARE)
    page.get_by_test_id("map-canvas").focus()
    page.keyboard.press("Shift+F10")
    expect(page.get_by_test_id("map-edit-zone")).to_be_focused()
    page.keyboard.press("ArrowDown")
    expect(page.get_by_test_id("map-switch-zone")).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("map-canvas")).to_be_focused()


def test_a_measurement_and_the_robots_place_are_set_by_keyboard_alone(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.get_by_test_id("map-canvas").focus()
    choose_by_keyboard(page, "measure")
    expect(page.get_by_test_id("pick-to")).to_be_focused()
    page.keyboard.type("nowhere")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("toasts")).to_contain_text("“nowhere” is no point")
    page.get_by_test_id("pick-to").select_text()
    page.keyboard.type("4, 1")
    page.keyboard.press("Shift+Tab")
    page.keyboard.type("0, -2")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("toasts")).to_contain_text("5.00 m")
    expect(page.get_by_test_id("pick")).to_be_hidden()

    expect(page.get_by_test_id("map-canvas")).to_be_focused()
    choose_by_keyboard(page, "robot-here")
    expect(page.get_by_test_id("pick-from")).to_be_hidden()
    expect(page.get_by_test_id("pick-to")).to_be_focused()
    expect(page.get_by_test_id("pick-to")).to_have_value(re.compile(r"^\S+, \S+, $"))
    page.keyboard.press("Control+A")
    page.keyboard.type("-3, 3, 90")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("place-accept")).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("place-proposal")).to_be_hidden()
    pose = operations.state().pose
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((-3.0, 3.0, 1.571), abs=0.001)


def test_for_a_mouse_no_field_covers_the_map_or_takes_the_space_bar(page: Page) -> None:
    await_map(page)
    right_click(page, -4.0, -4.0)
    press_item(page, "measure")
    expect(page.get_by_test_id("map-canvas")).to_be_focused()
    expect(page.get_by_test_id("pick")).to_be_hidden()
    page.keyboard.press("Space")
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")


def test_a_place_of_the_robot_is_shown_with_the_share_that_fits_before_it_is_taken(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    before = operations.state().pose
    right_click(page, -3.0, 3.0)
    press_item(page, "robot-here")
    expect(page.get_by_test_id("hint")).to_contain_text("faces")
    drag_map(page, (-3.0, 3.0), (-3.0, 4.5))
    expect(page.get_by_test_id("place-fit")).to_have_text("fits")
    assert operations.state().pose == before
    page.get_by_test_id("place-accept").click()
    expect(page.get_by_test_id("toasts")).to_contain_text("takes this")
    expect(page.get_by_test_id("place-proposal")).to_be_hidden()
    pose = operations.state().pose
    assert (pose.x_m, pose.y_m) == pytest.approx((-3.0, 3.0), abs=0.05)
    assert pose.yaw_rad == pytest.approx(1.571, abs=0.05)


def test_a_place_that_does_not_fit_is_taken_only_when_the_operator_insists(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    before = operations.state().pose
    for choice in ("place-cancel", "place-force"):
        right_click(page, 2.0, 3.0)
        press_item(page, "robot-here")
        drag_map(page, (2.0, 3.0), (2.0, 4.5))
        expect(page.get_by_test_id("place-fit")).to_have_text("does not fit")
        page.get_by_test_id(choice).click()
        expect(page.get_by_test_id("place-proposal")).to_be_hidden()
        moved = operations.state().pose != before
        assert moved == (choice == "place-force")
    right_click(page, 2.0, 3.0)
    press_item(page, "robot-here")
    drag_map(page, (2.0, 3.0), (2.0, 4.5))
    page.get_by_test_id("place-look").click()
    expect(page.get_by_test_id("place-proposal")).to_be_hidden()
    expect(page.get_by_test_id("status")).to_have_attribute("data-kind", "searching")


def test_a_robot_that_is_lost_says_so_and_looks_round_when_told(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    expect(page.get_by_test_id("place-unknown")).to_be_hidden()
    operations.place.now = PlaceOut(state=LocalisationState.LOST, text="Lost: look round.")
    expect(page.get_by_test_id("place-unknown")).to_contain_text("Lost: look round.")
    operations.stop("a test")
    look_round = page.get_by_test_id("place-search")
    expect(look_round).to_be_disabled()
    expect(look_round).to_have_attribute("title", "The stop is latched: reset it first")
    operations.reset_stop()
    expect(look_round).to_be_enabled()
    expect(look_round).to_have_attribute("title", re.compile("^Turn round once"))
    page.get_by_test_id("place-search").click()
    expect(page.get_by_test_id("place-search")).to_have_text("Looking round …")
    assert operations.place.now.searching
    expect(page.get_by_test_id("status")).to_have_attribute("data-kind", "searching")
    expect(page.locator("[data-mission=pause]")).to_be_enabled()


def test_a_long_press_opens_the_menu_on_a_touch_screen(
    new_context: Callable[..., BrowserContext], server: ConsoleServer
) -> None:
    context = new_context(viewport={"width": 390, "height": 844}, is_mobile=True, has_touch=True)
    page = context.new_page()
    page.goto(server.url)
    expect(page.get_by_test_id("connection")).to_have_text("live")
    await_map(page)
    x, y = on_page(page, -3.0, 3.0)
    touch = context.new_cdp_session(page)
    touch.send(
        "Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]}
    )
    expect(page.get_by_test_id("map-menu")).to_be_visible()
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    menu = page.get_by_test_id("map-menu")
    expect(menu).to_be_visible()
    assert menu.evaluate(IS_WITHIN_VIEWPORT) and menu.evaluate(IS_TOPMOST)
    page.get_by_test_id("map-goal-here").tap()
    expect(page.get_by_test_id("goal")).to_have_count(1)


def test_the_map_fits_what_is_known_and_keeps_the_robot_in_sight(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    known = map_view(page)[0]
    page.mouse.move(*on_page(page, 0.0, 0.0))
    page.mouse.wheel(0, 300)
    eventually(page, lambda: map_view(page)[0] < 0.9 * known)
    page.get_by_test_id("fit").click()
    eventually(page, lambda: map_view(page)[0] == known)
    # The robot is below the middle; the drawer takes the lower part of the map.
    pose = operations.state().pose
    page.evaluate(
        """async ([x, y]) => {
          const { centreOn } = await import("/page/map/view.js");
          centreOn([x, y + 2.4]);
        }""",
        [pose.x_m, pose.y_m],
    )
    page.get_by_test_id("tab-log").click()
    expect(page.get_by_test_id("splitter")).to_be_visible()
    x, y = middle_of(page.get_by_test_id("splitter"))
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 60, steps=4)
    page.mouse.up()
    page.wait_for_timeout(300)
    canvas = page.get_by_test_id("map-canvas").bounding_box()
    _, down = on_page(page, pose.x_m, pose.y_m)
    assert canvas is not None and canvas["y"] < down < canvas["y"] + canvas["height"] - 20
    height = page.locator("#drawer").evaluate("(drawer) => drawer.clientHeight")
    page.reload()
    page.get_by_test_id("tab-log").click()
    assert page.locator("#drawer").evaluate("(drawer) => drawer.clientHeight") == height > 228


def test_labels_do_not_cover_each_other(page: Page) -> None:
    boxes = page.evaluate(
        """async () => {
          const { pen } = await import("/page/map/drawing/strokes.js");
          const { clearLabels, placeLabel } = await import("/page/map/drawing/labels.js");
          const drawn = [], real = pen.fillRect;
          pen.fillRect = (...box) => drawn.push(box);
          clearLabels();
          for (let i = 0; i < 8; i += 1)
            placeLabel(`Zone ${i} of the ward`, [200 + 5 * i, 200], { colour: "#fff" });
          pen.fillRect = real;
          return drawn;
        }"""
    )
    assert 2 <= len(boxes) < 8  # what finds no room is left out
    for i, (x, y, wide, high) in enumerate(boxes):
        for other_x, other_y, other_wide, other_high in boxes[:i]:
            assert (
                x >= other_x + other_wide
                or other_x >= x + wide
                or y >= other_y + other_high
                or other_y >= y + high
            )
