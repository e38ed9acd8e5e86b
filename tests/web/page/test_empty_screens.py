"""A screen without contents says in one sentence why, and what comes next."""

from __future__ import annotations

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.web.page.chromium import IS_TOPMOST
from web.server import ConsoleServer

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


def test_the_3d_view_says_what_works_while_it_is_being_made(page: Page) -> None:
    page.route("**/viewer/**", lambda route: None)  # never answered
    page.get_by_test_id("view-3d").click()
    sentence = page.locator("#gone")
    expect(sentence).to_have_text(
        "The 3D view is being made … Until then use the map; every control works."
    )
    expect(sentence).to_be_in_viewport(ratio=1.0)
    page.get_by_test_id("view-map").click()
    expect(page.get_by_test_id("map-canvas")).to_be_visible()
    expect(sentence).to_be_hidden()
