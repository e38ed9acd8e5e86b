"""The console's page in a real Chromium, and what the tests of the page share."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from tests.web.page.chromium import ARGUMENTS, CHROMIUM, NEEDS_BROWSER, PATIENCE_MS
from web.server import ConsoleServer


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip the tests that need a browser where there is none."""
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(NEEDS_BROWSER)


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """One Chromium for the tests of the page. It ends with them: as long as Playwright runs, its
    event loop counts as running, and no other test could start one."""
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture
def new_context(browser: Browser) -> Iterator[Callable[..., BrowserContext]]:
    """Open a browser profile with the given options; all are closed after the test."""
    contexts: list[BrowserContext] = []
    expect.set_options(timeout=PATIENCE_MS)

    def opened(**options: object) -> BrowserContext:
        context = browser.new_context(**options)  # type: ignore[arg-type]
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        return context

    yield opened
    for context in contexts:
        context.close()


@pytest.fixture
def page(new_context: Callable[..., BrowserContext], server: ConsoleServer) -> Iterator[Page]:
    """The console's map on a small screen; the test fails when the page reports an error."""
    opened = new_context(viewport={"width": 1280, "height": 720}).new_page()
    errors: list[str] = []
    foreign: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.on(
        "console",
        lambda message: errors.append(message.text) if message.type == "error" else None,
    )
    opened.on(
        "request",
        lambda request: foreign.append(request.url) if not is_own(request.url, server) else None,
    )
    opened.goto(f"{server.url}/#map")
    expect(opened.get_by_test_id("connection")).to_have_text("live")
    yield opened
    opened.context.close()
    assert foreign == []
    # A refusal is an answer that the page shows; Chromium also writes its status to the console.
    assert [text for text in errors if "status of 4" not in text] == []


def is_own(url: str, server: ConsoleServer) -> bool:
    """Whether a request stays with the console."""
    return url.startswith((server.url, "data:", "blob:" + server.url))
