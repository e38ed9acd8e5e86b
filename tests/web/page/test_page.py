"""The operator's page in a real Chromium: what an operator does, and what the console then has."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

import httpx
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Route, WebSocketRoute, expect

from navcore.localisation.estimate import LocalisationState
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Phase
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_TOPMOST, await_map, click_map, map_view
from web.interface.drafts import ZoneDraft
from web.interface.localisation import PlaceOut
from web.server import ConsoleServer

CORNER = ((-5.0, -4.0), (-4.0, -4.0), (-4.0, -3.0))


def test_the_whole_console_fits_a_small_screen_without_scrolling(page: Page) -> None:
    size = page.evaluate(
        "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
    )
    assert size == [1280, 720]
    for name in (
        "stop",
        "reset",
        "start",
        "goals",
        "zones",
        "beware",
        "camera",
        "state-text",
    ):
        expect(page.get_by_test_id(name)).to_be_in_viewport(
            ratio=0.0 if name in ("goals", "zones") else 0.9
        )


def test_a_zone_drawn_on_the_map_bends_the_path_and_the_robot_arrives(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.get_by_test_id("mode-goal").click()
    click_map(page, 6.0, 0.5)
    expect(page.get_by_test_id("goal")).to_have_count(1)
    straight = operations.state().distance_to_goal_m
    page.get_by_test_id("mode-draw").click()
    for corner in ((3.0, -2.0), (3.6, -2.0), (3.6, 2.2)):
        click_map(page, *corner)
    expect(page.get_by_test_id("draft-note")).to_contain_text("the path would be")
    page.get_by_test_id("zone-name").fill("Wet floor")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("zone")).to_have_attribute("data-name", "Wet floor")
    bent = operations.state().distance_to_goal_m
    assert straight is not None and bent is not None and bent > straight + 0.3
    page.get_by_test_id("start").click()
    expect(page.get_by_test_id("state-badge")).to_contain_text("DRIVING")
    while operations.state().phase is Phase.DRIVING:
        operations.step()
    expect(page.get_by_test_id("goal-reached")).to_have_count(1)
    expect(page.get_by_test_id("state-badge")).to_contain_text("IDLE")


@pytest.mark.long
def test_clicks_in_the_3d_view_draw_a_zone(page: Page, operations: FakeOperations) -> None:
    page.get_by_test_id("view-3d").click()
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")
    page.get_by_test_id("mode-draw").click()
    box = page.get_by_test_id("view-3d-frame").bounding_box()
    assert box is not None
    for count, (x, y) in enumerate(((0.35, 0.55), (0.5, 0.55), (0.5, 0.7)), 1):
        page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])
        expect(page.get_by_test_id("draft-note")).to_contain_text(f"{count} corner")
    # Keys pressed while the 3D view has the focus are the console's own.
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("zone")).to_have_count(1)
    assert len(operations.zones.stored[0].polygon) == 3
    page.keyboard.press("Space")
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
    assert operations.stops == ["console key"]


def test_the_stop_is_one_key_or_one_click_gives_a_reason_and_lasts_until_a_reset(
    page: Page, operations: FakeOperations
) -> None:
    operations.goals.add(3, 0)
    operations.mission("start")
    expect(page.get_by_test_id("state-badge")).to_contain_text("DRIVING")
    # The space key stops even while another button has the focus, and does not press that button.
    page.get_by_test_id("pause").focus()
    page.keyboard.press("Space")
    expect(page.get_by_test_id("state-text")).to_contain_text("Emergency stop by console key")
    assert operations.state().phase is Phase.DRIVING
    with page.expect_request("**/stop/reset?stops=1"):  # and no newer one
        page.get_by_test_id("reset").click()
    expect(page.get_by_test_id("state-badge")).to_contain_text("PAUSED")
    page.get_by_test_id("stop").click()
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
    # In a text field it is a space.
    page.get_by_test_id("reset").click()
    expect(page.get_by_test_id("reset")).to_be_disabled()
    page.get_by_test_id("goal-input").fill("1,")
    page.keyboard.press("Space")
    expect(page.get_by_test_id("goal-input")).to_have_value("1, ")
    assert not operations.state().stop_latched


def test_refusals_are_shown_in_words_and_typed_input_does_the_whole_job(
    page: Page, operations: FakeOperations
) -> None:
    for typed, words in (
        ("9900, 0", "too far away"),
        ("4, 2.5", "inside an obstacle"),
        ("here", "is no goal"),
    ):
        page.get_by_test_id("goal-input").fill(typed)
        page.get_by_test_id("goal-add").click()
        expect(page.get_by_test_id("toasts")).to_contain_text(words)
        expect(page.get_by_test_id("goal-input")).to_have_value(typed)  # to be corrected
    page.get_by_test_id("mode-draw").click()
    page.get_by_test_id("zone-corners").fill("0, 3\n1, 4\n1, 3\n0, 4")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("draft-note")).to_contain_text("crosses itself")
    page.get_by_test_id("zone-corners").fill("0, 3; 1, 3; 1, 4; 0, 4")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("zone")).to_have_count(1)
    page.get_by_test_id("zone-rename").fill("Carpet")
    page.keyboard.press("Tab")
    expect(page.get_by_test_id("zone")).to_have_attribute("data-name", "Carpet")
    page.get_by_test_id("zone-enabled").uncheck()
    expect(page.get_by_test_id("zone")).to_have_class(re.compile("off"))
    assert [(zone.name, zone.enabled) for zone in operations.zones.stored] == [("Carpet", False)]
    page.get_by_test_id("zone-delete").click()
    expect(page.get_by_test_id("zone")).to_have_count(0)


def test_a_late_answer_does_not_clear_what_was_typed_since(
    page: Page, operations: FakeOperations
) -> None:
    held: list[Route] = []
    page.route("**/api/v1/goals", lambda route: held.append(route))
    typed, add = page.get_by_test_id("goal-input"), page.get_by_test_id("goal-add")
    typed.fill("3, 0")
    with page.expect_request("**/api/v1/goals"):
        add.click()
    typed.fill("3, 1")
    with page.expect_response("**/api/v1/goals"):
        held.pop().continue_()
    expect(page.get_by_test_id("goal")).to_have_count(1)
    expect(typed).to_have_value("3, 1")
    with page.expect_request("**/api/v1/goals"):
        add.click()
    held.pop().continue_()
    expect(typed).to_have_value("")
    assert [(goal.x_m, goal.y_m) for goal in operations.state().queue] == [(3.0, 0.0), (3.0, 1.0)]


def test_the_stream_of_states_overwrites_no_edit_and_a_conflict_is_reported(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.get_by_test_id("mode-draw").click()
    page.get_by_test_id("zone-corners").fill("0, 3; 1, 3; 1, 4; 0, 4")
    page.get_by_test_id("zone-finish").click()
    page.get_by_test_id("zone-edit").click()
    page.get_by_test_id("zone-name").fill("Mine")
    stored = operations.zones.stored[0]
    operations.zones.replace(stored.id, ZoneDraft(name="Theirs", polygon=stored.polygon))
    expect(page.get_by_test_id("zone")).to_have_attribute("data-name", "Theirs")
    for _ in range(3):
        operations.step()
    expect(page.get_by_test_id("zone-name")).to_have_value("Mine")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("draft-note")).to_contain_text("This zone has changed meanwhile")
    assert operations.zones.stored[0].name == "Theirs"
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("zone")).to_have_attribute("data-name", "Mine")


def test_a_class_switched_off_and_on_changes_the_map(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    blocked = operations.newest_tick().blocked.sum()  # type: ignore[union-attr]
    page.get_by_test_id("beware-1").uncheck()
    page.get_by_test_id("proposal-apply").click()
    expect(page.get_by_test_id("beware-class").first).to_have_class(re.compile("off"))
    assert operations.newest_tick().blocked.sum() < blocked  # type: ignore[union-attr]
    page.get_by_test_id("beware-1").check()
    page.get_by_test_id("proposal-apply").click()
    expect(page.get_by_test_id("beware-class").first).not_to_have_class(re.compile("off"))
    assert operations.newest_tick().blocked.sum() == blocked  # type: ignore[union-attr]


def test_the_beware_list_is_edited_in_place_and_names_classes_without_a_detector(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    cup = page.locator('[data-testid="beware-class"][data-name="cup"]')
    expect(cup.get_by_test_id("found-by")).to_have_text("colour rule")
    expect(page.locator('[data-name="cable"]').get_by_test_id("found-by")).to_have_text(
        "▲ not detected"
    )
    cup.get_by_label("Least confidence for cup in percent").fill("80")
    cup.get_by_label("Least confidence for cup in percent").press("Enter")
    expect(page.get_by_test_id("beware-version")).to_have_text("version 1")
    assert operations.beware.list.named("cup").min_confidence == 0.8
    margin, said = cup.get_by_label("Margin around cup in metres"), cup.get_by_role("alert")
    stored = margin.input_value()
    for wrong in ("99", "-1", ""):
        margin.fill(wrong)
        margin.press("Enter")
        expect(said).to_have_text("Margin around cup in metres: 0 to 2 m.")
        expect(margin).to_have_value(stored)
        expect(margin).to_have_attribute("aria-invalid", "true")
    margin.fill("0.4")
    margin.press("Enter")
    expect(said).to_be_hidden()
    expect(page.get_by_test_id("beware-version")).to_have_text("version 2")
    assert operations.beware.list.named("cup").margin_m == 0.4


def test_a_beware_list_without_a_class_gives_a_warning_and_defaults_come_back(
    page: Page, operations: FakeOperations
) -> None:
    shipped, warning = operations.beware.list.classes, page.get_by_test_id("nothing-enabled")
    expect(page.get_by_test_id("beware-class")).to_have_count(len(shipped))
    expect(warning).to_be_hidden()
    expect(page.get_by_test_id("beware-undo")).to_be_disabled()
    operations.beware.replace(BewareList(classes=()), force=True)
    expect(warning).to_contain_text("keeps away from nothing")
    expect(page.get_by_test_id("beware-class")).to_have_count(0)
    page.get_by_test_id("beware-ready-made").click()
    page.get_by_test_id("beware-defaults").click()
    page.get_by_test_id("proposal-apply").click()
    expect(page.get_by_test_id("beware-class")).to_have_count(len(shipped))
    expect(warning).to_be_hidden()
    assert operations.beware.list.classes == shipped
    enabled = [entry.name for entry in shipped if entry.enabled]
    for name in enabled:
        operations.beware.edit(name, {"enabled": False})
    expect(warning).to_be_in_viewport(ratio=1.0)
    page.get_by_test_id("beware-undo").click()
    expect(warning).to_be_hidden()
    assert [entry.name for entry in operations.beware.list.enabled] == enabled[-1:]


def test_a_network_that_does_not_run_is_reported_on_the_page(
    page: Page, operations: FakeOperations
) -> None:
    expect(page.get_by_test_id("segmenter")).to_have_text("colour rules")
    operations.segmenter_warning = "The network does not run: the weights are damaged"
    operations.step()
    expect(page.get_by_test_id("segmenter")).to_contain_text("weights are damaged")


def test_a_stop_and_a_map_that_cannot_be_stored_are_told_until_they_are(
    page: Page, operations: FakeOperations
) -> None:
    toasts = page.locator("#toasts")
    operations.stop_warning = "the emergency stop cannot be stored: No space left on device"
    for _ in range(2):
        operations.step()
    expect(toasts.locator(".toast")).to_have_count(1)
    expect(toasts).to_contain_text("The emergency stop cannot be stored: No space left on device")
    operations.stop_warning = None
    operations.storage_warning = "the map cannot be stored: No space left on device"
    operations.step()
    expect(toasts.locator(".toast")).to_have_count(1)
    expect(toasts).to_contain_text("The map cannot be stored: No space left on device")
    toasts.get_by_label("Dismiss").click()
    operations.step()
    expect(toasts.locator(".toast")).to_have_count(0)
    page.evaluate("const now = Date.now; Date.now = () => now() + 601000")
    operations.step()
    expect(toasts).to_contain_text("The map cannot be stored: No space left on device")
    operations.storage_warning = None
    operations.step()
    expect(toasts.locator(".toast")).to_have_count(0)


def test_a_lost_connection_is_reported_and_the_page_reconnects(
    browser: Browser, operations: FakeOperations
) -> None:
    console = ConsoleServer(operations, port=0)
    console.start()
    context = browser.new_context()
    page = context.new_page()
    page.goto(f"{console.url}/#map")
    expect(page.get_by_test_id("connection")).to_have_text("live")
    operations.goals.add(2.0, 0.0)
    operations.step()
    start = page.get_by_test_id("start")
    expect(start).to_be_enabled()
    console.stop()
    expect(page.get_by_test_id("state-badge")).to_have_text("? UNKNOWN")
    told = page.get_by_test_id("state-text")
    expect(told).to_contain_text("NO CONNECTION")
    assert told.evaluate("(text) => text.scrollHeight <= text.clientHeight + 1")
    for size in ((1280, 720), (390, 844)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        offline = page.get_by_test_id("offline")
        expect(offline).to_contain_text("stops by itself")
        expect(offline).to_be_in_viewport(ratio=1.0)
        assert offline.evaluate(IS_TOPMOST)
    page.set_viewport_size({"width": 1280, "height": 720})
    # The 3D view is not being made then.
    page.get_by_test_id("view-3d").click()
    expect(page.locator("#gone")).to_be_hidden()
    page.get_by_test_id("view-map").click()
    expect(page.get_by_test_id("control-text")).to_have_text("? Control unknown")
    expect(start).to_be_disabled()
    again = ConsoleServer(operations, port=int(console.url.rsplit(":", 1)[1]))
    again.start()
    try:
        expect(page.get_by_test_id("connection")).to_have_text("live")
        expect(page.get_by_test_id("offline")).to_be_hidden()
        expect(page.get_by_test_id("state-badge")).to_have_text("● IDLE")
        expect(start).to_be_enabled()
    finally:
        again.stop()
        context.close()


def test_without_a_connection_no_state_is_told_and_each_comes_back_with_it(
    browser: Browser, operations: FakeOperations
) -> None:
    console = ConsoleServer(operations, port=0)
    console.start()
    page = browser.new_context().new_page()
    page.goto(f"{console.url}/#map")
    expect(page.get_by_test_id("connection")).to_have_text("live")
    page.get_by_test_id("goal-input").fill("2, 0")
    page.get_by_test_id("goal-add").click()
    page.get_by_test_id("start").click()
    page.get_by_test_id("stop").click()
    operations.place.now = PlaceOut(state=LocalisationState.LOST, text="Lost: look round.")
    has_control, is_lost = page.get_by_test_id("control-give"), page.get_by_test_id("place-unknown")
    told = [*page.locator("#figures dd").all(), page.get_by_test_id("segmenter")]
    told += [page.locator("#goal-count"), page.locator("#goals .status")]

    def expect_all_live() -> None:
        expect(page.get_by_test_id("reset")).to_be_enabled()
        expect(page.get_by_test_id("stop")).to_have_attribute("aria-pressed", "true")
        expect(is_lost).to_be_visible()
        for one in told:
            expect(one).not_to_have_text("unknown")

    expect_all_live()
    expect(has_control).to_be_visible()
    console.stop()
    expect(page.get_by_test_id("state-badge")).to_have_text("? UNKNOWN")
    expect(page.get_by_test_id("control-text")).to_have_text("? Control unknown")
    for one in told:
        expect(one).to_have_text("unknown")
    expect(is_lost).to_be_hidden()
    expect(has_control).to_be_hidden()
    expect(page.get_by_test_id("reset")).to_be_disabled()
    expect(page.get_by_test_id("stop")).to_have_attribute("aria-pressed", "mixed")
    again = ConsoleServer(operations, port=int(console.url.rsplit(":", 1)[1]))
    again.start()
    try:
        expect_all_live()
    finally:
        again.stop()
        page.context.close()


def test_zones_whose_answer_was_lost_to_the_stop_are_asked_for_again(
    page: Page, operations: FakeOperations
) -> None:
    held: list[Route] = []
    page.route("**/api/v1/zones", lambda route: held.append(route))  # not answered
    with page.expect_request("**/api/v1/zones"):
        operations.zones.add(ZoneDraft(name="desk", polygon=CORNER))
    page.keyboard.press("Space")
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
    page.unroute("**/api/v1/zones")
    expect(page.get_by_test_id("zone")).to_have_attribute("data-name", "desk")


@pytest.mark.parametrize("is_silent", [False, True])
def test_a_page_that_connects_again_has_the_zones_of_now(
    is_silent: bool, page: Page, client: httpx.Client, operations: FakeOperations
) -> None:
    operations.zones.add(ZoneDraft(name="desk", polygon=CORNER))
    renamed = json.loads(client.get("/api/v1/zones").text.replace("desk", "door"))
    links: list[WebSocketRoute] = []
    silent: list[WebSocketRoute] = []

    def pass_on(link: WebSocketRoute) -> None:
        console = link.connect_to_server()
        links.append(link)
        console.on_message(lambda text: None if link in silent else link.send(text))

    page.route_web_socket("**/api/v1/events", pass_on)
    page.reload()
    expect(page.get_by_test_id("zone")).to_have_attribute("data-name", "desk")
    # As a console that was started again, and has counted to the same number.
    page.route("**/api/v1/zones", lambda route: route.fulfill(json=renamed))
    if is_silent:
        silent.append(links[0])
    else:
        links[0].close()
    expect(page.get_by_test_id("zone")).to_have_attribute("data-name", "door")
    expect(page.get_by_test_id("connection")).to_have_text("live")


def test_the_space_key_stops_wherever_a_blank_means_nothing(
    page: Page, operations: FakeOperations
) -> None:
    fields = {
        "number": "<input type=number id=probe>",
        "list": "<select id=probe><option>a<option>b</select>",
    }
    for count, (name, field) in enumerate(fields.items(), 1):
        page.evaluate("field => document.body.insertAdjacentHTML('beforeend', field)", field)
        page.locator("#probe").focus()
        page.keyboard.press("Space")
        expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
        assert operations.stops == ["console key"] * count, name
        page.evaluate("document.getElementById('probe').remove()")
        page.get_by_test_id("reset").click()
        expect(page.get_by_test_id("reset")).to_be_disabled()


def test_the_stop_aborts_the_pending_requests_of_the_page(
    page: Page, operations: FakeOperations
) -> None:
    held: list[object] = []
    page.route("**/api/v1/hang**", lambda route: held.append(route))  # never answered
    page.evaluate(
        """async (count) => {
            const { get } = await import("/page/core/link/api.js");
            window.failed = 0;
            const onFailure = (error) => {
                window.failed += /let the stop through/.test(error.message);
            };
            for (let i = 0; i < count; i += 1) get(`/hang?${i}`).catch(onFailure);
        }""",
        8,
    )
    page.wait_for_function("() => document.querySelector('.progress:not([hidden])')")
    assert len(held) == 8 and page.evaluate("window.failed") == 0
    page.keyboard.press("Space")
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
    page.wait_for_function("() => window.failed === 8")
    assert operations.stops[0] == "console key"


def test_the_whole_map_stays_in_view_while_it_grows_and_a_chosen_view_stays_where_it_is(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    canvas = page.get_by_test_id("map-canvas")
    known = map_view(page)
    page.get_by_test_id("fit").click()  # from what is known to the whole map
    expect(canvas).not_to_have_attribute("data-place", re.compile(f"^{known[0]} "))
    before = map_view(page)
    operations.grow(-30.0, 0.0)
    expect(canvas).not_to_have_attribute("data-place", re.compile(f"^{before[0]} "))
    grown = map_view(page)
    assert grown[0] < before[0] and grown[1] < before[1] - 5.0
    canvas.hover()
    page.mouse.wheel(0, -300)
    expect(canvas).not_to_have_attribute("data-place", re.compile(f"^{grown[0]} "))
    chosen = map_view(page)
    with page.expect_response(lambda answer: "/map/tiles?" in answer.url):
        operations.grow(60.0, 0.0)
    assert map_view(page) == chosen


def test_a_goal_beyond_the_map_is_picked_where_it_was_clicked(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    canvas = page.get_by_test_id("map-canvas")
    canvas.hover()
    page.mouse.wheel(0, 400)
    page.get_by_test_id("mode-goal").click()
    click_map(page, 11.0, 0.5)
    expect(page.get_by_test_id("goal")).to_have_count(1)
    (goal,) = operations.state().queue
    assert abs(goal.x_m - 11.0) < 0.1 and abs(goal.y_m - 0.5) < 0.1


def test_an_error_in_the_handling_of_the_state_is_told_and_no_state_counts_as_shown(
    new_context: Callable[..., BrowserContext], server: ConsoleServer
) -> None:
    page = new_context().new_page()
    page.goto(f"{server.url}/#map")
    expect(page.get_by_test_id("connection")).to_have_text("live")
    page.evaluate("document.getElementById('goals').remove()")
    expect(page.get_by_test_id("toasts")).to_contain_text("Error in this page")
    expect(page.get_by_test_id("connection")).to_have_text("no connection")


def test_errors_of_the_page_leave_room_and_are_told_again_after_they_were_dismissed(
    new_context: Callable[..., BrowserContext], server: ConsoleServer
) -> None:
    page = new_context().new_page()
    page.clock.install()
    page.goto(f"{server.url}/#map")
    expect(page.get_by_test_id("connection")).to_have_text("live")
    fail = "(errors) => { for (const error of errors) Promise.reject(error); }"
    page.evaluate(fail, [{"status": 0, "message": "aborted"}])
    page.evaluate(fail, ["one", "two", "one", "three", "four"])
    shown = page.locator("#toasts .toast")
    expect(shown).to_contain_text(["one", "two", "three"])
    for _ in range(3):
        shown.first.get_by_label("Dismiss").click()
    page.evaluate(fail, ["one", "four"])
    expect(shown).to_contain_text(["four"])
    page.clock.fast_forward(60_000)
    page.evaluate(fail, ["one"])
    expect(shown).to_contain_text(["four", "one"])


def test_what_is_known_is_fitted_with_as_many_corners_as_zones_may_have(page: Page) -> None:
    await_map(page)
    page.evaluate(
        """async () => {
            const { world } = await import("/page/map/world.js");
            const ring = Array.from({ length: 500_000 }, (_, i) => [i / 10_000, 0]);
            const properties = { name: "wide", enabled: true, colour: [255, 0, 0] };
            world.zones = [{ id: "wide", geometry: { coordinates: [ring] }, properties }];
            (await import("/page/map/map.js")).fit();
            (await import("/page/map/map.js")).fit();
            await new Promise((resolve) => setTimeout(resolve, 500)); // and it is drawn
        }"""
    )
