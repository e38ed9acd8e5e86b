"""Screenshots of the main states of the page, in three sizes and both themes."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, expect, sync_playwright

from tests.screenshots.compare import SCALE
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import ARGUMENTS, CHROMIUM, PATIENCE_MS, await_map
from tests.web.page.states import SIZES, STATES, furnish
from web.server import ConsoleServer

THEMES = ("dark", "light")
SETTLED_MS = 400
"""Time after which a state has been drawn."""
QUALITY = 70
"""Quality of a stored WebP image, 0 to 100."""


def take(folder: Path) -> list[Path]:
    """Write a screenshot of each state, size and theme; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    operations = FakeOperations()
    furnish(operations)
    server = ConsoleServer(operations, port=0)
    server.start()
    expect.set_options(timeout=PATIENCE_MS)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            files = [
                file
                for size in SIZES
                for state in STATES
                for file in _take_state(browser, server, operations, size, state, folder)
            ]
            browser.close()
    finally:
        server.stop()
    return files


def _take_state(
    browser: Browser,
    server: ConsoleServer,
    operations: FakeOperations,
    size: str,
    state: str,
    folder: Path,
) -> list[Path]:
    width, height = SIZES[size]
    is_touch = size != "desktop"
    context = browser.new_context(
        viewport={"width": width, "height": height}, has_touch=is_touch, is_mobile=is_touch
    )
    page = context.new_page()
    page.goto(f"{server.url}/#map")
    await_map(page)
    expect(page.get_by_test_id("connection")).to_have_text("live")
    STATES[state](page)
    files = []
    for theme in THEMES:
        page.emulate_media(color_scheme="dark" if theme == "dark" else "light")
        page.wait_for_timeout(SETTLED_MS)
        shot = Image.open(io.BytesIO(page.screenshot(animations="disabled", caret="hide")))
        small = shot.convert("RGB").resize((width // SCALE, height // SCALE), Image.Resampling.BOX)
        file = folder / f"{size}-{theme}-{state}.webp"
        small.save(file, quality=QUALITY, method=6)
        files.append(file)
    context.close()
    operations.reset_stop()
    return files
