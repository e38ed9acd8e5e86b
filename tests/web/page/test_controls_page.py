"""Keys, buttons, saved lists, camera image, plots and the page of the interface in a browser."""

from __future__ import annotations

import dataclasses
import json
import re

import pytest
from playwright.sync_api import Page, expect

from navcore.geometry.transform import Twist
from navcore.localisation.estimate import LocalisationState
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_TOPMOST, await_map, click_map, eventually, middle_of
from web.server import ConsoleServer

OVERLAPS = """() => [...document.querySelectorAll(".chart")].flatMap((chart) => {
  const texts = [...chart.querySelectorAll("text")]
    .map((text) => [text.textContent, text.getBoundingClientRect()]);
  return texts.flatMap(([one, a], i) => texts.slice(i + 1)
    .filter(([, b]) => a.left < b.right && b.left < a.right
      && a.top + 2 < b.bottom && b.top + 2 < a.bottom)
    .map(([other]) => `${one} and ${other}`));
})"""
"""JavaScript: texts of a plot of which one covers the other."""
TICKS = """async ([low, high]) => {
  const { ticksOf } = await import("/page/insight/plots/ticks.js");
  return ticksOf(low, high);
}"""


def test_letters_typed_on_a_focused_button_are_no_shortcuts(
    page: Page, operations: FakeOperations
) -> None:
    theme = page.evaluate("document.documentElement.dataset.theme")
    page.get_by_test_id("missions").click()
    page.get_by_test_id("missions-save").focus()
    page.keyboard.type("Roundm1")
    assert page.evaluate("document.documentElement.dataset.theme") == theme
    expect(page.get_by_test_id("draft")).to_be_hidden()
    expect(page.get_by_test_id("view-map")).to_have_attribute("aria-selected", "true")
    page.keyboard.press("Escape")
    # After a click on a tool the keys belong to the map again.
    page.get_by_test_id("mode-goal").click()
    page.keyboard.press("o")
    expect(page.get_by_test_id("zone-tool")).to_have_value("circle")
    assert operations.stops == []


