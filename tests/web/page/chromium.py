"""Debian's Chromium, and what a test does on the page that it shows."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

_WHOLE, _SHELL = Path("/usr/bin/chromium"), Path("/usr/bin/chromium-headless-shell")
CHROMIUM = _SHELL if _SHELL.exists() else _WHOLE
"""Without the window around it, Chromium needs half the processor time to show the page."""
ARGUMENTS = [
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--disable-gpu",
]
NEEDS_BROWSER = pytest.mark.skipif(
    not CHROMIUM.exists() and os.environ.get("CI") != "true",
    reason="Debian's chromium is not installed",
)
"""Mark of a test that needs Chromium; continuous integration never skips it."""
PATIENCE_MS = 20_000
IS_TOPMOST = """(element) => {
  const { left, right, top, bottom } = element.getBoundingClientRect();
  const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  return element.contains(hit);
}"""
"""JavaScript: whether no other element covers the middle of an element."""
IS_WITHIN_VIEWPORT = """(element) => {
  const { left, right, top, bottom } = element.getBoundingClientRect();
  const isShown = right > left && bottom > top;
  return isShown && left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
}"""
"""JavaScript: whether an element is on the screen as a whole."""


def await_map(page: Page) -> None:
    """Wait until the map is drawn."""
    expect(page.get_by_test_id("map-canvas")).to_have_attribute(
        "data-place", re.compile(r"^(?!40 0 0$)")
    )


def map_view(page: Page) -> tuple[float, float, float]:
    """Return the scale of the map in pixels per metre, and x and y of its middle in metres."""
    canvas = page.get_by_test_id("map-canvas")
    expect(canvas).to_have_attribute("data-place", re.compile(r"\S+ \S+ \S+"))
    scale, x, y = (float(part) for part in (canvas.get_attribute("data-place") or "").split())
    return scale, x, y


def on_canvas(page: Page, x: float, y: float) -> tuple[float, float]:
    """Return the pixel of the map's canvas at a point in metres."""
    scale, middle_x, middle_y = map_view(page)
    box = page.get_by_test_id("map-canvas").bounding_box()
    assert box is not None
    return box["width"] / 2 + (x - middle_x) * scale, box["height"] / 2 - (y - middle_y) * scale


def on_page(page: Page, x: float, y: float) -> tuple[float, float]:
    """Return the pixel of the page at a point of the map in metres."""
    right, down = on_canvas(page, x, y)
    box = page.get_by_test_id("map-canvas").bounding_box()
    assert box is not None
    return box["x"] + right, box["y"] + down


def click_map(page: Page, x: float, y: float) -> None:
    """Click the map at a point in metres."""
    right, down = on_canvas(page, x, y)
    page.get_by_test_id("map-canvas").click(position={"x": right, "y": down})


def tap_map(page: Page, x: float, y: float) -> None:
    """Tap the map at a point in metres."""
    right, down = on_canvas(page, x, y)
    page.get_by_test_id("map-canvas").tap(position={"x": right, "y": down})


def middle_of(locator: Locator) -> tuple[float, float]:
    """Return the pixel of the page in the middle of an element."""
    box = locator.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def eventually(page: Page, holds: Callable[[], bool], patience_s: float = 30.0) -> None:
    """Wait until a condition holds; on a busy processor a frame of the 3D view takes seconds."""
    for _ in range(int(10 * patience_s)):
        if holds():
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"the condition did not hold within {patience_s} s")
