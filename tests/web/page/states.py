"""Main states of the page, by what leads to them, and the sizes of the screens that show them."""

from __future__ import annotations

from collections.abc import Callable

from playwright.sync_api import Page

from navcore.mission.zone import ZoneKind
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import click_map, on_page
from web.interface.drafts import ZoneDraft

SIZES = {"desktop": (1440, 900), "tablet": (1024, 768), "phone": (390, 844)}
"""Width and height of each screen, pixels; all but the first have touch."""


def furnish(operations: FakeOperations) -> None:
    """Give the robot goals and zones with long names."""
    operations.goals.add(6.0, 0.5, name="Nurse station on the second floor")
    operations.goals.add(-4.0, -3.0)
    square = ((-4.0, 2.0), (-2.6, 2.0), (-2.6, 3.2), (-4.0, 3.2))
    operations.zones.add(ZoneDraft(name="Wet floor by the kitchen", polygon=square))
    operations.zones.add(
        ZoneDraft(
            name="Slow",
            polygon=tuple((x + 1.0, y) for x, y in square),
            kind=ZoneKind.SPEED_LIMIT,
            max_speed_mps=0.3,
        )
    )


def draw(page: Page) -> None:
    """Draw a zone."""
    page.get_by_test_id("mode-draw").click()
    for corner in ((0.0, 3.0), (1.0, 3.0), (1.0, 4.0)):
        click_map(page, *corner)


def open_tab(page: Page, name: str) -> None:
    """Select a tab of a narrow page; on a larger one all parts are shown."""
    tab = page.get_by_test_id(f"page-tab-{name}")
    if tab.is_visible():
        tab.click()


TABS = ("goals", "zones", "camera", "classes")
"""States of a page with tabs; on a large screen these parts are beside the map."""

STATES: dict[str, Callable[[Page], None]] = {
    "map": lambda page: None,
    "stopped": lambda page: page.get_by_test_id("stop").click(),
    "goals": lambda page: open_tab(page, "goals"),
    "zones": lambda page: open_tab(page, "zones"),
    "camera": lambda page: open_tab(page, "camera"),
    "classes": lambda page: open_tab(page, "more"),
    "draft": draw,
    "log": lambda page: page.get_by_test_id("tab-log").click(),
    "plots": lambda page: page.get_by_test_id("tab-plots").click(),
    "detections": lambda page: page.get_by_test_id("tab-seen").click(),
    "keys": lambda page: page.get_by_test_id("help-button").click(),
    "menu": lambda page: page.mouse.click(*on_page(page, -2.0, -3.0), button="right"),
}
"""The main states of the page, by what leads to them."""
