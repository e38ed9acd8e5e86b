"""The settings of the path in a real Chromium: tried on the map, applied while driving, undone."""

from __future__ import annotations

from playwright.sync_api import Page, expect

from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import await_map, eventually

TRIED = """async () => (await import("/page/mission/path_settings.js")).pathDraft.path.length"""


def test_the_price_of_unseen_floor_is_tried_on_the_map_applied_while_driving_and_undone(
    page: Page, operations: FakeOperations
) -> None:
    operations.unsee(2.5, 4.0, -1.5, 5.9)
    operations.goals.add(4.8, 0.0)
    operations.mission("start")
    await_map(page)
    button, slider = page.get_by_test_id("path-settings"), page.get_by_test_id("path-price")
    button.click()
    apply = page.get_by_test_id("path-apply")
    expect(apply).to_be_disabled()
    expect(slider).to_have_attribute("max", "20")
    slider.focus()
    for _ in range(8):
        page.keyboard.press("ArrowRight")
    expect(page.get_by_test_id("path-price-shown")).to_have_text("× 5")
    expect(page.get_by_test_id("path-effect")).to_contain_text("the path would be")
    assert page.evaluate(TRIED) > 10
    assert operations.path_settings.unknown_price == 1.0
    apply.click()
    eventually(page, lambda: operations.path_settings.unknown_price == 5.0)
    expect(button).to_have_text("Path × 5 ▾")
    assert page.evaluate(TRIED) == 0
    assert operations.state().moving
    page.get_by_test_id("toast-action").filter(has_text="Undo").click()
    expect(button).to_have_text("Path ▾")
    assert operations.path_settings.unknown_price == 1.0
