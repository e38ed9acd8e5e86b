"""The beware list in the page: a class in its inspector, the order, versions and files."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from navcore.errors import Refused
from navcore.mission.beware_list import BewareList, as_toml
from navcore.perception.labels import LabelSource
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_WITHIN_VIEWPORT, await_map, eventually, middle_of
from tests.web.page.states import SIZES, open_tab
from web.interface.beware import ListPreview


def row(page: Page, name: str) -> Locator:
    """Return the row of a class."""
    return page.locator(f'[data-testid="beware-class"][data-name="{name}"]')


def names(operations: FakeOperations) -> list[str]:
    """Return the names in the list, in order."""
    return [entry.name for entry in operations.beware.list.classes]


@pytest.mark.long
def test_no_row_moves_when_the_first_of_a_class_is_seen(
    page: Page, operations: FakeOperations
) -> None:
    boxes = """() => [...document.querySelectorAll("#beware > li > *")].map((part) => {
      const { left, top, width, height } = part.getBoundingClientRect();
      return part.className === "seen" ? "" : [part.className, left, top, width, height].join();
    })"""
    seen, is_seen = row(page, "cup").get_by_test_id("seen-count"), False
    operations.insight.detections.mark(1, "rejected")
    for width, height in SIZES.values():  # the page asks for detections every few seconds
        page.set_viewport_size({"width": width, "height": height})
        open_tab(page, "more")
        expect(seen).to_have_text("1 seen" if is_seen else "")
        before, is_seen = page.evaluate(boxes), not is_seen
        operations.insight.detections.mark(1, None if is_seen else "rejected")
        expect(seen).to_have_text("1 seen" if is_seen else "")
        assert page.evaluate(boxes) == before


def test_a_class_is_edited_with_a_preview_and_one_undo_takes_the_last_edit_back(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    operations.goals.add(3.0, 0.0)
    row(page, "red floor").get_by_test_id("beware-edit").click()
    note, apply = page.get_by_test_id("entry-note"), page.get_by_test_id("entry-apply")
    expect(page.get_by_test_id("entry-eyes")).to_have_text("Detected by: colour rule")
    expect(apply).to_be_disabled()
    page.get_by_test_id("entry-margin").fill("9")
    expect(note).to_have_text("Margin in metres: 0 to 2")
    expect(apply).to_be_disabled()
    page.get_by_test_id("entry-margin").fill("0.6")
    expect(note).to_contain_text("the path would be")
    page.get_by_test_id("entry-name").fill("cup")
    expect(note).to_contain_text("there is a class 'cup' already")
    page.get_by_test_id("entry-name").fill("red paint")
    expect(note).to_contain_text("the path would be")
    assert operations.beware.list.version == 0
    assert apply.evaluate(IS_WITHIN_VIEWPORT)
    apply.click()
    expect(row(page, "red paint")).to_be_visible()
    expect(page.get_by_test_id("entry")).to_be_hidden()
    assert operations.beware.list.named("red paint").margin_m == 0.6
    page.get_by_test_id("map-canvas").focus()
    page.keyboard.press("Control+z")
    expect(row(page, "red floor")).to_be_visible()
    page.keyboard.press("Control+Shift+z")
    expect(row(page, "red paint")).to_be_visible()
    row(page, "bottle").get_by_test_id("beware-edit").click()
    expect(page.get_by_test_id("entry-eyes")).to_contain_text("Nothing can see it yet")
    page.get_by_test_id("entry-remove").click()
    expect(row(page, "bottle")).to_have_count(0)


def test_the_last_class_goes_when_it_is_asked_for_again(
    page: Page, operations: FakeOperations
) -> None:
    for name in names(operations)[1:]:
        operations.beware.remove(name)
    (last,) = names(operations)
    row(page, last).get_by_test_id("beware-edit").click()
    page.get_by_test_id("entry-remove").click()
    expect(page.get_by_test_id("proposal-note")).to_contain_text("the robot may drive there")
    page.get_by_test_id("proposal-apply").click()
    expect(page.get_by_text("the beware list would be empty")).to_be_visible()
    assert names(operations) == [last]
    page.get_by_test_id("toast-action").click()
    expect(row(page, last)).to_have_count(0)
    assert names(operations) == []


def test_the_inspector_says_whether_the_colour_of_a_class_that_the_network_knows_counts_alone(
    page: Page, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    finders = {"red floor": LabelSource.WEIGHED}
    monkeypatch.setattr(
        operations.beware, "finder", lambda entry: finders.get(entry.name, LabelSource.NETWORK)
    )
    page.reload()
    await_map(page)
    row(page, "cup").get_by_test_id("beware-edit").click()
    eyes, alone = page.get_by_test_id("entry-eyes"), page.get_by_test_id("entry-alone")
    only = "Detected by: network; its colour rule counts only without one"
    expect(eyes).to_have_text(only)
    alone.check()
    expect(eyes).to_have_text("Detected by: network and colour rule")
    with page.expect_request(lambda request: request.method == "PATCH") as sent:
        page.get_by_test_id("entry-apply").click()
    changes = sent.value.post_data_json
    assert changes is not None and changes["colour"]["alone"] is True
    assert changes["colour"]["fallback"] is False
    row(page, "red floor").get_by_test_id("beware-edit").click()
    expect(eyes).to_have_text("Detected by: network, weighed with colour rule")
    alone.check()
    expect(eyes).to_have_text("Detected by: network and colour rule")
    with page.expect_request(lambda request: request.method == "PATCH") as sent:
        page.get_by_test_id("entry-apply").click()
    changes = sent.value.post_data_json
    assert changes is not None and changes["colour"]["alone"] is True


def click_image(page: Page, right: float, down: float) -> None:
    """Click the camera image at a share of its width and height, wherever it is by then."""
    image = page.get_by_test_id("camera")
    box = image.bounding_box()
    assert box is not None
    image.click(position={"x": right * box["width"], "y": down * box["height"]})


def test_a_class_is_added_only_when_the_list_is_there(page: Page) -> None:
    held: list[Route] = []
    page.route("**/api/v1/beware", lambda route: held.append(route))
    page.reload()
    await_map(page)
    eventually(page, lambda: len(held) > 0)
    add, by_example = page.get_by_test_id("beware-add"), page.get_by_test_id("beware-this")
    expect(add).to_be_disabled()
    expect(by_example).to_be_disabled()
    held.pop().continue_()
    add.click()
    expect(page.get_by_test_id("entry-margin")).to_have_attribute("max", "2")


def test_a_click_on_the_image_makes_a_rule_only_while_a_colour_is_picked(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.get_by_test_id("beware-add").click()
    page.get_by_test_id("entry-name").fill("tape")
    page.get_by_test_id("entry-pick").click()
    click_image(page, 0.53, 0.72)
    expect(page.get_by_test_id("entry-share")).to_contain_text("6.9 %")
    expect(page.get_by_test_id("camera-mask")).to_be_visible()
    expect(page.get_by_test_id("draft")).to_be_hidden()
    page.get_by_test_id("entry-first-saturation-from").fill("99")
    expect(page.get_by_test_id("entry-share")).to_contain_text("0.0 %")
    click_image(page, 0.53, 0.72)  # one click too many
    page.wait_for_timeout(300)
    expect(page.get_by_test_id("draft")).to_be_hidden()
    page.get_by_test_id("entry-margin").fill("0.07")
    page.get_by_test_id("entry-apply").click()
    expect(row(page, "tape")).to_be_visible()
    expect(page.get_by_test_id("camera-mask")).to_be_hidden()
    rule = operations.beware.list.named("tape").colour
    assert rule is not None and rule.min_saturation == 0.99
    click_image(page, 0.53, 0.72)  # control: now the same click drafts a zone
    expect(page.get_by_test_id("draft")).to_be_visible()


def test_the_limits_of_both_colours_of_a_pattern_are_picked_and_moved(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.get_by_test_id("beware-add").click()
    page.get_by_test_id("entry-name").fill("tape")
    page.get_by_test_id("entry-pick").click()
    with page.expect_request("**/beware/colour") as sent:
        click_image(page, 0.9, 0.95)  # the grey floor
    clicked = sent.value.post_data_json
    assert clicked is not None
    assert clicked["frame"] == page.get_by_test_id("camera").get_attribute("data-frame")
    hue, value = (f"entry-first-{name}" for name in ("hue", "value"))
    expect(page.get_by_test_id(f"{hue}-from")).to_have_value("0")
    expect(page.get_by_test_id(f"{hue}-to")).to_have_value("360")
    page.get_by_test_id(f"{value}-from").fill("70")  # takes the other end along
    expect(page.get_by_test_id(f"{value}-to")).to_have_value("70")
    page.get_by_test_id("entry-pick-second").click()
    click_image(page, 0.53, 0.72)  # what is red
    second = page.get_by_test_id("entry-second-hue-from")
    expect(second).to_be_visible()
    assert int(second.input_value()) > 340
    page.get_by_test_id("entry-second-value-to").fill("80")
    page.get_by_test_id("entry-gap").fill("0.5")
    page.get_by_test_id("entry-apply").click()
    expect(row(page, "tape")).to_be_visible()
    rule = operations.beware.list.named("tape").colour
    assert rule is not None and rule.pattern is not None
    assert (rule.min_value, rule.max_value) == (0.7, 0.7)
    assert (rule.pattern.max_value, rule.pattern.max_gap_m) == (0.8, 0.5)
    row(page, "tape").get_by_test_id("beware-edit").click()
    page.get_by_test_id("entry-unpattern").click()
    expect(second).to_be_hidden()
    page.get_by_test_id("entry-apply").click()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 2")
    rule = operations.beware.list.named("tape").colour
    assert rule is not None and rule.pattern is None


def test_rows_are_moved_by_keys_and_mouse(page: Page, operations: FakeOperations) -> None:
    await_map(page)
    first, second, third = names(operations)[:3]
    handle = row(page, first).get_by_test_id("beware-handle")
    handle.focus()
    page.keyboard.press("ArrowDown")
    expect(page.get_by_test_id("beware-version")).to_have_text("version 1")
    assert names(operations)[:3] == [second, first, third]
    page.mouse.move(*middle_of(row(page, third).get_by_test_id("beware-handle")))
    page.mouse.down()
    page.mouse.move(*middle_of(row(page, second)), steps=4)
    page.mouse.up()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 2")
    assert names(operations)[:3] == [third, second, first]


def test_an_edit_that_another_one_has_overtaken_is_applied_when_it_is_asked_for_again(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    row(page, "cup").get_by_test_id("beware-edit").click()
    operations.beware.edit("book", {"margin_m": 0.7})
    page.get_by_test_id("entry-margin").fill("0.3")
    apply, note = page.get_by_test_id("entry-apply"), page.get_by_test_id("entry-note")
    expect(note).not_to_have_text("")  # the effect
    apply.click()
    expect(note).to_contain_text("Another user has changed the list meanwhile")
    assert operations.beware.list.named("cup").margin_m != 0.3
    apply.click()
    expect(page.get_by_test_id("entry")).to_be_hidden()
    assert operations.beware.list.named("cup").margin_m == 0.3
    assert operations.beware.list.named("book").margin_m == 0.7


def test_versions_come_back_and_a_damaged_file_is_refused_by_line(
    page: Page, operations: FakeOperations, tmp_path: Path
) -> None:
    await_map(page)
    operations.beware.edit("cup", {"margin_m": 0.7})
    operations.beware.remove("book")
    expect(row(page, "book")).to_have_count(0)
    page.locator("[popovertarget=beware-versions]").click()
    oldest = page.get_by_test_id("beware-version-row").last
    for told in page.locator("#beware-versions small").all():  # who and when, not cut off
        assert told.evaluate("(told) => told.scrollWidth <= told.clientWidth")
    oldest.get_by_test_id("beware-compare").click()
    expect(oldest).to_contain_text("“book” added; “cup”: margin 0.7 m → 0.05 m")
    oldest.get_by_test_id("beware-restore").click()
    expect(row(page, "book")).to_be_visible()
    damaged = tmp_path / "list.toml"
    text = as_toml(operations.beware.list).replace("margin_m = 0.5", "margin_m = 50")
    damaged.write_text(text, encoding="utf-8")
    page.locator("[popovertarget=beware-files]").click()
    page.get_by_test_id("beware-file").set_input_files(damaged)
    expect(page.get_by_test_id("toasts")).to_contain_text("margin_m: 50.0 is out of range")
    expect(page.get_by_test_id("toasts")).to_contain_text("line ")
    assert operations.beware.list.version == 3


def proposal(page: Page) -> Locator:
    """Return the words of the edit that is not applied yet."""
    return page.get_by_test_id("proposal-note")


def test_a_class_that_is_switched_off_says_what_becomes_free_before_it_applies(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    operations.goals.add(3.0, 0.0)
    check = row(page, "red floor").get_by_role("checkbox")
    check.uncheck()
    expect(proposal(page)).to_contain_text("“red floor” switched off")
    expect(proposal(page)).to_contain_text("cells go, and the robot may drive there")
    expect(proposal(page)).to_contain_text("the path would be")
    assert operations.beware.list.version == 0
    cancel = page.get_by_test_id("proposal-cancel")
    cancel.press("Enter")
    expect(proposal(page)).to_have_count(0)
    expect(check).to_be_checked()
    expect(check).to_be_focused()
    check.press("Enter")  # as a press of the checkbox
    expect(proposal(page)).to_be_visible()
    page.keyboard.press("Escape")
    expect(proposal(page)).to_have_count(0)
    expect(check).to_be_checked()
    assert operations.beware.list.version == 0
    check.uncheck()
    page.get_by_test_id("proposal-apply").click()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 1")
    expect(row(page, "red floor")).to_have_class("off")
    check.check()  # the other way, it says what appears
    expect(proposal(page)).to_contain_text("cells appear")
    check.uncheck()  # as it was, so there is no edit
    expect(proposal(page)).to_have_count(0)
    assert operations.beware.list.version == 1


def test_edits_of_several_rows_are_tried_together_and_undone_one_by_one(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    row(page, "red floor").get_by_role("checkbox").uncheck()
    row(page, "cup").get_by_role("checkbox").uncheck()
    expect(proposal(page)).to_contain_text("“red floor” switched off; “cup” switched off")
    operations.beware.edit("book", {"margin_m": 0.3})  # by another operator, and none of these
    expect(page.get_by_test_id("beware-version")).to_have_text("version 1")
    page.get_by_test_id("proposal-apply").click()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 3")
    assert not operations.beware.list.named("red floor").enabled
    page.get_by_test_id("beware-undo").click()
    expect(row(page, "cup").get_by_role("checkbox")).to_be_checked()
    expect(row(page, "red floor").get_by_role("checkbox")).not_to_be_checked()


def test_an_edit_of_a_class_that_is_gone_is_gone_too(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    row(page, "red floor").get_by_role("checkbox").uncheck()
    expect(proposal(page)).to_be_visible()
    operations.beware.remove("red floor")  # by another operator
    expect(row(page, "red floor")).to_have_count(0)
    row(page, "cup").get_by_role("checkbox").uncheck()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 2")
    assert not operations.beware.list.named("cup").enabled


def test_an_edit_that_changes_nothing_on_the_map_applies_at_once(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    row(page, "cup").get_by_role("checkbox").uncheck()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 1")
    margin = row(page, "red floor").get_by_role("spinbutton").first
    margin.fill("0.4")  # it keeps farther away, and there is no path to bend
    margin.press("Enter")
    expect(page.get_by_test_id("beware-version")).to_have_text("version 2")
    margin.fill("0.1")
    margin.press("Enter")
    expect(proposal(page)).to_contain_text("the robot may come nearer to")
    # What another operator does makes it nothing, and yet what waits goes on waiting.
    operations.beware.edit("red floor", {"margin_m": 0.1})
    expect(proposal(page)).to_contain_text("no cell of the map changes", ignore_case=True)
    operations.beware.edit("red floor", {"margin_m": 0.4})
    expect(proposal(page)).to_contain_text("the robot may come nearer to")
    page.get_by_test_id("proposal-cancel").click()
    expect(margin).to_have_value("0.4")
    assert operations.beware.list.named("red floor").margin_m == 0.4


def test_whole_lists_are_tried_before_they_are_in_force(
    page: Page, operations: FakeOperations, tmp_path: Path
) -> None:
    await_map(page)
    operations.beware.edit("red floor", {"enabled": False})
    page.get_by_test_id("beware-ready-made").click()
    page.get_by_test_id("beware-defaults").click()
    expect(proposal(page)).to_contain_text("“red floor” switched on")
    page.locator("[popovertarget=beware-versions]").click()
    page.get_by_test_id("beware-restore").click()
    expect(page.locator("#beware-versions")).to_be_hidden()
    expect(proposal(page)).to_contain_text("cells appear")
    page.get_by_test_id("proposal-cancel").click()
    file = tmp_path / "list.toml"
    file.write_text(as_toml(operations.beware.version(0).list), encoding="utf-8")
    page.locator("[popovertarget=beware-files]").click()
    page.get_by_test_id("beware-file").set_input_files(file)
    expect(proposal(page)).to_contain_text("cells appear")
    assert operations.beware.list.version == 1
    page.get_by_test_id("proposal-apply").click()
    expect(page.get_by_test_id("toasts")).to_contain_text("The list of the file is in force")
    assert operations.beware.list.named("red floor").enabled


def test_without_a_map_an_edit_says_so_and_can_be_applied(
    page: Page, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    def without_map(beware: BewareList) -> ListPreview:
        raise Refused("there is no map now; the camera delivers no image")

    await_map(page)
    monkeypatch.setattr(operations, "preview_list", without_map)
    row(page, "cup").get_by_role("checkbox").uncheck()
    expect(proposal(page)).to_contain_text("There is no map now")
    page.get_by_test_id("proposal-apply").click()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 1")
    row(page, "book").get_by_test_id("beware-edit").click()
    page.get_by_test_id("entry-margin").fill("0.3")
    expect(page.get_by_test_id("entry-note")).to_contain_text("there is no map now")
    page.get_by_test_id("entry-apply").click()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 2")
