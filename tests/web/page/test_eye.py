"""What an eye and a hand need of the page: names, contrast, size of text and of targets, in every
main state, both themes and three sizes."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_TOPMOST, await_map
from tests.web.page.states import SIZES, STATES, TABS, furnish
from web.pages import FOLDER
from web.server import ConsoleServer

AXE = (Path(__file__).parent / "axe" / "axe.min.js").read_text(encoding="utf-8")
SERIOUS = ("serious", "critical")
LEAST_FONT_PX = 12
LEAST_TARGET_PX = 44
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
"""Tags of the rules."""
FINDINGS = """async (runOnly) => {
  const { violations } = await axe.run(document, { iframes: false, runOnly,
    rules: { "target-size": { enabled: true } }, resultTypes: ["violations"] });
  // The rule of the size of targets takes a menu in the top layer for covered by what is below it.
  for (const one of violations) if (one.id === "target-size")
    one.nodes = one.nodes.filter(({ target, any }) => !(/obscured/.test(any[0]?.message)
      && document.querySelector(target[0])?.closest(":popover-open")));
  return violations.filter(({ nodes }) => nodes.length).map(({ id, impact, nodes }) => [id, impact,
    nodes.slice(0, 3).map(({ html, any }) => `${html.slice(0, 120)} ${any[0]?.message ?? ""}`)]);
}"""
SMALL_TEXT = f"""() => [...document.querySelectorAll("body *")]
  .filter((node) => node.checkVisibility() && [...node.childNodes].some((child) =>
    child.nodeType === 3 && child.textContent.trim()))
  .filter((node) => parseFloat(getComputedStyle(node).fontSize) < {LEAST_FONT_PX}
    && !node.closest("svg"))
  .map((node) => `${{node.tagName}} ${{node.textContent.trim().slice(0, 40)}}`)"""
"""JavaScript: visible texts below the least size."""
SMALL_TARGETS = f"""() => [...document.querySelectorAll("button, select, a[href], summary, input")]
  .filter((node) => node.checkVisibility({{ visibilityProperty: true }}) && node.type !== "file")
  .map((node) => [node, (node.type === "checkbox" ? node.closest("label, li") : node)
    .getBoundingClientRect()])
  .filter(([node, box]) => box.width && (box.height < {LEAST_TARGET_PX} - 0.5
    || (box.width < {LEAST_TARGET_PX} - 0.5 && node.type !== "range")))
  .map(([node, box]) => `${{node.tagName}} ${{node.id || node.dataset.testid || node.textContent}} `
    + `${{Math.round(box.width)}} × ${{Math.round(box.height)}}`)"""
"""JavaScript: controls that are too small for a finger; a tick box counts with its label."""


def serious_findings(page: Page) -> list[list[str]]:
    """Return [rule, impact, places] of what axe finds on a page that has loaded it."""
    return [one for one in page.evaluate(FINDINGS, RULES) if one[1] in SERIOUS]


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
        page.emulate_media(color_scheme="light" if theme == "dark" else "dark")
        expect(page.locator("html")).not_to_have_attribute("data-theme", theme)
        serious += serious_findings(page)
        if serious or small or targets or wide:
            found[name] = [serious, small, targets, wide]
        page.close()
        operations.reset_stop()
    assert found == {}, "\n".join(f"{name}: {what}" for name, what in found.items())


def test_the_pages_of_runs_and_of_the_interface_have_no_serious_finding(
    page: Page, server: ConsoleServer
) -> None:
    for path in ("/runs", "/docs"):
        page.goto(server.url + path)
        page.wait_for_timeout(800)
        page.evaluate(AXE)
        grounds = set()
        for theme in ("dark", "light"):
            page.evaluate("(theme) => { document.documentElement.dataset.theme = theme; }", theme)
            assert serious_findings(page) == [], (path, theme)
            grounds.add(page.locator("body").evaluate("(b) => getComputedStyle(b).backgroundColor"))
        assert len(grounds) == 2, path


def test_no_style_sheet_has_text_below_the_least_size() -> None:
    sizes = {
        (sheet.name, int(size))
        for sheet in (FOLDER / "styles").glob("*.css")
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
    assert any("pale" in text for text in page.evaluate(SMALL_TEXT))
