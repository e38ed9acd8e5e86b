"""The drawer of the page in a real Chromium: log, explanation, detections, plots, ages; runs."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import BrowserContext, Page, Route, expect

from app.insight.event_log import EventLog
from app.runtime.record.time_series import COLUMNS, TimeSeries
from app.storage import Store
from navcore.errors import StorageFailed
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_TOPMOST, await_map, eventually, map_view
from web.interface.drafts import ZoneDraft
from web.interface.insight import LabellingState
from web.server import ConsoleServer

LETTERS = str.maketrans("0123456789", "abcdefghij")
HERE = (-3.0, 1.0)
WET = ZoneDraft(name="Wet floor", polygon=((3.0, -2.0), (3.6, -2.0), (3.6, 0.6), (3.0, 0.6)))


def test_the_log_is_filtered_and_a_click_goes_to_the_place(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    operations.insight.event_log.note(1.0, "stopped", "A person is close.", (-3.0, 1.0))
    operations.insight.event_log.note(2.0, "seen", "First sight of “cup” here.", (2.5, 1.5))
    # A first sight is a detail, which the badge does not count.
    expect(page.get_by_test_id("tab-log")).to_have_text("Log · 1 new")
    page.get_by_test_id("tab-log").click()
    expect(page.get_by_test_id("log-entry")).to_have_count(2)
    page.get_by_test_id("filter-seen").click()
    expect(page.get_by_test_id("log-entry")).to_have_count(1)
    page.get_by_test_id("jump").click()
    expect(page.get_by_test_id("map-canvas")).to_have_attribute(
        "data-place", re.compile(r" 2\.5 1\.5$")
    )
    assert map_view(page)[0] >= 60
    page.get_by_test_id("filter-seen").click()
    expect(page.get_by_test_id("log-entry").first).to_contain_text("cup")
    expect(page.get_by_test_id("log-entry")).to_have_count(2)


def test_repeats_are_one_row_with_a_count_and_the_log_is_searched(
    page: Page, operations: FakeOperations
) -> None:
    log = operations.insight.event_log
    for tenth in range(14):
        log.note(
            tenth / 10,
            "stopped",
            f"The navigation is late: its newest decision is 0.{20 + tenth} s old.",
        )
        log.note(tenth / 10, "released", f"After 0.{tenth} s the robot drives on.")
    log.note(2.0, "goal", "Nurse station is reached.", (-3.0, 1.0))
    # Late decisions are in the status line; the badge counts what is nowhere else.
    expect(page.get_by_test_id("tab-log")).to_have_text("Log · 1 new")
    page.get_by_test_id("tab-log").click()
    rows = page.get_by_test_id("log-entry")
    expect(rows).to_have_count(3)
    late = rows.filter(has_text="newest decision")
    expect(late).to_contain_text("0.33 s old")
    expect(late.get_by_test_id("log-count")).to_contain_text("× 14 in")
    page.get_by_test_id("log-search").fill("nurse")
    expect(rows.filter(visible=True)).to_have_count(1)
    page.get_by_test_id("log-search").fill("no such words")
    expect(page.get_by_test_id("pane-log")).to_contain_text("No event matches.")
    page.get_by_test_id("log-search").fill("")
    page.get_by_test_id("log-level").select_option("notice")
    expect(rows.filter(visible=True)).to_have_count(1)
    # Two zones are no repeat, though their names differ in a figure only.
    for number in (1, 2, 2):
        log.note(3.0, "zone", f"Zone “Zone {number}” was changed.")
    expect(rows.filter(has_text="Zone 1")).not_to_contain_text("×")
    expect(rows.filter(has_text="Zone 2")).to_contain_text("× 2 in")


def test_of_more_new_entries_than_one_page_none_is_missing_in_the_log(
    page: Page, operations: FakeOperations
) -> None:
    log = operations.insight.event_log
    log.note(0.0, "seen", "first")
    page.get_by_test_id("tab-log").click()
    entries = page.get_by_test_id("log-entry")
    expect(entries).to_have_count(1)
    for number in range(320):
        log.note(float(number), "seen", "between" if number < 20 else "repeated")
    expect(entries.first).to_contain_text("× 300")
    page.get_by_test_id("log-older").click()
    expect(entries).to_have_count(3)
    expect(entries.nth(1)).to_contain_text("between")
    expect(entries.last).to_contain_text("first")


def test_the_log_goes_back_to_earlier_starts_and_marks_where_they_end(
    page: Page,
    operations: FakeOperations,
    tmp_path: Path,
) -> None:
    store = Store(tmp_path)
    past = EventLog(store.events)
    for number in range(320):
        # Letters: rows that differ in figures only are folded.
        past.note(float(number), "seen", "earlier " + str(number).translate(LETTERS))
    past.write()
    operations.insight.event_log = EventLog(store.events)
    operations.insight.event_log.note(0.0, "stopped", "A person is close.", HERE)
    page.reload()
    expect(page.get_by_test_id("tab-log")).to_have_text("Log · 1 new")
    page.get_by_test_id("tab-log").click()
    entries = page.get_by_test_id("log-entry")
    expect(entries).to_have_count(300)
    expect(entries.nth(0)).not_to_have_class("earlier")
    expect(entries.nth(1)).to_have_class("earlier")
    expect(entries.nth(1)).to_have_attribute(
        "data-before", re.compile("before the console was restarted")
    )
    expect(page.locator("[data-before]")).to_have_count(1)
    page.get_by_test_id("log-older").click()
    expect(entries).to_have_count(321)
    expect(entries.last).to_contain_text("earlier a")
    expect(page.get_by_test_id("log-older")).to_be_hidden()
    store.close()


def test_the_log_marks_each_day_and_a_repeated_entry_has_its_newest_time(
    page: Page, operations: FakeOperations
) -> None:
    past_s = time.time() - 2 * 86400.0
    times_s = iter((past_s - 86400.0, past_s, past_s + 5.0))
    log = EventLog(wall_clock=times_s.__next__)
    log.note(1.0, "stopped", "A person is close.", HERE)
    for stamp_s in (2.0, 3.0):
        log.note(stamp_s, "goal", "Nurse station is reached.", HERE)
    operations.insight.event_log = log
    page.get_by_test_id("tab-log").click()
    rows = page.get_by_test_id("log-entry")
    expect(rows).to_have_count(2)
    days = [row.get_attribute("data-before") or "" for row in rows.all()]
    assert all(days) and days[0] != days[1]
    repeated = rows.first.locator("time")
    shown = repeated.text_content()
    assert shown and shown in (repeated.get_attribute("title") or "")
    page.get_by_test_id("log-level").select_option("alert")
    expect(rows.filter(visible=True)).to_have_attribute("data-before", days[1])


def test_the_log_marks_the_day_at_midnight(page: Page, operations: FakeOperations) -> None:
    log = operations.insight.event_log = EventLog()
    log.note(1.0, "stopped", "A person is close.", HERE)
    page.get_by_test_id("tab-log").click()
    row = page.get_by_test_id("log-entry")
    expect(row).to_be_visible()
    assert row.get_attribute("data-before") is None
    page.evaluate(
        """() => {
            const Present = Date;
            window.Date = class extends Present {
                constructor(...given) {
                    super(...(given.length ? given : [Present.now() + 86_400_000]));
                }
            };
        }"""
    )
    expect(row).to_have_attribute("data-before", re.compile(r"\d"))


@pytest.mark.long
def test_the_explanation_names_the_rule_its_cost_and_what_to_remove(
    page: Page, operations: FakeOperations
) -> None:
    page.get_by_test_id("tab-why").click()
    expect(page.get_by_test_id("why-words")).to_contain_text("There is no goal")
    zone = operations.zones.add(WET)
    operations.goals.add(4.4, -0.5)
    rule = page.locator(f'[data-testid="why-rule"][data-key="zone:{zone.id}"]')
    expect(rule).to_contain_text(re.compile(r"Wet floor.*costs \d"))
    expect(page.get_by_test_id("why-words")).to_have_text(
        re.compile(r"The path is [\d.]+ m long; “Wet floor” makes it [\d.]+ m longer\.")
    )
    page.get_by_test_id("why-main").get_by_role("button").click()
    expect(page.get_by_test_id("why-words")).to_contain_text("Without “Wet floor” it would be")
    assert operations.zones.stored[0].enabled  # it is only tried
    page.get_by_test_id("why-off").click()
    expect(rule).to_have_count(0)
    assert not operations.zones.stored[0].enabled
    page.get_by_test_id("toast-action").filter(has_text="Undo").click()
    expect(rule).to_have_count(1)
    operations.zones.add(
        ZoneDraft(name="Fence", polygon=((2.4, -5.7), (2.6, -5.7), (2.6, 5.7), (2.4, 5.7)))
    )
    expect(page.get_by_test_id("why-lift")).to_contain_text("Fence")
    assert operations.zones.stored[0].enabled


def test_a_late_explanation_marks_nothing_once_its_tab_is_closed(
    page: Page, operations: FakeOperations
) -> None:
    marks: list[str] = []

    def note(text: str | bytes) -> None:
        if '"mark"' in str(text):
            marks.append(str(text))

    page.on("websocket", lambda link: link.on("framesent", note))
    page.reload()
    operations.goals.add(4.4, -0.5)
    page.get_by_test_id("tab-why").click()
    eventually(page, lambda: bool(marks) and "points" in marks[-1])
    held: list[Route] = []
    page.route("**/api/v1/explain", lambda route: held.append(route))
    eventually(page, lambda: bool(held))
    page.get_by_test_id("tab-why").click()
    with page.expect_response("**/api/v1/explain"):
        held[0].continue_()
    page.wait_for_timeout(100)
    assert "points" not in marks[-1]


def test_candidates_are_asked_for_only_while_their_layer_is_on(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))

    def after_a_tick() -> bool:
        asked.clear()
        with page.expect_response(re.compile("/api/v1/path$")):
            operations.step()
        page.wait_for_timeout(500)
        return any("/candidates" in url for url in asked)

    assert not after_a_tick()
    page.get_by_test_id("map-layers-menu").click()
    with page.expect_response(re.compile("/api/v1/candidates$")):
        page.get_by_test_id("map-layers").get_by_test_id("layer-candidates").check()
    assert after_a_tick()
    page.get_by_test_id("map-layers").get_by_test_id("layer-candidates").uncheck()
    page.wait_for_timeout(500)
    assert not after_a_tick()


def test_a_wrong_detection_and_a_missed_object_are_labelled(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.get_by_test_id("tab-seen").click()
    expect(page.get_by_test_id("seen-counts")).to_contain_text("1 × cup")
    # The whole card is in the drawer as it opens, down to its last answer.
    card = page.get_by_test_id("detection")
    expect(card.get_by_test_id("correction")).to_be_in_viewport(ratio=1.0)
    assert all(part.evaluate(IS_TOPMOST) for part in card.locator("button, select").all())
    page.get_by_test_id("correction").select_option("book")
    expect(page.get_by_test_id("labelling")).to_contain_text("1 of at most 500")
    page.get_by_test_id("missed-open").click()
    frozen = page.get_by_test_id("missed-image")
    expect(frozen).to_have_js_property("complete", True)
    box = frozen.bounding_box()
    assert box is not None
    page.get_by_test_id("missed-class").select_option("cup")
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.4 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.65 * box["width"], box["y"] + 0.8 * box["height"], steps=3)
    page.mouse.up()
    page.get_by_test_id("missed-add").click()
    expect(page.get_by_test_id("labelling")).to_contain_text("2 of at most 500")
    (said, none), (missed, drawn) = operations.insight.taught
    assert (said, none, missed) == ("book", None, "cup") and drawn is not None
    assert all(abs(a - b) <= 4 for a, b in zip(drawn, (128, 72, 208, 144), strict=True))


def test_a_card_follows_its_number_to_another_object(page: Page, client: httpx.Client) -> None:
    page.get_by_test_id("tab-seen").click()
    card = page.get_by_test_id("detection")
    expect(card).to_have_attribute("data-class", "cup")
    answer = client.get("/api/v1/sightings").json()
    answer["sightings"][0] |= {"class_name": "shoe", "place": [1.0, 2.0]}
    page.route("**/api/v1/sightings", lambda route: route.fulfill(json=answer))
    expect(card).to_have_attribute("data-class", "shoe")
    expect(card.get_by_test_id("detection-jump")).to_contain_text("1.0, 2.0")


def test_a_card_has_the_label_of_its_class_and_offers_no_correction_without_its_image(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.get_by_test_id("tab-seen").click()
    expect(page.get_by_test_id("correction")).to_have_count(1)
    operations.beware.edit("cup", {"label": "Tasse"}, by="Ana")
    operations.insight.detections.drop_image()
    card = page.get_by_test_id("detection")
    expect(card.locator(".name")).to_contain_text("Tasse")
    expect(page.get_by_test_id("seen-counts")).to_contain_text("1 × Tasse")
    expect(card.get_by_test_id("reject")).to_have_count(1)
    expect(page.get_by_test_id("correction")).to_have_count(0)

    # A folder that cannot be read hides no detections.
    def damaged() -> LabellingState:
        raise StorageFailed("the card cannot be read")

    operations.insight.labelling.state = damaged  # type: ignore[method-assign]
    expect(page.get_by_test_id("labelling")).to_have_text("the card cannot be read")
    expect(card).to_have_count(1)


def test_curves_ages_and_the_page_of_runs_are_shown(
    page: Page, server: ConsoleServer, operations: FakeOperations
) -> None:
    await_map(page)
    expect(page.get_by_test_id("age-image")).to_have_text(re.compile(r"^image < 1 s$"))
    # Its wall clock is not that of this browser.
    operations.insight.event_log.note(2.0, "goal", "Nurse station is reached.")
    page.get_by_test_id("tab-plots").click()
    expect(page.get_by_test_id("chart-speed_mps").locator(".mark")).to_have_count(1)
    for name in ("speed_mps", "distance_m", "explored_m2", "explored_m3", "tick_ms"):
        expect(page.get_by_test_id(f"chart-{name}").locator(".curve")).to_have_count(1)
    page.goto(f"{server.url}/runs")
    expect(page.get_by_test_id("run")).to_have_count(2)
    expect(page.get_by_test_id("report")).to_contain_text("fake hall")
    newest = page.get_by_test_id("run").filter(has_text="run-1")
    expect(newest).to_contain_text(re.compile("Nov 1[45], 2023"))
    expect(newest).to_contain_text("ward")
    expect(newest).to_contain_text("cancelled")
    cut_off = page.get_by_test_id("run").filter(has_text="run-0")
    expect(cut_off).to_contain_text("5000 of 5003, interrupted or going on")


def test_plots_begin_again_with_the_console_also_while_they_are_closed(
    new_context: Callable[..., BrowserContext],
    operations: FakeOperations,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    console = ConsoleServer(operations, port=0)
    console.start()
    page = new_context().new_page()
    page.goto(f"{console.url}/#map")
    with page.expect_response("**/series?since_s=-1"):
        page.get_by_test_id("tab-plots").click()
    expect(page.get_by_test_id("chart-speed_mps").locator(".curve")).to_have_count(1)
    page.get_by_test_id("tab-log").click()
    console.stop()
    expect(page.get_by_test_id("connection")).to_have_text("no connection")
    # The new console has driven for longer than the old one.
    state = operations.state
    monkeypatch.setattr(operations, "state", lambda: replace(state(), stamp_s=1000.0))
    operations.insight.series = TimeSeries()
    operations.insight.series.add(1000.0, dict.fromkeys(COLUMNS, 1.0))
    again = ConsoleServer(operations, port=int(console.url.rsplit(":", 1)[1]))
    again.start()
    try:
        expect(page.get_by_test_id("connection")).to_have_text("live")
        with page.expect_response("**/series?**") as answer:
            page.get_by_test_id("tab-plots").click()
        assert answer.value.url.endswith("since_s=-1")
    finally:
        again.stop()


CONTRAST = """([part, property, ground]) => {
  const colour = (element, name) => {
    const numbers = getComputedStyle(element)[name].match(/[0-9.]+/g);
    return numbers.slice(0, 3).map((value) => value / 255);
  };
  const linear = (value) => (value <= 0.04 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
  const light = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  const pair = [[part, property], [ground, "backgroundColor"]];
  const lights = pair.map(([one, name]) => light(colour(document.querySelector(one), name)));
  const [low, high] = lights.sort((a, b) => a - b);
  return (high + 0.05) / (low + 0.05);
}"""
"""JavaScript: contrast of a colour with the background of another element (WCAG), 1 to 21."""


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_the_page_of_runs_has_its_theme_and_its_curves_are_visible(
    theme: str,
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
) -> None:
    page = new_context(color_scheme=theme).new_page()
    page.goto(f"{server.url}/runs")
    expect(page.get_by_test_id("chart-speed_mps").locator(".curve")).to_have_count(1)
    assert page.evaluate("document.documentElement.dataset.theme") == theme
    assert page.locator(".curve").evaluate("(curve) => getComputedStyle(curve).stroke") != "none"
    assert page.evaluate(CONTRAST, [".curve", "stroke", ".chart"]) >= 3
    assert page.evaluate(CONTRAST, [".chart text", "fill", ".chart"]) >= 4.5
    for text, ground in (("h1", "body"), ("td", ".card"), ("figcaption", ".chart")):
        assert page.evaluate(CONTRAST, [text, "color", ground]) >= 4.5, text
    page.get_by_test_id("theme").click()
    assert page.evaluate("document.documentElement.dataset.theme") != theme