def test_a_robot_in_a_beware_area_without_any_zone_can_leave_the_area(
    page: Page, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = operations.state
    monkeypatch.setattr(operations, "state", lambda: dataclasses.replace(state(), in_zone=True))
    leave = page.get_by_test_id("leave")
    expect(leave).to_be_enabled()
    expect(leave).to_have_text("⇥ Leave area")
    expect(leave).to_have_attribute("title", "Drive out of the area by the shortest path")


def test_a_saved_mission_is_replaced_only_after_a_question(
    page: Page, operations: FakeOperations
) -> None:
    operations.goals.add(3.0, 0.0)
    operations.goals.add(5.0, -3.0)
    operations.goals.save("round")
    operations.goals.add(-5.0, -3.0)
    page.get_by_test_id("missions").click()
    expect(page.get_by_test_id("missions-entry")).to_contain_text("2 goals")
    page.get_by_test_id("missions-name").fill("round")
    page.get_by_test_id("missions-save").click()
    replace = page.get_by_test_id("toast-action").filter(has_text="Replace")
    expect(replace).to_be_visible()
    assert len(operations.goals.missions()["round"].goals) == 2
    replace.click()
    expect(page.get_by_test_id("toasts")).to_contain_text("“round” is saved")
    assert len(operations.goals.missions()["round"].goals) == 3
    page.get_by_test_id("missions").click()
    # The list as it is after the saving: its buttons take the place of those before.
    expect(page.get_by_test_id("missions-entry")).to_contain_text("3 goals")
    delete = page.get_by_test_id("missions-entry").get_by_role("button").last
    delete.click()
    expect(delete).to_have_text("Delete?")
    assert "round" in operations.goals.missions()
    delete.click()
    expect(page.get_by_test_id("missions-entry")).to_have_count(0)
    assert operations.goals.missions() == {}


def test_a_zone_cannot_be_finished_before_it_is_one(page: Page) -> None:
    await_map(page)
    page.keyboard.press("o")
    finish, note = page.get_by_test_id("zone-finish"), page.get_by_test_id("draft-note")
    expect(finish).to_be_disabled()
    expect(note).to_contain_text("2 more points needed")
    page.keyboard.press("Enter")
    expect(note).to_contain_text("not complete")
    click_map(page, 3.0, 3.0)
    expect(finish).to_be_disabled()
    click_map(page, 3.5, 3.0)
    expect(finish).to_be_enabled()


def test_a_button_that_would_be_refused_is_off_and_says_why(
    page: Page, operations: FakeOperations
) -> None:
    start, reset = page.get_by_test_id("start"), page.get_by_test_id("reset")
    expect(start).to_have_attribute("title", "Add a goal first")
    operations.goals.add(3.0, 0.0)
    expect(start).to_be_enabled()
    operations.place.now = dataclasses.replace(operations.place.now, state=LocalisationState.LOST)
    expect(start).to_have_attribute("title", "The robot does not know where it is")
    operations.place.now = dataclasses.replace(
        operations.place.now, state=LocalisationState.LOCATED
    )
    expect(start).to_be_enabled()
    expect(reset).to_have_attribute("title", "No stop is latched")
    page.get_by_test_id("stop").click()
    expect(start).to_be_disabled()
    expect(start).to_have_attribute("title", re.compile("reset it first"))


def test_a_heading_beyond_a_full_turn_is_refused(page: Page, operations: FakeOperations) -> None:
    page.get_by_test_id("goal-input").fill("3, 0, 400")
    page.get_by_test_id("goal-add").click()
    expect(page.get_by_test_id("toasts")).to_contain_text("400°")
    assert operations.state().queue == ()


def test_the_view_is_remembered_without_its_address(page: Page, server: ConsoleServer) -> None:
    page.goto(server.url)  # as after a log-in
    expect(page.get_by_test_id("view-map")).to_have_attribute("aria-selected", "true")
    page.get_by_test_id("view-3d").click()
    page.goto("about:blank")
    page.goto(server.url)
    expect(page.get_by_test_id("view-3d")).to_have_attribute("aria-selected", "true")


def test_camera_image_and_map_change_places_and_the_page_names_what_is_seen(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    operations.step()
    name = page.get_by_test_id("camera-label")
    expect(name).to_have_text("red floor 90 %")
    small = page.get_by_test_id("camera").bounding_box()
    page.get_by_test_id("map-canvas").focus()
    page.keyboard.press("c")
    large = page.get_by_test_id("camera").bounding_box()
    assert small is not None and large is not None and large["width"] > 1.8 * small["width"]
    assert large["width"] / large["height"] == pytest.approx(320 / 180, rel=0.02)
    assert page.get_by_test_id("map-canvas").evaluate(IS_TOPMOST)
    expect(name).to_be_in_viewport(ratio=1.0)
    # A click on the object drafts a zone, as in the small image.
    page.mouse.click(
        large["x"] + large["width"] * 170 / 320, large["y"] + large["height"] * 130 / 180
    )
    expect(page.get_by_test_id("zone-name")).to_have_value("Red floor")
    page.get_by_test_id("zone-cancel").click()
    page.mouse.click(*middle_of(page.get_by_test_id("swap")))
    back = page.get_by_test_id("camera").bounding_box()
    assert back is not None and back["width"] == small["width"]


def test_driving_by_hand_shows_the_camera_image_large(page: Page) -> None:
    await_map(page)
    page.get_by_test_id("teleop-open").click()
    expect(page.locator("body")).to_have_class(re.compile("camera-large"))
    page.get_by_test_id("teleop-open").click()
    expect(page.locator("body")).not_to_have_class(re.compile("camera-large"))


def test_after_a_typed_zone_the_keyboard_goes_on_at_the_map(page: Page) -> None:
    await_map(page)
    page.keyboard.press("z")
    page.get_by_test_id("zone-corners").fill("1, 1\n2, 1\n2, 2")
    page.get_by_test_id("zone-finish").press("Enter")
    expect(page.get_by_test_id("zone")).to_have_count(1)
    expect(page.get_by_test_id("map-canvas")).to_be_focused()
    page.keyboard.press("z")
    expect(page.get_by_test_id("draft")).to_be_visible()


def test_an_arrow_key_on_a_slider_a_handle_or_the_splitter_does_not_drive(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.keyboard.press("b")
    expect(page.get_by_test_id("teleop")).to_have_attribute("open", "")
    splitter, handle = page.get_by_test_id("splitter"), page.get_by_test_id("beware-handle").first
    page.get_by_test_id("tab-log").click()
    height = splitter.get_attribute("aria-valuenow")
    splitter.press("ArrowUp")
    assert splitter.get_attribute("aria-valuenow") != height
    handle.press("ArrowDown")
    page.get_by_test_id("path-settings").click()
    expect(page.get_by_test_id("path-price")).to_be_enabled()
    page.get_by_test_id("path-price").press("ArrowRight")
    expect(page.get_by_test_id("path-price-shown")).not_to_have_text("× 1")
    page.keyboard.press("Escape")
    page.wait_for_timeout(300)
    assert operations.hands == []
    page.get_by_test_id("map-canvas").press("ArrowUp")  # the control
    eventually(page, lambda: operations.hands != [])


def test_by_hand_no_goal_is_driven_to(page: Page, operations: FakeOperations) -> None:
    operations.goals.add(3.0, 1.0)
    status = page.get_by_test_id("goal").locator(".status")
    expect(status).to_have_text("next")
    operations.hand = Twist(v_mps=0.3, w_radps=0.0)
    expect(page.get_by_test_id("state-badge")).to_contain_text("BY HAND")
    expect(status).to_have_text("next")
    operations.hand = None
    page.get_by_test_id("start").click()  # the control
    expect(status).to_have_text("driving here")


def test_a_request_with_a_file_may_take_longer_and_one_that_takes_too_long_says_so(
    page: Page,
) -> None:
    page.route("**/api/v1/zones/import*", lambda route: None)
    page.evaluate("""() => {
      window.limits = [];
      const set = window.setTimeout;
      window.setTimeout = (act, ms, ...rest) => {
        if (ms >= 60_000) window.limits.push(ms);
        return set(act, ms === 600_000 ? 100 : ms, ...rest);
      };
    }""")
    page.get_by_test_id("zones-file").set_input_files(
        {"name": "a.json", "mimeType": "application/json", "buffer": b"{}"}
    )
    expect(page.get_by_test_id("toasts")).to_contain_text("has not answered within 600 s")
    assert page.evaluate("window.limits").count(600_000) == 1


@pytest.mark.parametrize(
    "jump",
    [
        # The steady clock of most browsers stands still while the device sleeps.
        "(() => { const now = performance.now.bind(performance);"
        " performance.now = () => now() - 500; })()",
        "(() => { const now = Date.now; Date.now = () => now() + 5000; })()",
    ],
    ids=["sleep", "clock set"],
)
def test_a_device_that_has_slept_ends_the_drive_and_drives_again_on_another_connection(
    page: Page, operations: FakeOperations, jump: str
) -> None:
    page.keyboard.press("b")
    page.keyboard.down("ArrowUp")
    eventually(page, lambda: operations.hand is not None, patience_s=5.0)
    with page.expect_websocket(lambda socket: socket.url.endswith("/control/live")) as reconnected:
        page.evaluate(jump)
    eventually(page, lambda: operations.hand is None, patience_s=5.0)
    expect(page.locator("[data-drive=ArrowUp]")).to_have_attribute("aria-pressed", "false")
    sent = list[str]()
    reconnected.value.on("framesent", lambda frame: sent.append(str(frame)))
    page.keyboard.down("ArrowUp")  # the repeat of a key that is held
    page.keyboard.up("ArrowUp")
    page.keyboard.down("ArrowUp")
    eventually(page, lambda: operations.hand is not None, patience_s=5.0)
    page.keyboard.up("ArrowUp")
    eventually(page, lambda: operations.hand is None)
    times_ms = [json.loads(text)["t_ms"] for text in sent if "t_ms" in text]
    assert times_ms and max(times_ms) <= page.evaluate("performance.now()")


def test_the_screen_stays_on_while_the_robot_is_driven_by_hand(page: Page) -> None:
    await_map(page)
    page.evaluate("""() => {
      window.locks = [];
      navigator.wakeLock.request = async (kind) => {
        window.locks.push(kind);
        return { release: async () => window.locks.push("released") };
      };
    }""")
    page.get_by_test_id("teleop-open").click()
    eventually(page, lambda: page.evaluate("window.locks.join()") == "screen")
    page.get_by_test_id("teleop-open").click()
    eventually(page, lambda: page.evaluate("window.locks.join()") == "screen,released")


@pytest.mark.parametrize(("low", "high"), [(-0.2, 1.0), (0.0, 0.5), (0.0, 86.9), (-3.0, 1234.5)])
def test_ticks_are_round_and_cover_the_values(page: Page, low: float, high: float) -> None:
    ticks = page.evaluate(TICKS, [low, high])
    step = ticks[1] - ticks[0]
    assert 2 <= len(ticks) <= 7 and ticks[0] <= low and ticks[-1] >= high
    assert f"{step:.0e}"[0] in "125"


def test_midnight_is_no_hour_24_and_a_time_of_another_day_has_its_date(page: Page) -> None:
    night, *today = page.evaluate(
        """async () => {
            const { formatMoment, formatShortMoment, formatTime } =
                await import("/page/core/text/format.js");
            const [night, now] = [new Date(2024, 0, 2, 0, 5) / 1000, Date.now() / 1000];
            return [
                [formatTime(night), formatMoment(night), formatShortMoment(night)],
                formatMoment(now),
                formatShortMoment(now),
            ];
        }"""
    )
    assert night == ["00:05:00", "Jan 2, 2024, 00:05:00", "Jan 2, 00:05"]
    assert [len(time) for time in today] == [8, 5]


def test_the_pointer_shows_the_values_of_all_plots_at_one_time(page: Page) -> None:
    page.get_by_test_id("tab-plots").click()
    speed, distance = (page.get_by_test_id(f"chart-{name}") for name in ("speed_mps", "distance_m"))
    expect(speed.locator("path")).to_have_count(1)
    box = speed.locator("svg").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 40)
    for chart in (speed, distance):
        expect(chart.locator("b")).to_have_text(re.compile(r"^[\d.]+ at \d\d:\d\d:\d\d$"))


def test_no_text_of_a_plot_covers_another(page: Page) -> None:
    page.get_by_test_id("tab-plots").click()
    expect(page.locator(".chart path")).to_have_count(5)
    assert page.evaluate(OVERLAPS) == []


def test_the_page_of_the_interface_copies_and_tries_calls(
    page: Page, server: ConsoleServer
) -> None:
    page.goto(f"{server.url}/docs")
    path = "/api/v1/state"
    entry = page.locator(
        "details", has=page.locator("summary > code", has_text=re.compile(f"^{path}$"))
    )
    entry.locator("summary").click()
    command = entry.locator(".command pre")
    expect(command).to_contain_text(f"{server.url}/api/v1/state")
    page.evaluate("navigator.clipboard.writeText = async (text) => { window.copied = text; }")
    entry.get_by_role("button", name="Copy").click()
    expect(entry.get_by_role("button", name="Copied")).to_be_visible()
    assert page.evaluate("window.copied") == command.text_content()
    entry.get_by_test_id("docs-try").click()
    expect(entry.locator(".answer")).to_contain_text('"stop_latched"')
    columns = page.evaluate(
        """() => [...new Set([...document.querySelectorAll("summary span")]
          .map((node) => Math.round(node.getBoundingClientRect().left)))]"""
    )
    assert len(columns) == 1
    expect(page.locator("summary span, details > p").filter(has_text="`")).to_have_count(0)


def test_the_console_can_be_installed_as_an_application(page: Page, server: ConsoleServer) -> None:
    address = page.locator("link[rel=manifest]").get_attribute("href")
    manifest = page.request.get(f"{server.url}{address}")
    assert manifest.headers["content-type"] == "application/manifest+json"
    icon = page.request.get(server.url + manifest.json()["icons"][0]["src"])
    assert icon.ok and icon.headers["content-type"] == "image/svg+xml"


def test_a_goal_is_set_started_stopped_and_released_by_keyboard_alone(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)

    def reach(name: str, key: str, most: int) -> None:
        for _ in range(most):
            page.keyboard.press(key)
            if page.evaluate("document.activeElement?.dataset.testid") == name:
                return
        raise AssertionError(f"{name} is not reached by {most} times {key}")

    # The address names the view, and the page is reloaded: Tab begins at the top all the same.
    page.reload()
    await_map(page)
    reach("goal-input", "Tab", 30)
    page.keyboard.type("2, 1")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("goal")).to_have_count(1)
    reach("start", "Shift+Tab", 15)
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("state-badge")).to_contain_text("DRIVING")
    page.keyboard.press("Space")
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
    reach("reset", "Shift+Tab", 5)
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("state-badge")).to_contain_text("PAUSED")
    assert not operations.state().stop_latched


def test_plus_and_minus_are_the_opposite_of_each_other_on_a_large_map_that_is_fitted(
    page: Page,
) -> None:
    await_map(page)
    fitted, least, near, far = page.evaluate(
        """async () => {
            const { fit, view, zoom } = await import("/page/map/view.js");
            fit({ left: 0, right: 1000, bottom: 0, top: 1000 });
            const scales = [view.scale];
            for (const factor of [1 / 1.3, 1.3, 1 / 1.3]) {
                zoom(factor);
                scales.push(view.scale);
            }
            return scales;
        }"""
    )
    assert least == far == fitted < near < 1.0
