"""Menus and dialogs of the page in a real Chromium: wholly on the screen, never over the stop."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import BrowserContext, Locator, Page, expect

from tests.web.conftest import PASSWORD, Accounts
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_TOPMOST, IS_WITHIN_VIEWPORT, eventually
from tests.web.page.eye import AXE, SMALL_TARGETS, SMALL_TEXT, serious_findings
from web.pages import FOLDER
from web.server import ConsoleServer

SIZES = {"laptop": (1280, 720), "tablet": (1024, 768), "phone": (390, 844)}
OPENED_BY = {
    "missions": "missions",
    "path-menu": "path-settings",
    "zone-sets": "zone-sets",
    "zone-files": "zone-files",
    "beware-versions": "beware-versions-button",
    "beware-files": "beware-files-button",
    "beware-ready-made": "beware-ready-made",
    "layers-map": "map-layers-menu",
    "help": "help-button",
    "admin": "admin-button",
    "account": "who-am-i",
    "languages": "language",
    "sites": "sites-button",
    "layers-3d": "layers",
}
"""Element id of every overlay of the page → test id of its button."""
Opener = Callable[[str], Page]


@pytest.fixture
def open_page(
    new_context: Callable[..., BrowserContext], locked: ConsoleServer, accounts: Accounts
) -> Opener:
    """Open the console at a size, logged in as an admin, who has every overlay."""

    def opened(size: str) -> Page:
        width, height = SIZES[size]
        is_phone = size == "phone"
        context = new_context(
            viewport={"width": width, "height": height}, is_mobile=is_phone, has_touch=is_phone
        )
        context.request.post(f"{locked.url}/login", form={"name": "admin", "password": PASSWORD})
        page = context.new_page()
        page.goto(f"{locked.url}/#map")
        expect(page.get_by_test_id("connection")).to_have_text("live")
        expect(page.get_by_test_id("who-am-i")).to_be_visible()
        return page

    return opened


def press(button: Locator) -> None:
    """Click the middle of a button by mouse; fails where another element goes on covering it."""
    button.scroll_into_view_if_needed()
    eventually(button.page, lambda: button.evaluate(IS_WITHIN_VIEWPORT), patience_s=5.0)
    # A note of what was done before may lie over it for a moment, also between a look and a click:
    # the browser is asked at the click itself what it hits.
    button.click(timeout=30_000)  # a frame of the 3D view may take seconds on a busy processor


def show(button: Locator) -> None:
    """Select the view, and on a phone the tab, that contains the button."""
    page = button.page
    tab = button.evaluate("(button) => button.closest('[data-on]')?.dataset.on.split(' ')[0]")
    if tab and page.get_by_test_id(f"page-tab-{tab}").is_visible():
        press(page.get_by_test_id(f"page-tab-{tab}"))
    for view in ("3d", "map"):
        if button.evaluate("(button, view) => button.closest(`.only-${view}`) !== null", view):
            press(page.get_by_test_id(f"view-{view}"))


@pytest.mark.long
@pytest.mark.parametrize("size", SIZES)
def test_every_menu_and_dialog_opens_on_the_screen_as_a_whole_and_leaves_the_stop_free(
    size: str, open_page: Opener, operations: FakeOperations
) -> None:
    page = open_page(size)
    page.evaluate(AXE)
    on_page = page.evaluate(
        "[...document.querySelectorAll('[popover], dialog')].map((overlay) => overlay.id)"
    )
    # The menu of a place on the map has no button: see `test_map_touch.py`.
    assert set(on_page) == {*OPENED_BY, "map-menu"}
    for overlay_id, opener in OPENED_BY.items():
        button, overlay = page.get_by_test_id(opener), page.locator(f"#{overlay_id}")
        show(button)
        press(button)
        expect(overlay).to_be_visible()
        assert overlay.evaluate(IS_TOPMOST), f"{overlay_id} is covered"
        assert overlay.evaluate(IS_WITHIN_VIEWPORT), f"{overlay_id} sticks out of the window"
        small = page.evaluate(SMALL_TEXT) + (
            page.evaluate(SMALL_TARGETS) if size == "phone" else []
        )
        assert small == [], overlay_id
        if size == "laptop":
            assert serious_findings(page, f"#{overlay_id}") == [], overlay_id
        press(page.get_by_test_id("stop"))
        expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
        assert operations.stops.pop() == "admin (console button)", overlay_id
        operations.reset_stop()
        expect(page.get_by_test_id("reset")).to_be_disabled()
        if overlay.is_visible():
            page.keyboard.press("Escape")
        expect(overlay).to_be_hidden()


@pytest.mark.long
@pytest.mark.parametrize("size", SIZES)
def test_a_long_menu_is_scrolled_and_covers_no_stop(
    size: str, open_page: Opener, operations: FakeOperations
) -> None:
    for centimetres in range(30):
        operations.beware.edit("cup", {"margin_m": centimetres / 100})
    page = open_page(size)
    button, menu = page.get_by_test_id("beware-versions-button"), page.locator("#beware-versions")
    show(button)
    press(button)
    expect(page.get_by_test_id("beware-version-row").first).to_be_visible()
    assert menu.evaluate("(menu) => menu.scrollHeight > menu.clientHeight")
    press(page.get_by_test_id("stop"))
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")


@pytest.mark.long
@pytest.mark.parametrize(
    "overlay_id",
    # A list that was never edited has versions without a button.
    [
        name
        for name in OPENED_BY
        if name not in ("admin", "account", "sites", "layers-3d", "beware-versions")
    ],
)
def test_escape_and_a_click_elsewhere_close_a_menu_and_give_the_focus_back(
    overlay_id: str, open_page: Opener
) -> None:
    page = open_page("laptop")
    button, overlay = page.get_by_test_id(OPENED_BY[overlay_id]), page.locator(f"#{overlay_id}")
    page.get_by_test_id("mode-goal").click()
    press(button)
    expect(overlay).to_be_visible()
    field = overlay.locator("input, button").first
    field.focus()
    page.keyboard.press("Escape")
    expect(overlay).to_be_hidden()
    expect(button).to_be_focused()
    # Escape closed the menu and nothing else.
    expect(page.get_by_test_id("mode-goal")).to_have_attribute("aria-checked", "true")
    press(button)
    expect(overlay).to_be_visible()
    page.mouse.click(1200, 700)
    expect(overlay).to_be_hidden()
    expect(button).to_be_focused()


def test_a_class_of_the_page_is_styled_in_one_style_sheet() -> None:
    sheets: dict[str, set[str]] = {}
    for path in FOLDER.rglob("*.css"):
        if path.name in ("docs.css", "small_screens.css"):  # another page, other window sizes
            continue
        for selectors in re.findall(
            r"([^{}]+)\{", re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)
        ):
            for selector in re.findall(r"(?:^|,)\s*(\.[\w-]+)\s*(?=,|$)", selectors):
                sheets.setdefault(selector, set()).add(path.name)
    assert len(sheets) > 50
    assert {selector: names for selector, names in sheets.items() if len(names) > 1} == {}
