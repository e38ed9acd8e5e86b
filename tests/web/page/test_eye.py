"""What an eye and a hand need of the page: names, contrast, size of text and of targets, in every
main state, both themes and three sizes."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Literal

import httpx
import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_TOPMOST, await_map
from tests.web.page.eye import (
    AXE,
    LEAST_FONT_PX,
    SMALL_TARGETS,
    SMALL_TEXT,
    pale_texts,
    serious_findings,
)
from tests.web.page.states import SIZES, STATES, TABS, furnish
from web.pages import FOLDER
from web.port import reserve
from web.server import ConsoleServer
from web.starting import StartingPage

GROUND = """() => {
  const probe = document.body.appendChild(document.createElement("i"));
  probe.style.color = "canvas";
  const system = getComputedStyle(probe).color;
  probe.remove();
  return `${getComputedStyle(document.body).backgroundColor} on ${system}`;
}"""
"""JavaScript: the colour behind the page; that of the browser where the page has none."""


@pytest.mark.long
@pytest.mark.parametrize(
    ("size", "theme"), [("desktop", "light"), ("tablet", "dark"), ("phone", "dark")]
)
def test_every_main_state_can_be_read_named_and_hit(
    size: str,
    theme: Literal["dark", "light"],
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    operations: FakeOperations,
) -> None:
    furnish(operations)
    width, height = SIZES[size]
    is_touch = size != "desktop"
    context = new_context(
        viewport={"width": width, "height": height},
        color_scheme=theme,
        has_touch=is_touch,
        is_mobile=is_touch,
    )
    found: dict[str, object] = {}
    for name, reach in STATES.items():
        if size == "desktop" and name in TABS:
            continue
        page = context.new_page()
        page.goto(f"{server.url}/#map")
        await_map(page)
        expect(page.get_by_test_id("connection")).to_have_text("live")
        reach(page)
        page.wait_for_timeout(300)
        page.evaluate(AXE)
        serious = serious_findings(page)
        small = page.evaluate(SMALL_TEXT)
        targets = page.evaluate(SMALL_TARGETS) if is_touch else []
        wide = page.evaluate("document.documentElement.scrollWidth > innerWidth")
        assert page.get_by_test_id("stop").evaluate(IS_TOPMOST), name
        if size != "tablet":  # its colours are those of the other two
            page.emulate_media(color_scheme="light" if theme == "dark" else "dark")
            expect(page.locator("html")).not_to_have_attribute("data-theme", theme)
            serious += pale_texts(page)
        if serious or small or targets or wide:
            found[name] = [serious, small, targets, wide]
        page.close()
        operations.reset_stop()
    assert found == {}, "\n".join(f"{name}: {what}" for name, what in found.items())


@pytest.mark.long
@pytest.mark.parametrize("size", ["desktop", "phone"])
def test_every_other_page_can_be_read_named_and_hit(
    size: str,
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    locked: ConsoleServer,
) -> None:
    width, height = SIZES[size]
    is_touch = size == "phone"
    page = new_context(
        viewport={"width": width, "height": height}, has_touch=is_touch, is_mobile=is_touch
    ).new_page()
    urls = [server.url + path for path in ("/runs", "/docs", "/teach")] + [locked.url]
    with reserve("127.0.0.1", 0) as listener, StartingPage(listener) as starting:
        starting.say("Compiling", "Compiling … 50 / 200", 0.25)
        port = listener.getsockname()[1]
        start = httpx.get(f"http://127.0.0.1:{port}", trust_env=False).text
    found: dict[str, object] = {}
    for url in [*urls, ""]:
        if url:
            page.goto(url)
            page.wait_for_timeout(500)
        else:  # it would load itself again
            page.set_content(start)
        page.evaluate(AXE)
        grounds, serious = set(), []
        for theme in ("dark", "light"):
            page.emulate_media(color_scheme="light" if theme == "light" else "dark")
            serious += serious_findings(page)
            grounds.add(page.evaluate(GROUND))
        small = page.evaluate(SMALL_TEXT)
        targets = page.evaluate(SMALL_TARGETS) if is_touch else []
        wide = page.evaluate("document.documentElement.scrollWidth > innerWidth")
        if serious or small or targets or wide or len(grounds) < 2:
            found[page.title()] = [serious, small, targets, wide, grounds]
    assert found == {}, "\n".join(f"{name}: {what}" for name, what in found.items())


def test_no_style_sheet_has_text_below_the_least_size() -> None:
    sizes = {
        (sheet.name, int(size))
        for sheet in FOLDER.rglob("*.css")
        for size in re.findall(r"font-size:\s*(\d+)px", sheet.read_text(encoding="utf-8"))
    }
    assert len(sizes) > 20
    assert {one for one in sizes if one[1] < LEAST_FONT_PX} == set()


def test_the_check_finds_a_control_without_a_name_and_pale_text(page: Page) -> None:
    page.evaluate(
        """() => document.querySelector("main").insertAdjacentHTML("beforeend",
          "<button id=nameless></button><p id=pale>pale text</p>"
          + "<div id=over>"
          + "<button class=tiny>a</button><button class=tiny>b</button></div>")"""
    )
    page.evaluate(
        """() => { const { style } = document.getElementById("pale");
          style.color = "#333"; style.background = "#222"; style.fontSize = "9px";
          document.getElementById("over").style.cssText =
            "position: fixed; top: 300px; left: 300px; z-index: 99";
          for (const one of document.querySelectorAll(".tiny"))
            one.style.cssText = "all: unset; width: 9px; height: 9px; display: block"; }"""
    )
    page.evaluate(AXE)
    assert {"button-name", "color-contrast", "target-size"} <= {
        one[0] for one in serious_findings(page)
    }
    assert [one[0] for one in pale_texts(page)] == ["color-contrast"]
    assert any("pale" in text for text in page.evaluate(SMALL_TEXT))
