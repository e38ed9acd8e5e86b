"""Erasing from the map, in a real Chromium: from the menu of a place, a zone and a draft."""

from __future__ import annotations

import numpy as np
from playwright.sync_api import Page, Route, expect

from navcore.mapping.points.erasing import Erased
from navcore.mapping.points.point_table import POINT
from tests.web.fake_operations import FakeOperations
from tests.web.fake_world import RED_FLOOR
from tests.web.page.chromium import await_map, click_map
from tests.web.page.test_map_touch import IN_SQUARE, add_zone, press_item, right_click


def test_a_place_is_erased_from_its_menu_and_taken_back(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    right_click(page, -1.0, 0.0)
    page.get_by_test_id("map-erase-here").click()
    press_item(page, "erase-beware")
    expect(page.get_by_test_id("toasts")).to_contain_text("What the camera sees there comes back.")
    assert operations.map_edits.history.undo == "erasing of beware points around (-1.0, 0.0)"
    right_click(page, -1.0, 0.0)
    press_item(page, "edit-undo")
    expect(page.get_by_test_id("toasts")).to_contain_text("It is back on the map.")
    assert len(operations.map_posts) == 2
    right_click(page, -1.0, 0.0)
    press_item(page, "edit-redo")
    expect(page.get_by_test_id("toasts")).to_contain_text("It is done again.")


def keep_red_floor(operations: FakeOperations) -> None:
    """Have the map hold red floor from x −0.8 to −0.2 m and y −0.3 to 0.3 m."""
    x_m, y_m = np.mgrid[-0.75:-0.2:0.1, -0.25:0.3:0.1]
    records = np.zeros(x_m.size, dtype=POINT)
    records["base_x"], records["base_y"] = x_m.ravel() + 6.0, y_m.ravel()  # of the pose at x −6 m
    records["class_id"], records["confidence"] = RED_FLOOR, 1.0
    operations.point_map.layers.add_classes(records["class_id"])
    operations.point_map.edits.put_back(Erased(records=records, prior_xy=np.empty((0, 2)), cells=0))


def test_what_the_map_holds_is_called_none_from_its_menu(
    page: Page, operations: FakeOperations
) -> None:
    keep_red_floor(operations)
    held = operations.point_map.layers.bools
    assert held(RED_FLOOR).any()
    await_map(page)
    right_click(page, -0.5, 0.0)
    expect(page.get_by_test_id("map-menu-what")).to_contain_text("ed floor of the beware list")
    press_item(page, "not-one")
    expect(page.get_by_test_id("toasts")).to_contain_text("The place of the red floor is free.")
    assert not held(RED_FLOOR).any()
    assert operations.map_edits.history.undo == "“red floor” at (-0.5, 0.0) is not one"
    page.get_by_test_id("toast-action").click()
    expect(page.get_by_test_id("toasts")).to_contain_text("Undone: “red floor” at")
    assert held(RED_FLOOR).any()
    right_click(page, 6.0, 4.0)
    expect(page.get_by_test_id("map-not-one")).to_have_count(0)


def test_a_zone_is_emptied_by_keyboard(page: Page, operations: FakeOperations) -> None:
    add_zone(operations)
    await_map(page)
    expect(page.get_by_test_id("zone")).to_have_count(1)
    click_map(page, *IN_SQUARE)
    page.get_by_test_id("map-canvas").focus()
    page.keyboard.press("Shift+F10")
    for _ in range(3):
        page.keyboard.press("ArrowDown")
    expect(page.get_by_test_id("map-erase-zone")).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("map-erase-both")).to_be_focused()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("toasts")).to_contain_text("The obstacles there are erased.")
    assert len(operations.map_posts) == 1 and len(operations.zones.stored) == 1


def test_what_is_drawn_can_be_erased_instead_of_made_a_zone(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.keyboard.press("z")
    erase = page.get_by_test_id("zone-erase")
    expect(erase).to_be_disabled()
    for corner in ((-3.0, -3.0), (-1.0, -3.0), (-1.0, -1.0)):
        click_map(page, *corner)
    erase.click()
    press_item(page, "erase-geometry")
    expect(page.get_by_test_id("toasts")).to_contain_text("The obstacles there are erased.")
    expect(page.get_by_test_id("draft")).to_be_hidden()
    assert operations.map_edits.history.undo is not None and not operations.zones.stored


def test_undo_in_a_message_takes_back_no_edit_that_another_operator_made_before_the_message(
    page: Page, operations: FakeOperations
) -> None:
    add_zone(operations)
    await_map(page)
    expect(page.get_by_test_id("zone")).to_have_count(1)

    def switch_the_cup_off_before_the_answer(route: Route) -> None:
        answer = route.fetch()
        operations.beware.edit("cup", {"enabled": False})
        route.fulfill(response=answer)

    page.route("**/api/v1/zones/*", switch_the_cup_off_before_the_answer)
    right_click(page, *IN_SQUARE)
    press_item(page, "delete-zone")
    page.get_by_test_id("toast-action").click()
    expect(page.get_by_test_id("toasts")).to_contain_text("Another edit was made since")
    (cup,) = (entry for entry in operations.beware.list.classes if entry.name == "cup")
    assert not cup.enabled and not operations.zones.stored


def test_a_detection_that_is_not_one_is_rejected_and_its_place_can_be_taken_back(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.get_by_test_id("tab-seen").click()
    page.get_by_test_id("reject").click()
    expect(page.get_by_test_id("toasts")).to_contain_text("The place of the cup is free.")
    expect(page.get_by_test_id("detection")).to_contain_text("not one")
    expect(page.get_by_test_id("seen-counts")).to_have_text(
        "None of the detections counts: each was rejected or corrected."
    )
    expect(page.get_by_test_id("rejected-place")).to_contain_text("You said that this is no cup")
    page.get_by_test_id("rejected-forget").click()
    expect(page.get_by_test_id("rejected-place")).to_have_count(0)
    assert not operations.map_edits.rejected


def test_the_undo_of_a_message_takes_back_no_edit_that_was_made_since(
    page: Page, operations: FakeOperations
) -> None:
    add_zone(operations)
    await_map(page)
    page.get_by_test_id("zone-delete").click()
    undo = page.get_by_test_id("toast-action").filter(has_text="Undo")
    expect(undo).to_be_visible()
    operations.path_settings.set_unknown_price(3.0)  # by another operator
    undo.click()
    expect(page.get_by_test_id("toasts")).to_contain_text("Another edit was made since")
    assert operations.path_settings.unknown_price == 3.0
    # The control: without another edit the zone is back.
    zone = add_zone(operations)
    page.get_by_test_id("zone-delete").click()
    undo.click()
    expect(page.get_by_test_id("zone")).to_have_count(1)
    assert operations.zones.stored[0].id == zone.id
