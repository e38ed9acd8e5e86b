"""*Beware of this* in the page: a click on a thing, a name, Enter; and without a network."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

import pytest
from playwright.sync_api import Page, Route, expect

from navcore.errors import Refused
from navcore.mission.prototype import Prototype
from tests.navcore.perception.colour_network import ColourNetwork
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import await_map
from tests.web.page.test_beware_page import names, row

BOX, FLOOR = (45 / 320, 75 / 180), (0.1, 0.95)


def click_camera(page: Page, right: float, down: float) -> None:
    """Click into the camera image, at shares of its width and height."""
    camera = page.get_by_test_id("camera")
    box = camera.bounding_box()
    assert box is not None
    camera.click(position={"x": right * box["width"], "y": down * box["height"]})


class TestWithNetwork:
    @pytest.fixture
    def operations(self) -> FakeOperations:
        """Return a robot whose network has features."""
        return FakeOperations(network=ColourNetwork())

    def test_a_thing_is_clicked_named_and_in_the_list_with_enter(
        self, page: Page, operations: FakeOperations
    ) -> None:
        await_map(page)
        page.get_by_test_id("beware-this").click()
        note = page.get_by_test_id("entry-example-note")
        expect(note).to_contain_text("Click the thing in the camera image")
        click_camera(page, *FLOOR)
        page.keyboard.type("crate b")  # neither the space bar nor B are keys of the page here
        expect(page.get_by_text("there is only floor there").first).to_be_visible()
        expect(page.get_by_test_id("entry-name")).to_have_value("crate b")
        assert not operations.state().stop_latched
        click_camera(page, *BOX)
        expect(page.get_by_test_id("camera-mask")).to_be_visible()
        expect(note).to_contain_text("1 click; it takes")
        expect(page.get_by_test_id("entry-eyes")).to_have_text("Detected by: example")
        page.get_by_test_id("entry-name").select_text()
        page.keyboard.type("crate")
        expect(page.get_by_test_id("entry-apply")).to_be_enabled()
        page.keyboard.press("Enter")
        expect(row(page, "crate").get_by_test_id("found-by")).to_have_text("example")
        assert operations.beware.list.named("crate").prototype is not None
        expect(page.get_by_test_id("entry")).to_be_hidden()
        expect(page.get_by_test_id("camera-mask")).to_be_hidden()
        page.get_by_test_id("map-canvas").focus()
        page.keyboard.press("Control+z")
        expect(row(page, "crate")).to_have_count(0)
        assert "crate" not in names(operations)

    def test_three_clicks_make_a_class_each_in_the_image_that_was_shown(
        self, page: Page, operations: FakeOperations
    ) -> None:
        await_map(page)
        page.get_by_test_id("beware-this").click()
        note = page.get_by_test_id("entry-example-note")
        for count in range(1, 4):
            operations.step()  # the next image
            frame = str(operations.newest_tick().serial)  # type: ignore[union-attr]
            expect(page.get_by_test_id("camera")).to_have_attribute("data-frame", frame)
            with page.expect_request("**/beware/example/click") as sent:
                click_camera(page, BOX[0] + 0.01 * count, BOX[1])
            click = sent.value.post_data_json
            assert click is not None and click["frame"] == frame
            expect(note).to_contain_text(f"{count} click")
        page.get_by_test_id("entry-name").fill("crate")
        expect(page.get_by_test_id("entry-apply")).to_be_enabled()
        page.keyboard.press("Enter")
        expect(row(page, "crate").get_by_test_id("found-by")).to_have_text("example")
        made = operations.beware.list.named("crate").prototype
        assert made is not None and made.clicks == 3

    def test_a_refused_click_leaves_no_mask_and_makes_room_for_the_next_one(
        self, page: Page, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        examples, refusal = operations.examples, Refused("it looks too much like what is around it")
        made, sent = examples.made, []

        def second_is_refused(taken: Sequence[str], away: Sequence[str] = ()) -> Prototype:
            sent.append(taken)
            if len(sent) == 2:
                raise refusal
            return made(taken, away)

        monkeypatch.setattr(examples, "made", second_is_refused)
        await_map(page)
        page.get_by_test_id("beware-this").click()
        note, mask = page.get_by_test_id("entry-example-note"), page.get_by_test_id("camera-mask")
        click_camera(page, *BOX)
        expect(note).to_contain_text("1 click; it takes")
        click_camera(page, *BOX)
        expect(note).to_have_text("It looks too much like what is around it")
        expect(mask).to_be_hidden()
        expect(page.get_by_test_id("entry-eyes")).to_have_text("Detected by: example")
        click_camera(page, *BOX)
        expect(note).to_contain_text("2 clicks; it takes")
        assert sent[2][0] == sent[0][0] and sent[1][1] not in sent[2]

    def test_the_mask_of_a_click_is_not_shown_over_a_later_image(
        self, page: Page, operations: FakeOperations
    ) -> None:
        await_map(page)
        page.get_by_test_id("beware-this").click()
        held: list[Route] = []
        page.route("**/beware/example", lambda route: held.append(route))
        click_camera(page, *BOX)
        mask = page.get_by_test_id("camera-mask")
        expect(mask).to_be_visible()
        operations.step()
        expect(mask).to_be_hidden()
        held.pop().continue_()
        expect(mask).to_be_visible()

    def test_a_click_into_an_image_that_is_gone_says_that_the_picture_has_moved_on(
        self, page: Page
    ) -> None:
        await_map(page)
        page.get_by_test_id("beware-this").click()
        expect(page.get_by_test_id("camera")).to_have_attribute("data-frame", re.compile(r"\d"))
        page.get_by_test_id("camera").evaluate("(image) => { image.dataset.frame = '7'; }")
        click_camera(page, *BOX)
        expect(page.get_by_test_id("toasts")).to_contain_text("the picture has moved on")

    def test_a_class_of_another_network_says_so_and_is_shown_again(
        self, page: Page, operations: FakeOperations
    ) -> None:
        await_map(page)
        page.get_by_test_id("beware-this").click()
        click_camera(page, *BOX)
        expect(page.get_by_test_id("entry-eyes")).to_have_text("Detected by: example")
        page.get_by_test_id("entry-name").fill("crate")
        expect(page.get_by_test_id("entry-apply")).to_be_enabled()
        page.keyboard.press("Enter")
        expect(row(page, "crate").get_by_test_id("found-by")).to_have_text("example")

        prototype = operations.beware.list.named("crate").prototype
        assert prototype is not None
        foreign = dataclasses.asdict(prototype) | {"network": "other"}
        operations.beware.edit("crate", {"prototype": foreign})
        expect(row(page, "crate").get_by_test_id("found-by")).to_have_text("▲ not detected")
        row(page, "crate").get_by_test_id("beware-edit").click()
        eyes = page.get_by_test_id("entry-eyes")
        expect(eyes).to_have_text("▲ It was shown to another network. Click the thing again.")
        click_camera(page, *BOX)
        expect(eyes).to_have_text("Detected by: example")
        expect(page.get_by_test_id("entry-apply")).to_be_enabled()
        page.keyboard.press("Enter")
        expect(row(page, "crate").get_by_test_id("found-by")).to_have_text("example")
        expect(page.get_by_test_id("entry")).to_be_hidden()


def test_without_a_network_the_page_says_why_the_button_is_off(page: Page) -> None:
    await_map(page)
    expect(page.get_by_test_id("beware-this")).to_be_disabled()
    note = page.get_by_test_id("beware-this-note")
    expect(note).to_contain_text("Only colour rules run here")
