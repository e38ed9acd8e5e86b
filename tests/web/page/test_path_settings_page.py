"""The settings of the path in a real Chromium: tried on the map, applied while driving, undone."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt
from PIL import Image
from playwright.sync_api import Page, expect

from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import await_map, eventually, on_canvas

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


def dashes_along(page: Page, points: npt.NDArray[np.float64]) -> int:
    """Return the number of white stretches that a line on the map has; `points` are (N, 2) metres
    of the map frame."""
    canvas = page.get_by_test_id("map-canvas")
    pixels = np.asarray(Image.open(io.BytesIO(canvas.screenshot())).convert("RGB"))
    corners = np.array([on_canvas(page, x, y) for x, y in points])
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    cols, rows = (np.interp(np.arange(along[-1]), along, corners[:, axis]) for axis in (0, 1))
    is_white = pixels[rows.astype(int), cols.astype(int)].min(axis=1) > 170
    return int(np.count_nonzero(np.diff(is_white.astype(int)) == 1))


def test_the_unseen_part_of_a_path_and_no_other_part_is_drawn_dashed(
    page: Page, operations: FakeOperations
) -> None:
    operations.goals.add(4.8, 0.0)
    operations.mission("start")
    await_map(page)
    picture = operations.newest_tick()
    assert picture is not None
    path = picture.path
    before = path[(path[:, 0] > 1.2) & (path[:, 0] < 2.2)]  # no waypoint lies on it
    beyond = path[(path[:, 0] > 2.8) & (path[:, 0] < 3.8)]
    is_drawn = """async () => (await import("/page/map/world.js")).world.path.length > 0"""
    eventually(page, lambda: bool(page.evaluate(is_drawn)))
    page.wait_for_timeout(300)
    assert (dashes_along(page, before), dashes_along(page, beyond)) == (0, 0)
    operations.unsee(2.5, 4.0, -1.5, 5.9)
    eventually(page, lambda: dashes_along(page, beyond) >= 3)
    assert dashes_along(page, before) == 0
