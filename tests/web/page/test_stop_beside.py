"""The stop on the pages beside the console."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import BrowserContext, Page, Route, expect

from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_TOPMOST, IS_WITHIN_VIEWPORT, eventually
from web.server import ConsoleServer

TO_THE_END = """() => {
  for (const node of [document.scrollingElement, document.body, document.querySelector("main")])
    if (node) node.scrollTop = node.scrollHeight;
}"""
"""JavaScript: scroll whatever a page scrolls to its end."""
TELL_OF_TAKEOVER = """
  WebSocket.prototype.send = () => {};
  Object.defineProperty(window, "takeOverStop", {
    set: (takeOver) => { window.early = takeOver; },
    get: () => () => { window.isTakenOver = true; return window.early(); },
  });
"""
"""JavaScript: send nothing by websocket, and set `isTakenOver` when the modules stop the robot."""
THEME = "document.documentElement.dataset.theme"


@pytest.mark.parametrize("path", ["/runs", "/docs", "/teach"])
def test_every_page_stops_the_robot_by_button_and_space_bar(
    path: str, page: Page, server: ConsoleServer, operations: FakeOperations
) -> None:
    page.goto(server.url + path)
    button = page.get_by_test_id("stop")
    page.wait_for_load_state("networkidle")
    for width, height in ((1440, 900), (1024, 700), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        # All the way down, wherever that leads; the page is laid out again at its own time.
        page.evaluate(TO_THE_END)
        eventually(page, lambda: button.evaluate(IS_WITHIN_VIEWPORT))
        eventually(page, lambda: button.evaluate(IS_TOPMOST))
    button.click()
    eventually(page, lambda: len(operations.stops) == 1)
    expect(page.locator("#toasts")).to_contain_text("The robot is stopped.")
    theme = page.evaluate(THEME)
    page.get_by_test_id("theme").focus()
    page.keyboard.press("Space")
    eventually(page, lambda: len(operations.stops) == 2)
    assert page.evaluate(THEME) == theme, "the focused button is not pressed"


@pytest.mark.parametrize("path", ["/", "/runs", "/docs", "/teach"])
def test_the_stop_works_where_a_module_cannot_be_loaded_and_the_page_says_so(
    path: str,
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    operations: FakeOperations,
) -> None:
    page = new_context().new_page()
    page.route("**/core/dom.js", lambda route: route.abort())
    page.goto(server.url + path)
    expect(page.locator("[data-early=failed]")).to_be_visible()
    page.get_by_test_id("stop").click()
    expect(page.locator("[data-early=stopped]")).to_be_visible()
    page.keyboard.press("Space")
    # It is sent in two ways at once: both may arrive.
    eventually(
        page, lambda: list(dict.fromkeys(operations.stops)) == ["console button", "console key"]
    )


@pytest.mark.parametrize("path", ["/", "/runs"])
def test_the_stop_does_not_wait_for_the_modules_of_the_page(
    path: str,
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    operations: FakeOperations,
) -> None:
    page = new_context().new_page()
    # Neither has an answer, as where the modules take up all connections.
    for held in ("**/page/core/dom.js", "**/api/v1/stop?**"):
        page.route(held, lambda route: None)
    page.goto(server.url + path, wait_until="commit")
    page.get_by_test_id("stop").click()
    expect(page.locator("[data-early=stopped]")).to_be_visible()
    assert operations.stops == ["console button"]
    page.keyboard.press("Space")
    eventually(page, lambda: operations.stops == ["console button", "console key"])


@pytest.fixture
def loading(new_context: Callable[..., BrowserContext]) -> tuple[Page, Callable[[], None]]:
    """A page that has not loaded all of its modules, and the function that lets it load them. Its
    websockets send nothing."""
    page = new_context().new_page()
    page.add_init_script(TELL_OF_TAKEOVER)
    waiting = list[Route]()
    page.route("**/page/core/dom.js", lambda route: waiting.append(route))

    def load() -> None:
        eventually(page, lambda: len(waiting) > 0)
        waiting[0].continue_()
        eventually(page, lambda: page.evaluate("Boolean(window.isTakenOver)"))

    return page, load


@pytest.mark.parametrize("path", ["/", "/runs"])
def test_a_stop_that_the_loading_page_has_not_delivered_is_taken_over_by_the_loaded_one(
    path: str,
    loading: tuple[Page, Callable[[], None]],
    server: ConsoleServer,
    operations: FakeOperations,
) -> None:
    page, load = loading
    page.route("**/api/v1/stop?**", lambda route: route.abort())
    page.goto(server.url + path, wait_until="commit")
    page.get_by_test_id("stop").click()
    lost = page.locator("[data-early=lost]")
    expect(lost).to_be_visible()
    load()
    expect(lost).to_be_visible()
    page.unroute("**/api/v1/stop?**")
    eventually(page, lambda: operations.stops[:1] == ["console button"])
    expect(lost).to_have_count(0)
    if path == "/runs":  # the console shows its state
        expect(page.locator("#toasts")).to_contain_text("The robot is stopped.")


def test_a_stop_that_was_refused_is_told_until_one_is_answered(
    loading: tuple[Page, Callable[[], None]], server: ConsoleServer
) -> None:
    page, load = loading
    page.route("**/api/v1/stop?**", lambda route: route.fulfill(status=401))
    page.goto(f"{server.url}/runs", wait_until="commit")
    page.get_by_test_id("stop").click()
    refused = page.locator("[data-early=refused]")
    expect(refused).to_be_visible()
    load()
    expect(refused).to_be_visible()
    page.unroute("**/api/v1/stop?**")
    page.get_by_test_id("stop").click()
    expect(refused).to_have_count(0)


def test_a_loaded_page_says_that_the_robot_was_stopped_while_it_loaded(
    loading: tuple[Page, Callable[[], None]], server: ConsoleServer
) -> None:
    page, load = loading
    page.goto(f"{server.url}/runs", wait_until="commit")
    page.get_by_test_id("stop").click()
    expect(page.locator("[data-early=stopped]")).to_be_visible()
    load()
    expect(page.locator("#toasts")).to_contain_text("The robot is stopped.")
    expect(page.locator("[data-early=stopped]")).to_be_hidden()
