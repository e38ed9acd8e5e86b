"""A screen without contents says in one sentence why, and what comes next."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import BrowserContext, Locator, Page, expect

from tests.web.page.chromium import IS_TOPMOST
from web.port import reserve
from web.server import ConsoleServer
from web.starting import StartingPage

SENTENCES = {
    "missions": "Nothing is saved yet. Add goals, then save them here under a name.",
    "zone-sets": "Nothing is saved yet. Draw zones, then save them here as a set.",
    "sites-button": "One site so far. For another floor or building, type a name and press Make.",
    "tab-log": "No events yet. What the robot decides appears here with time and place.",
}
"""What opens a screen, and what it says."""


def assert_seen(sentence: Locator) -> None:
    expect(sentence).to_have_count(1)
    expect(sentence).to_be_in_viewport(ratio=1.0)
    assert sentence.evaluate(IS_TOPMOST)


@pytest.mark.parametrize("opener", SENTENCES)
def test_an_empty_list_says_the_next_step(opener: str, page: Page) -> None:
    page.get_by_test_id(opener).click()
    assert_seen(page.get_by_text(SENTENCES[opener], exact=True))


def test_plots_without_a_drive_say_how_one_comes_about(page: Page) -> None:
    page.route("**/api/v1/series?*", lambda route: route.fulfill(json={}))
    page.get_by_test_id("tab-plots").click()
    assert_seen(page.get_by_text("Nothing has been driven yet: add a goal and press Start."))


def test_the_page_of_runs_says_how_a_run_comes_about(page: Page, server: ConsoleServer) -> None:
    page.route("**/api/v1/runs", lambda route: route.fulfill(json=[]))
    page.goto(f"{server.url}/runs")
    said = (
        "No mission has finished yet. Add a goal in the console and press Start; the report "
        "appears here."
    )
    expect(page.get_by_test_id("runs-note")).to_have_text(said)
    assert_seen(page.get_by_test_id("runs-note"))


def test_the_3d_view_says_what_works_until_it_is_drawn(page: Page) -> None:
    blank = "<html><body><div id=root></div></body></html>"
    page.route("**/viewer/**", lambda route: route.fulfill(body=blank, content_type="text/html"))
    page.get_by_test_id("view-3d").click()
    sentence = page.locator("#gone")
    expect(sentence).to_have_text(
        "The 3D view is being made … Until then use the map; every control works."
    )
    expect(sentence).to_be_in_viewport(ratio=1.0)
    # It is connected long before the first frame is on the screen.
    page.evaluate("document.body.dataset.viewer = 'live'")
    expect(page.get_by_test_id("progress")).to_contain_text("the 3D view")
    expect(sentence).to_be_in_viewport(ratio=1.0)
    page.get_by_test_id("view-3d-frame").dispatch_event("drawn")
    expect(sentence).to_be_hidden()
    expect(page.get_by_test_id("progress")).to_be_hidden()
    page.get_by_test_id("view-map").click()
    expect(page.get_by_test_id("map-canvas")).to_be_visible()


@pytest.mark.long
def test_a_3d_view_that_cannot_be_had_says_so_and_is_tried_again(
    page: Page, new_context: Callable[..., BrowserContext], server: ConsoleServer
) -> None:
    page.route("**/viewer/**", lambda route: route.fulfill(status=200, body="{}"))
    page.get_by_test_id("view-3d").click()
    expect(page.locator("#gone")).to_have_text(
        "The 3D view cannot be loaded. Use the map; every control works."
    )
    expect(page.locator("#gone")).to_be_in_viewport(ratio=1.0)
    page.unroute("**/viewer/**")
    page.get_by_test_id("view-map").click()
    page.get_by_test_id("view-3d").click()
    expect(page.get_by_test_id("view-3d-frame")).to_be_visible()
    other = new_context().new_page()
    other.add_init_script(
        "HTMLCanvasElement.prototype.getContext = new Proxy("
        "HTMLCanvasElement.prototype.getContext, { apply: (get, canvas, [kind, ...more]) => "
        "kind === 'webgl2' ? null : get.call(canvas, kind, ...more) });"
    )
    other.goto(f"{server.url}/#3d")
    expect(other.locator("#gone")).to_have_text(
        "This browser draws no 3D view: it has no WebGL. Use the map; every control works."
    )
    expect(other.get_by_test_id("view-3d-frame")).to_have_count(0)


def test_a_page_that_was_on_the_map_follows_the_steps_of_a_new_start(
    new_context: Callable[..., BrowserContext],
) -> None:
    with reserve("127.0.0.1", 0) as listener, StartingPage(listener) as starting:
        page = new_context().new_page()
        # The console writes its view behind the address, which a browser keeps.
        page.goto(f"http://127.0.0.1:{listener.getsockname()[1]}/#map")
        starting.say("Warming up", "Warming up … 20 s")
        expect(page.get_by_text("Warming up … 20 s")).to_be_visible()
