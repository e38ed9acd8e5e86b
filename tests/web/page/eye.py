"""What an eye and a hand need of a page, as axe and the browser measure it."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import Page

AXE = (Path(__file__).parent / "axe" / "axe.min.js").read_text(encoding="utf-8")
SERIOUS = ("serious", "critical")
LEAST_FONT_PX = 12
LEAST_TARGET_PX = 44
CONTRAST = ["color-contrast"]
"""The only rule whose findings depend on the theme."""
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
"""Tags of the rules."""
FINDINGS = """async ([runOnly, selector]) => {
  const { violations } = await axe.run(document.querySelector(selector), { iframes: false, runOnly,
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
  .map((node) => [node, ((node.type === "checkbox" && node.closest("label, li")) || node)
    .getBoundingClientRect()])
  .filter(([node, box]) => box.width && (box.height < {LEAST_TARGET_PX} - 0.5
    || (box.width < {LEAST_TARGET_PX} - 0.5 && node.type !== "range")))
  .map(([node, box]) => `${{node.tagName}} ${{node.id || node.dataset.testid || node.textContent}} `
    + `${{Math.round(box.width)}} × ${{Math.round(box.height)}}`)"""
"""JavaScript: controls that are too small for a finger; a tick box counts with its label."""


def serious_findings(page: Page, selector: str = "html") -> list[list[str]]:
    """Return [rule, impact, places] of what axe finds in a part of a page that has loaded it."""
    return _findings(page, {"type": "tag", "values": RULES}, selector)


def pale_texts(page: Page) -> list[list[str]]:
    """Return the same of contrast alone, for the other theme of a page."""
    return _findings(page, {"type": "rule", "values": CONTRAST}, "html")


def _findings(page: Page, rules: dict[str, object], selector: str) -> list[list[str]]:
    return [one for one in page.evaluate(FINDINGS, [rules, selector]) if one[1] in SERIOUS]
