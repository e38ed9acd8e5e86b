"""One operator, one real Chromium, one running simulator: an edit of the beware list says on the
newest map what it would do, is cancelled, applied, and brought back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from playwright.sync_api import Locator, Page, expect, sync_playwright

from app.console.application import ConsoleOptions, RunningConsole, console
from tests.system.conftest import BY_COLOUR, marked_room
from tests.web.page.chromium import ARGUMENTS, CHROMIUM, NEEDS_BROWSER, await_map, click_map

PATIENCE_MS = 90_000

pytestmark = NEEDS_BROWSER


@pytest.fixture(scope="module")
def red(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """A console in a room with red floor between start and goal."""
    folder = tmp_path_factory.mktemp("red")
    world = folder / "red.toml"
    world.write_text(marked_room("red floor", (190, 20, 20), beware=True), encoding="utf-8")
    options = ConsoleOptions(scenario=str(world), port=0, data=folder / "data", choice=BY_COLOUR)
    with console(options) as started:
        yield started


@pytest.fixture
def page(red: RunningConsole) -> Iterator[Page]:
    """The console's map with one goal behind the red floor."""
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        opened = chromium.new_page(viewport={"width": 1280, "height": 800})
        opened.set_default_timeout(PATIENCE_MS)
        opened.goto(f"{red.url}/#map")
        expect(opened.get_by_test_id("connection")).to_have_text("live")
        await_map(opened)
        if not opened.get_by_test_id("goal").count():
            opened.get_by_test_id("mode-goal").click()
            click_map(opened, 2.5, 0.0)
            opened.keyboard.press("Escape")
        expect(opened.get_by_test_id("goal")).to_have_count(1)
        yield opened
        chromium.close()


def beware(console: RunningConsole) -> dict[str, Any]:
    """Return the list in force."""
    answer: dict[str, Any] = httpx.get(f"{console.url}/api/v1/beware", trust_env=False).json()
    return answer


def red_floor(page: Page) -> Locator:
    """Return the checkbox of the red floor."""
    return page.locator('[data-name="red floor"]').get_by_role("checkbox")


def test_a_class_is_switched_off_on_trial_and_stays_on(red: RunningConsole, page: Page) -> None:
    version, note = beware(red)["version"], page.get_by_test_id("proposal-note")
    red_floor(page).uncheck()
    expect(note).to_contain_text("“red floor” switched off")
    expect(note).to_contain_text("cells go, and the robot may drive there")
    expect(note).to_contain_text("the path would be")
    page.get_by_test_id("proposal-cancel").click()
    expect(note).to_have_count(0)
    expect(red_floor(page)).to_be_checked()
    assert beware(red)["version"] == version


def test_an_earlier_version_is_tried_before_it_is_in_force_again(
    red: RunningConsole, page: Page
) -> None:
    note, apply = page.get_by_test_id("proposal-note"), page.get_by_test_id("proposal-apply")
    red_floor(page).uncheck()
    expect(note).to_contain_text("cells go")
    apply.click()
    expect(note).to_have_count(0)
    expect(page.locator('[data-name="red floor"]')).to_have_class("off")
    version = beware(red)["version"]
    page.get_by_test_id("beware-versions-button").click()
    page.get_by_test_id("beware-restore").last.click()
    expect(note).to_contain_text("“red floor” switched on")
    expect(note).to_contain_text("cells appear")
    expect(note).to_contain_text("the path would be")
    assert beware(red)["version"] == version
    apply.click()
    expect(red_floor(page)).to_be_checked()
    assert beware(red)["version"] == version + 1
