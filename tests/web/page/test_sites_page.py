"""The panel of the sites in a real Chromium: everything that the API can do with them, by hand."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from navcore.costmap.costmap import Costmap
from navcore.errors import Refused
from navcore.geometry.transform import Pose2
from navcore.localisation.estimate import LocalisationState
from tests.web.api.test_sites import YAML
from tests.web.fake_operations import FakeOperations
from tests.web.fake_sites import AREAS
from tests.web.page.chromium import (
    IS_TOPMOST,
    IS_WITHIN_VIEWPORT,
    await_map,
    click_map,
    eventually,
    map_view,
    middle_of,
    on_page,
)
from tests.web.page.test_map_touch import await_target, drag_map, right_click
from tests.web.page.test_overlays import press
from web.interface.sites import Site, SiteChanges

UNNAMED = """() => [...document.querySelectorAll('#sites :is(button, input, canvas)')]
  .filter((node) => !(node.labels?.length || node.getAttribute('aria-label') || node.title ||
    node.textContent.trim())).map((node) => node.outerHTML)"""
"""JavaScript: the controls of the panel without a name for a screen reader."""


@pytest.fixture
def panel(page: Page) -> Locator:
    """The opened panel."""
    await_map(page)
    press(page.get_by_test_id("sites-button"))
    opened = page.get_by_test_id("sites")
    expect(opened).to_be_visible()
    return opened


def row(panel: Locator, name: str) -> Locator:
    return panel.locator(f"[data-testid=site][data-name='{name}']")


def make_site(panel: Locator, name: str) -> None:
    panel.get_by_test_id("site-name").fill(name)
    press(panel.get_by_test_id("site-make"))
    expect(row(panel, name)).to_be_visible()


def test_a_site_may_be_called_in_letters_of_any_language(panel: Locator) -> None:
    make_site(panel, "Küche 2")
    name = panel.get_by_test_id("site-name")
    for bad in ("a/b", "★", "-a"):
        name.fill(bad)
        assert not name.evaluate("field => field.checkValidity()")
    name.fill("倉庫")
    assert name.evaluate("field => field.checkValidity()")


def test_sites_are_made_chosen_renamed_copied_and_deleted_by_hand(
    panel: Locator, operations: FakeOperations
) -> None:
    page = panel.page
    make_site(panel, "Ward 3")
    press(row(panel, "Ward 3").get_by_test_id("site-choose"))
    expect(page.get_by_test_id("sites-button")).to_have_text("Site Ward 3 ▾")
    expect(row(panel, "Ward 3")).to_contain_text("the robot is here")
    expect(row(panel, "Ward 3").get_by_test_id("site-delete")).to_be_disabled()
    press(row(panel, "Ward 3").get_by_test_id("site-rename"))
    renamed = row(panel, "Ward 3").get_by_test_id("site-rename-name")
    expect(renamed).to_have_value("Ward 3")
    renamed.fill("default")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("toasts")).to_contain_text("A site is called 'default' already")
    expect(renamed).to_have_value("default")  # to be corrected, not typed again
    renamed.fill("Ward 4")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("sites-button")).to_have_text("Site Ward 4 ▾")
    press(row(panel, "Ward 4").get_by_test_id("site-copy"))
    row(panel, "Ward 4").get_by_test_id("site-copy-name").fill("Ward 5")
    page.keyboard.press("Enter")
    expect(row(panel, "Ward 5")).to_be_visible()
    press(row(panel, "Ward 5").get_by_test_id("site-delete"))
    expect(row(panel, "Ward 5").get_by_test_id("site-delete")).to_have_text("Delete?")
    press(row(panel, "Ward 5").get_by_test_id("site-delete"))
    expect(row(panel, "Ward 5")).to_have_count(0)
    assert [site.name for site in operations.sites.all()] == ["Ward 4", "default"]
    assert page.evaluate(UNNAMED) == []
    press(page.get_by_test_id("stop"))
    expect(page.get_by_test_id("state-badge")).to_contain_text("STOPPED")
    page.keyboard.press("Escape")
    expect(panel).to_be_hidden()
    expect(page.get_by_test_id("sites-button")).to_be_focused()


def test_the_question_before_a_deletion_waits_for_the_reader_and_ends_with_the_focus(
    panel: Locator, operations: FakeOperations
) -> None:
    page = panel.page
    make_site(panel, "hall")
    delete = row(panel, "hall").get_by_test_id("site-delete")
    page.clock.install()
    press(delete)
    page.clock.run_for(60_000)
    expect(delete).to_have_text("Delete?")
    for key in ("Tab", "x"):
        page.keyboard.press(key)
        expect(delete).to_have_text("✕")
        delete.press("Enter")
        expect(delete).to_have_text("Delete?")
    assert {site.name for site in operations.sites.all()} == {"default", "hall"}
    delete.press("Enter")
    expect(row(panel, "hall")).to_have_count(0)


def test_a_refusal_is_shown_and_the_site_stays(panel: Locator, operations: FakeOperations) -> None:
    page = panel.page
    make_site(panel, "hall")
    operations.goals.add(-4.0, 3.0)
    operations.mission("start")
    press(row(panel, "hall").get_by_test_id("site-choose"))
    expect(page.get_by_test_id("toasts")).to_contain_text("pause or cancel it")
    expect(page.get_by_test_id("sites-button")).to_have_text("Site default ▾")


def test_an_archive_is_exported_and_imported(
    panel: Locator, operations: FakeOperations, tmp_path: Path
) -> None:
    with panel.page.expect_download() as download:
        press(row(panel, "default").get_by_test_id("site-export"))
    file = tmp_path / download.value.suggested_filename
    download.value.save_as(file)
    assert file.name == "default.site.zip"
    panel.get_by_test_id("site-name").fill("Ward 7")
    panel.get_by_test_id("site-import").set_input_files(file)
    expect(row(panel, "Ward 7")).to_be_visible()
    expect(panel.get_by_test_id("site-name")).to_have_value("")
    panel.get_by_test_id("site-import").set_input_files(file)  # whose site is there
    expect(row(panel, "default 2")).to_be_visible()
    panel.get_by_test_id("site-import").set_input_files(
        {"name": "Ward 7.site.zip", "mimeType": "application/zip", "buffer": file.read_bytes()}
    )
    expect(row(panel, "Ward 7 2")).to_be_visible()
    assert operations.sites.archives == [b"archive of default"] * 3


def test_changes_are_listed_drawn_and_accepted_one_by_one(panel: Locator) -> None:
    page = panel.page
    expect(page.get_by_test_id("changes-note")).to_contain_text("No map has been accepted yet")
    press(page.get_by_test_id("changes-all"))
    expect(page.get_by_test_id("change")).to_have_count(2)
    expect(page.get_by_test_id("change").first).to_contain_text("new obstacle, 0.80 m²")
    press(page.get_by_test_id("change-accept").first)
    expect(page.get_by_test_id("change")).to_have_count(1)
    expect(page.get_by_test_id("changes-note")).to_contain_text("1 area differs")


def test_a_change_is_looked_at_on_the_map_before_it_is_accepted(panel: Locator) -> None:
    page = panel.page
    press(page.get_by_test_id("changes-all"))
    shown, middle = page.get_by_test_id("change-shown"), AREAS[0].outline.mean(axis=0)
    for leave, left in (("change-back", 2), ("change-shown-accept", 1)):
        page.get_by_test_id("change").first.get_by_title("Show it on the map").click()
        expect(panel).to_be_hidden()
        expect(shown).to_contain_text("new obstacle, 0.80 m²")
        eventually(page, lambda: map_view(page)[1:] == pytest.approx(middle, abs=0.01))
        assert shown.evaluate(IS_WITHIN_VIEWPORT)
        page.get_by_test_id(leave).click()
        expect(panel).to_be_visible()
        expect(shown).to_be_hidden()
        expect(page.get_by_test_id("change")).to_have_count(left)
    page.get_by_test_id("change").first.get_by_title("Show it on the map").click()
    expect(shown).to_be_visible()
    page.keyboard.press("Escape")
    expect(panel).to_be_visible()
    expect(shown).to_be_hidden()


def test_what_was_begun_at_a_site_ends_with_it(panel: Locator, operations: FakeOperations) -> None:
    page = panel.page
    press(page.get_by_test_id("changes-all"))
    page.get_by_test_id("change").first.get_by_title("Show it on the map").click()
    page.get_by_test_id("beware-add").click()
    page.evaluate(
        """async () => {
            const { propose } = await import("/page/localisation/place.js");
            await propose({ x_m: 0, y_m: 0, yaw_rad: 0 });
        }"""
    )
    page.evaluate(
        """async () => {
            const { ask } = await import("/page/core/toasts.js");
            ask("Replace the zones?", [{ label: "Replace", run: () => {} }]);
        }"""
    )
    begun = [page.locator(f"#{name}") for name in ("change-shown", "entry", "place-proposal")]
    begun.append(page.get_by_test_id("toast-action").filter(has_text="Replace"))
    for part in begun:
        expect(part).to_be_visible()
    operations.sites.make("Ward 3")
    operations.sites.choose("Ward 3")
    for part in begun:
        expect(part).to_be_hidden()
    expect(page.get_by_test_id("toasts")).to_contain_text("nothing was changed")


def test_nothing_that_was_begun_on_the_map_of_a_site_changes_the_next(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    operations.goals.add(-3.0, 3.0)
    await_target(page, -3.0, 3.0)
    drag_map(page, (-3.0, 3.0), (-4.0, 3.0))
    undo = page.get_by_test_id("toast-action").filter(has_text="Undo")
    expect(undo).to_be_visible()
    await_target(page, -4.0, 3.0)
    page.mouse.down()
    page.mouse.move(*on_page(page, -2.0, 3.0))
    operations.sites.make("Ward 3")
    operations.sites.choose("Ward 3")
    expect(page.get_by_test_id("sites-button")).to_have_text("Site Ward 3 ▾")
    page.mouse.up()
    undo.click()
    expect(page.get_by_test_id("toasts")).to_contain_text("The robot is at another site now")
    (goal,) = operations.state().queue
    assert goal.x_m == pytest.approx(-4.0, abs=0.1)
    right_click(page, 0.0, -3.0)
    operations.sites.choose("default")
    expect(page.get_by_test_id("map-menu")).to_be_hidden()


def test_the_map_is_drawn_in_the_frame_of_its_own_site(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    with page.expect_response("**/map/tiles?since=0"):
        operations.sites.make("Ward 3")
        operations.sites.choose("Ward 3")  # the newest tick is still of the site before
    page.wait_for_timeout(300)
    tick = operations.newest_tick()
    assert tick is not None
    moved = dataclasses.replace(tick.grid_spec, origin_x_m=tick.grid_spec.origin_x_m + 12.8)
    occupancy = Costmap.of(
        dataclasses.replace(tick.grid, spec=moved), tick.blocked, version=tick.grid_version + 1
    )
    operations.view.picture = dataclasses.replace(
        tick, occupancy=occupancy, grid_version=tick.grid_version + 1
    )
    drawn = """async () => (await import("/page/map/world.js")).world.map.origin_x_m"""
    eventually(page, lambda: page.evaluate(drawn) == moved.origin_x_m, patience_s=5.0)


def test_another_name_of_the_site_ends_nothing_that_was_begun(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    named = list[str | None]()
    page.on("request", lambda sent: named.append(sent.headers.get("site-id")))
    press(page.get_by_test_id("mode-goal"))
    operations.sites.change("default", SiteChanges(name="hall"))
    expect(page.get_by_test_id("sites-button")).to_have_text("Site hall ▾")
    expect(page.get_by_test_id("mode-goal")).to_be_checked()
    click_map(page, -4.0, 3.0)
    eventually(page, lambda: len(operations.state().queue) == 1)
    assert operations.sites.chosen_id in named


def test_a_list_of_changes_that_is_read_again_keeps_its_items(panel: Locator) -> None:
    page = panel.page
    press(page.get_by_test_id("changes-all"))
    item = page.get_by_test_id("change").first
    item.evaluate("(item) => { item.mark = true; }")
    with page.expect_response("**/map/changes"):
        press(page.get_by_test_id("changes-refresh"))
    page.wait_for_timeout(200)
    assert item.evaluate("(item) => item.mark === true")


def test_the_changes_of_a_site_that_was_just_entered_are_listed_with_its_first_image(
    panel: Locator, operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, listed = panel.page, operations.sites.changes

    def refuse() -> None:
        raise Refused("there is no map yet; the camera has not delivered an image")

    monkeypatch.setattr(operations.sites, "changes", refuse)
    note = page.get_by_test_id("changes-note")
    press(page.get_by_test_id("changes-refresh"))
    expect(note).to_have_text("There is no map yet; the camera has not delivered an image")
    monkeypatch.setattr(operations.sites, "changes", listed)
    expect(note).to_contain_text("No map has been accepted yet")


def test_the_panel_comes_back_from_the_map_as_it_was_left(panel: Locator) -> None:
    page = panel.page
    for number in range(8):
        make_site(panel, f"Ward {number}")
    setting = page.get_by_test_id("dock-set")
    setting.scroll_into_view_if_needed()
    page.mouse.move(*middle_of(setting))
    page.mouse.wheel(0, 2000)
    scrolled = panel.evaluate("(panel) => panel.scrollTop")
    assert scrolled > 0 and page.get_by_test_id("sites-close").evaluate(IS_TOPMOST)
    press(setting)
    expect(panel).to_be_hidden()
    for point in ((-3.0, 3.0), (-3.0, 4.0)):
        page.mouse.click(*on_page(page, *point))
    expect(panel).to_be_visible()
    assert panel.evaluate("(panel) => panel.scrollTop") == scrolled


def test_a_nav2_map_is_placed_by_two_clicks_in_each_frame(
    panel: Locator, operations: FakeOperations, tmp_path: Path
) -> None:
    page = panel.page
    (tmp_path / "map.yaml").write_text(YAML)
    (tmp_path / "map.pgm").write_bytes(b"P5\n# made by a test\n20 20\n255\n" + bytes([254] * 400))
    panel.get_by_test_id("site-name").fill("hall")
    files = [tmp_path / "map.yaml", tmp_path / "map.pgm"]
    (tmp_path / "other.pgm").write_bytes((tmp_path / "map.pgm").read_bytes())
    note = panel.get_by_test_id("placing-note")
    panel.get_by_test_id("site-import-nav2").set_input_files([files[0], tmp_path / "other.pgm"])
    expect(note).to_contain_text("is of map.pgm, the image that was chosen is other.pgm")
    panel.get_by_test_id("site-import-nav2").set_input_files(files)
    expect(note).to_have_text(re.compile("^Site hall"))
    image = panel.get_by_test_id("placing-image")
    image.scroll_into_view_if_needed()
    expect(image).to_be_visible()
    box = image.bounding_box()
    assert box is not None
    # 20 pixels of 0.1 m from (-1, -1); the first row is the largest y.
    for right, down in ((0.1, 0.75), (0.9, 0.75)):
        image.click(position={"x": right * box["width"], "y": down * box["height"]})
    expect(panel.get_by_test_id("placing-map-A")).to_have_value(
        re.compile(r"^-0\.[78]\d*, -0\.[45]")
    )
    for name, (x, y) in {"A": (-4.0, 3.0), "B": (-4.0, 4.6)}.items():
        press(panel.get_by_test_id(f"placing-pick-{name}"))
        expect(panel).to_be_hidden()
        page.mouse.click(*on_page(page, x, y))
        expect(panel).to_be_visible()
    on_site = panel.get_by_test_id("placing-site-A")
    expect(on_site).to_have_value(re.compile(r"^-[34](\.\d+)?, [23]"))
    press(panel.get_by_test_id("placing-make"))
    expect(row(panel, "hall")).to_be_visible()
    expect(panel.get_by_test_id("site-name")).to_have_value("")
    placed = operations.sites.placed
    assert placed is not None and abs(placed.yaw_rad - 1.5708) < 0.1


def test_dock_and_tags_are_set_by_the_robots_place_the_map_and_the_camera(
    panel: Locator, operations: FakeOperations
) -> None:
    page = panel.page

    def site() -> Site:
        return operations.sites.all()[0]

    expect(panel.get_by_test_id("dock-text")).to_contain_text("No dock yet")
    press(panel.get_by_test_id("dock-here"))
    expect(panel.get_by_test_id("dock-text")).to_contain_text("facing")
    here, pose = site().dock, operations.state().pose
    assert here is not None and pose.x_m is not None
    assert (here.x_m, here.y_m) == pytest.approx((pose.x_m, pose.y_m), abs=0.01)
    lost = dataclasses.replace(operations.place.now, state=LocalisationState.LOST)
    operations.place.now, known = lost, operations.place.now
    expect(panel.get_by_test_id("dock-here")).to_be_disabled()
    operations.place.now = known
    expect(panel.get_by_test_id("dock-here")).to_be_enabled()
    hint = page.get_by_test_id("hint")
    press(panel.get_by_test_id("dock-set"))
    expect(hint).to_contain_text("Click the middle of the robot in its dock")
    page.keyboard.press("Escape")
    page.mouse.click(*on_page(page, -3.0, 3.0))
    expect(hint).to_be_hidden()  # the click sets no dock any more
    press(page.get_by_test_id("sites-button"))
    press(panel.get_by_test_id("dock-set"))
    expect(panel).to_be_hidden()
    page.mouse.click(*on_page(page, -3.0, 3.0))
    expect(hint).to_have_text(re.compile("^Drag or click in the direction in which it faces"))
    page.mouse.click(*on_page(page, -3.0, 4.0))
    expect(panel).to_be_visible()
    expect(panel.get_by_test_id("dock-text")).to_contain_text("facing 90")  # the answer is here
    dock = site().dock
    assert dock is not None
    assert (dock.x_m, dock.y_m) == pytest.approx((-3.0, 3.0), abs=0.1)
    assert dock.yaw_rad == pytest.approx(math.pi / 2, abs=0.1)
    press(panel.get_by_test_id("tags-look"))
    expect(panel.get_by_test_id("seen-tag")).to_contain_text("Tag 12, 30 cm, at 3.00, 0.50")
    press(panel.get_by_test_id("tag-add"))
    expect(panel.get_by_test_id("tag")).to_have_count(1)
    panel.get_by_test_id("tag-number").fill("7")
    press(panel.get_by_test_id("tag-set"))
    page.mouse.click(*on_page(page, -4.0, 3.0))
    page.mouse.click(*on_page(page, -3.0, 3.0))
    expect(panel.get_by_test_id("tag")).to_have_count(2)
    assert [tag.id for tag in site().tags] == [7, 12]
    assert site().tags[0].yaw_rad == pytest.approx(0.0, abs=0.1)
    press(panel.get_by_test_id("tag-remove").first)
    expect(panel.get_by_test_id("tag")).to_have_count(1)
    press(panel.get_by_test_id("dock-drive"))
    expect(page.get_by_test_id("goal")).to_have_count(1)
    press(panel.get_by_test_id("dock-remove"))
    expect(panel.get_by_test_id("dock-text")).to_contain_text("No dock yet")
    assert site().dock is None
    assert page.evaluate(UNNAMED) == []


def test_the_dock_of_a_site_ends_with_it_and_that_of_the_next_is_read_until_it_is_there(
    panel: Locator, operations: FakeOperations
) -> None:
    page, sites = panel.page, operations.sites
    make_site(panel, "hall")
    sites.change("hall", SiteChanges(dock=Pose2(x_m=2.0, y_m=1.0, yaw_rad=0.0)))
    press(panel.get_by_test_id("dock-here"))
    drive = panel.get_by_test_id("dock-drive")
    expect(drive).to_be_visible()
    held = list[Route]()
    page.route("**/api/v1/sites/hall", lambda route: held.append(route))
    sites.choose("hall")
    expect(page.get_by_test_id("sites-button")).to_have_text("Site hall ▾")
    expect(drive).to_be_hidden()
    expect(panel.get_by_test_id("dock-text")).to_be_empty()
    eventually(page, lambda: len(held) > 0)
    page.unroute("**/api/v1/sites/hall")
    press(page.get_by_test_id("stop"))  # which aborts the request
    expect(panel.get_by_test_id("dock-text")).to_contain_text("2.00, 1.00")
    expect(drive).to_be_visible()


def test_dock_and_tag_are_set_by_keyboard_alone(page: Page, operations: FakeOperations) -> None:
    await_map(page)
    page.get_by_test_id("sites-button").press("Enter")
    expect(page.get_by_test_id("dock-text")).to_contain_text("No dock yet")
    page.get_by_test_id("dock-place").focus()
    page.keyboard.type("-3, 3")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("toasts")).to_contain_text("and the heading in degrees")
    assert operations.sites.all()[0].dock is None
    page.keyboard.type(", 90")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("dock-text")).to_contain_text("The dock is at -3.00, 3.00")
    expect(page.get_by_test_id("dock-place")).to_have_value("")
    page.get_by_test_id("tag-number").focus()
    page.keyboard.type("7")
    for _ in range(2):
        page.keyboard.press("Tab")
    page.keyboard.type("4 1.5 180")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("tag")).to_contain_text("Tag 7, 30 cm, at 4.00, 1.50")
    dock, (tag,) = operations.sites.all()[0].dock, operations.sites.all()[0].tags
    assert dock is not None and (dock.x_m, dock.y_m) == (-3.0, 3.0)
    assert dock.yaw_rad == pytest.approx(math.pi / 2, abs=0.001)
    assert tag.yaw_rad == pytest.approx(math.pi, abs=0.001)
