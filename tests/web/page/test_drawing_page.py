"""Drawing on the page in a real Chromium: shapes, undo, previews, sets, files, headings, camera."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Download, Page, Route, expect

from navcore.formats.nav2_map import State, read
from navcore.mission.zone import MAX_CORNERS, ZoneKind
from navcore.mission.zone_shapes import Circle, Corridor
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_WITHIN_VIEWPORT, await_map, click_map, eventually, on_page
from web.interface.drafts import ZoneDraft

IS_IN_ROW = """(part) => {
  const [inner, row] = [part, part.closest("li")].map((node) => node.getBoundingClientRect());
  return inner.left >= row.left && inner.right <= row.right && inner.bottom <= row.bottom
    && part.scrollWidth <= part.clientWidth + (part.matches(".name") ? Infinity : 1);
}"""
"""JavaScript: whether a part of a row is inside it and whole; a name may end in an ellipsis."""
LISTS = """() => ["goals", "zones"].map((id) => {
  const list = document.getElementById(id);
  return [list.closest(".card").clientHeight, list.scrollWidth, list.clientWidth];
})"""
"""JavaScript: height of the cards of goals and zones, width of their lists and what of it shows."""


FRONT = """async () => {
  const names = ["drawing/draw_robot", "drawing/strokes", "view", "world"];
  const [{ drawRobot }, { drawOn }, { size, toPage, view }, { world }] =
    await Promise.all(names.map((name) => import(`/page/map/${name}.js`)));
  const { x_m, y_m, yaw_rad } = world.state.pose;
  view.scale = 100;
  const pen = new OffscreenCanvas(size.width, size.height).getContext("2d");
  [view.x, view.y] = [x_m, y_m];
  drawOn(pen, drawRobot);
  const isDark = (ahead, left) => {
    const [forward, aside] = [ahead * world.map.robot_length_m, left * world.map.robot_width_m];
    const at = toPage([x_m + forward * Math.cos(yaw_rad) - aside * Math.sin(yaw_rad),
      y_m + forward * Math.sin(yaw_rad) + aside * Math.cos(yaw_rad)]);
    return pen.getImageData(...at.map(Math.round), 1, 1).data[0] < 60;
  };
  return [isDark(0.38, 0), isDark(-0.2, 0), isDark(0.1, 0.2), isDark(0.1, -0.2), isDark(-0.38, 0)];
}"""
"""JavaScript: whether the robot's arrow is at its tip, at its base, at both sides and behind it."""


def drag(page: Page, *points: tuple[float, float]) -> None:
    """Drag along points of the map in metres."""
    page.mouse.move(*on_page(page, *points[0]))
    page.mouse.down()
    for point in points[1:]:
        page.mouse.move(*on_page(page, *point), steps=3)
    page.mouse.up()


def test_every_shape_is_drawn_with_the_pointer_and_a_speed_limit_is_one_choice_away(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.keyboard.press("o")
    click_map(page, -3.0, -3.0)
    click_map(page, -2.0, -3.0)
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("zone")).to_have_count(1)
    expect(page.get_by_test_id("draft")).to_be_hidden()
    page.keyboard.press("l")
    for place in ((-6.0, 3.0), (-4.0, 3.0), (-4.0, 4.5)):
        click_map(page, *place)
    page.get_by_test_id("zone-size").fill("0.5")
    page.get_by_test_id("zone-kind").select_option("speed-limit")
    page.get_by_test_id("zone-limit").fill("0.25")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("zone")).to_have_count(2)
    expect(page.get_by_test_id("draft")).to_be_hidden()
    page.keyboard.press("h")
    drag(page, (-5.0, -4.0), (-4.0, -4.0), (-4.0, -5.0), (-5.0, -5.0), (-5.0, -4.1))
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("zone")).to_have_count(3)
    ring, strip, hand = operations.zones.stored
    assert isinstance(ring.drawn, Circle) and ring.drawn.radius_m == pytest.approx(1.0, abs=0.1)
    assert isinstance(strip.drawn, Corridor) and strip.drawn.width_m == 0.5
    assert (strip.kind, strip.max_speed_mps) == (ZoneKind.SPEED_LIMIT, 0.25)
    assert hand.drawn is None and 4 <= len(hand.polygon) <= 12


@pytest.mark.parametrize("pixel_m", [0.0, 0.5])
def test_a_long_freehand_stroke_has_no_more_corners_than_a_zone_may_have(
    page: Page, pixel_m: float
) -> None:
    stroke = """async (pixelM) => {
        const { draft, setFreehand, setTool } = await import("/page/zones/draft.js");
        setTool("free");
        // As wide as a large map, by a hand that trembles by half a metre.
        setFreehand(
          Array.from({ length: 2400 }, (_, i) => {
            const [angle, radius] = [(2 * Math.PI * i) / 2400, 150 + 0.5 * Math.sin(i * 0.9)];
            return [radius * Math.cos(angle), radius * Math.sin(angle)];
          }),
          pixelM,
        );
        return draft.corners.length;
    }"""
    assert 20 < page.evaluate(stroke, pixel_m) <= MAX_CORNERS


@pytest.mark.parametrize("size", [(1440, 900), (1024, 768)])
def test_a_limit_with_an_end_leaves_its_row_whole_and_a_draft_takes_no_room_from_the_lists(
    page: Page, operations: FakeOperations, size: tuple[int, int]
) -> None:
    await_map(page)
    page.set_viewport_size({"width": size[0], "height": size[1]})
    square = ((-4.0, 2.0), (-2.6, 2.0), (-2.6, 3.2), (-4.0, 3.2))
    operations.zones.add(
        ZoneDraft(
            name="Wet floor by the kitchen",
            polygon=square,
            kind=ZoneKind.SPEED_LIMIT,
            max_speed_mps=0.3,
            expires_in_s=900.0,
        )
    )
    operations.goals.add(6.0, 0.5)
    row = page.get_by_test_id("zone")
    expect(row.locator(".terms")).to_contain_text("0.3 m/s")
    for part in ("zone-enabled", "zone-rename", "zone-edit", "zone-delete"):
        assert row.get_by_test_id(part).evaluate(IS_IN_ROW), part
    assert row.locator(".terms").evaluate(IS_IN_ROW)
    # Eight characters of the name at least.
    assert row.get_by_test_id("zone-rename").evaluate("(name) => name.clientWidth") >= 64
    before = page.evaluate(LISTS)
    assert all(wide == shown for _, wide, shown in before)
    page.get_by_test_id("mode-draw").click()
    click_map(page, 0.0, 3.0)
    expect(page.get_by_test_id("draft")).to_be_visible()
    assert page.get_by_test_id("draft").evaluate(IS_WITHIN_VIEWPORT)
    assert page.evaluate(LISTS) == before


def test_a_drawing_begun_before_a_slow_answer_starts_after_it_and_no_zone_is_stored_twice(
    page: Page, operations: FakeOperations
) -> None:
    def late(route: Route) -> None:
        page.wait_for_timeout(400)
        route.continue_()

    await_map(page)
    page.route("**/api/v1/zones", late)
    page.keyboard.press("o")
    click_map(page, -3.0, -3.0)
    click_map(page, -2.0, -3.0)
    for key in ("Enter", "Enter", "l"):
        page.keyboard.press(key)
    expect(page.get_by_test_id("hint")).to_contain_text("Click along the line")
    for place in ((-6.0, 3.0), (-4.0, 3.0)):
        click_map(page, *place)
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("zone")).to_have_count(2)
    ring, strip = operations.zones.stored
    assert isinstance(ring.drawn, Circle) and isinstance(strip.drawn, Corridor)


def test_a_draft_is_moved_by_corner_and_whole_and_undone_step_by_step(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    operations.zones.add(
        ZoneDraft(name="box", polygon=((-5.0, -4.0), (-4.0, -4.0), (-4.0, -3.0), (-5.0, -3.0)))
    )
    page.get_by_test_id("zone-edit").click()
    corners = page.get_by_test_id("zone-corners")
    stored = corners.input_value()
    drag(page, (-4.0, -3.0), (-3.0, -2.0))
    expect(corners).to_have_value(re.compile(r"^-5, -4\n-4, -4\n-[23][.\d]*, -[12][.\d]*\n"))
    drag(page, (-4.5, -4.0), (-4.5, -5.0))
    expect(page.get_by_test_id("draft-note")).to_contain_text("5 corners")
    page.keyboard.press("Delete")
    expect(page.get_by_test_id("draft-note")).to_contain_text("4 corners")
    drag(page, (-4.3, -3.3), (-4.3, -2.3))
    expect(corners).to_have_value(re.compile(r"^-[45][.\d]*, -[23][.\d]*\n"))
    for _ in range(4):
        page.keyboard.press("Control+z")
    expect(corners).to_have_value(stored)
    for _ in range(4):
        page.keyboard.press("Control+Shift+z")
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("draft")).to_be_hidden()
    assert operations.zones.stored[0].version == 2
    page.keyboard.press("Control+z")
    expect(page.get_by_test_id("zones-redo")).to_be_enabled()
    assert operations.zones.stored[0].polygon[0] == (-5.0, -4.0)


def test_the_preview_of_a_draft_names_the_zone_that_cuts_the_goal_off(
    page: Page, operations: FakeOperations
) -> None:
    operations.goals.add(6.0, 0.5)
    page.keyboard.press("z")
    page.get_by_test_id("zone-name").fill("Fence")
    page.get_by_test_id("zone-corners").fill("-4, -5.9; -3, -5.9; -3, 5.9; -4, 5.9")
    page.get_by_test_id("zone-margin").focus()
    expect(page.get_by_test_id("draft-note")).to_contain_text("cut off by “Fence”")
    page.get_by_test_id("zone-corners").fill("3, -2; 3.5, -2; 3.5, 2.2; 3, 2.2")
    page.get_by_test_id("zone-margin").focus()
    expect(page.get_by_test_id("draft-note")).to_contain_text(
        re.compile(r"the path would be .* m, about .* s \(\+\d")
    )
    assert operations.zones.stored == ()


def test_a_zone_whose_corners_cannot_be_read_is_not_stored(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.keyboard.press("z")
    corners = page.get_by_test_id("zone-corners")
    corners.fill("1, 1\n2, 1\n2, 2")
    corners.fill("1, 1\n2, 1\n2, 2 m\n1, 2")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("draft-note")).to_contain_text("“2, 2 m” is no corner")
    expect(corners).to_be_focused()
    page.get_by_test_id("map-canvas").press("Enter")
    expect(corners).to_be_focused()
    assert not list(operations.zones.stored)
    corners.fill("1, 1\n2, 1\n2, 2\n1, 2")  # the control
    page.get_by_test_id("zone-margin").fill("0.07")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("zone")).to_have_count(1)
    assert [one.margin_m for one in operations.zones.stored] == [0.07]


def test_a_drawing_begun_by_mouse_before_a_slow_answer_is_left_alone(
    page: Page, operations: FakeOperations
) -> None:
    held: list[Route] = []
    await_map(page)
    page.route("**/api/v1/zones", lambda route: held.append(route))
    page.keyboard.press("z")
    page.get_by_test_id("zone-corners").fill("1, 1\n2, 1\n2, 2")
    page.get_by_test_id("zone-finish").click()
    eventually(page, lambda: bool(held))
    page.get_by_test_id("mode-draw").click()
    click_map(page, -3.0, -3.0)
    held.pop().continue_()
    expect(page.get_by_test_id("toasts")).to_contain_text("is in force")
    expect(page.get_by_test_id("draft-note")).to_contain_text("1 corner")


def test_a_click_on_finish_counts_though_the_message_above_it_gets_shorter(
    page: Page, operations: FakeOperations
) -> None:
    # As the click begins, the field of the name takes its text, and the preview is asked again.
    long = "A zone with a name that takes more than one line of the form"
    said = {"found": False, "cut_by": [long], "reason": "", "path": [], "present": None}
    page.route("**/api/v1/preview", lambda route: route.fulfill(json=said))
    page.set_viewport_size({"width": 1440, "height": 1000})
    await_map(page)
    page.keyboard.press("z")
    for corner in ((-3.0, -3.0), (-2.0, -3.0), (-2.0, -2.0)):
        click_map(page, *corner)
    expect(page.get_by_test_id("draft-note")).to_contain_text(long)
    page.get_by_test_id("zone-name").fill("Wet floor")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("zone")).to_have_count(1)
    assert [zone.name for zone in operations.zones.stored] == ["Wet floor"]


def test_goals_get_headings_by_drag_names_order_and_the_nearest_free_position_when_blocked(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.keyboard.press("g")
    drag(page, (-3.0, 3.0), (-3.0, 4.5))
    expect(page.get_by_test_id("goal")).to_have_count(1)
    assert operations.state().queue[0].yaw_rad == pytest.approx(1.571, abs=0.1)
    page.get_by_test_id("goal-name").fill("Window")
    page.get_by_test_id("goal-name").press("Enter")
    click_map(page, 4.0, 2.5)
    page.get_by_test_id("toast-action").click()
    expect(page.get_by_test_id("goal")).to_have_count(2)
    page.get_by_test_id("goal-up").last.click()
    expect(page.get_by_test_id("goal-name").last).to_have_value("Window")
    page.get_by_test_id("loop").check()
    page.get_by_test_id("missions").click()
    page.get_by_test_id("missions-name").fill("rounds")
    page.get_by_test_id("missions-save").click()
    expect(page.get_by_test_id("missions-entry")).to_contain_text("2 goals, repeated")
    assert operations.goals.missions()["rounds"].loop and operations.state().loop


def test_a_click_near_the_position_that_is_offered_takes_it(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    page.keyboard.press("g")
    click_map(page, 4.0, 2.5)
    # The message would lie over the place that it offers.
    page.locator(".toast", has=page.get_by_test_id("toast-action")).get_by_label("Dismiss").click()
    offered = page.evaluate("async () => (await import('/page/mission/goals.js')).offer.position")
    right, down = on_page(page, *offered)
    page.mouse.click(right + 5, down + 5)
    expect(page.get_by_test_id("goal")).to_have_count(1)
    goal = operations.state().queue[0]
    assert [goal.x_m, goal.y_m] == offered


@pytest.mark.parametrize("key", ["Escape", "z"])
def test_a_position_that_was_offered_goes_when_the_operator_goes_on(page: Page, key: str) -> None:
    offered = """async () => (await import("/page/mission/goals.js")).offer.position"""
    await_map(page)
    page.keyboard.press("g")
    click_map(page, 4.0, 2.5)
    expect(page.get_by_test_id("toast-action")).to_be_visible()
    page.keyboard.press("n")
    assert page.evaluate(offered) is not None
    page.keyboard.press(key)
    assert page.evaluate(offered) is None


def test_a_position_that_was_offered_goes_when_the_mission_begins_or_ends(
    page: Page, operations: FakeOperations
) -> None:
    await_map(page)
    operations.goals.add(3.0, 0.0)
    page.keyboard.press("g")
    click_map(page, 4.0, 2.5)
    offer = "async () => (await import('/page/mission/goals.js')).offer.position"
    expect(page.get_by_test_id("toast-action")).to_be_visible()
    assert page.evaluate(offer) is not None
    page.locator("[data-mission=start]").click()
    operations.step()
    expect(page.locator("[data-mission=pause]")).to_be_enabled()
    assert page.evaluate(offer) is None


def test_zones_are_saved_in_sets_and_files_and_an_import_is_undone_with_one_key(
    page: Page, operations: FakeOperations, tmp_path: Path
) -> None:
    operations.zones.add(ZoneDraft(name="desk", polygon=((-5.0, -4.0), (-4.0, -4.0), (-4.0, -3.0))))
    expect(page.get_by_test_id("zone")).to_have_count(1)
    page.get_by_test_id("zone-sets").click()
    page.get_by_test_id("zone-sets-name").fill("night")
    page.get_by_test_id("zone-sets-save").click()
    expect(page.get_by_test_id("zone-sets-entry")).to_contain_text("1 zone")
    page.get_by_test_id("zone-files").click()
    with page.expect_download() as exported:
        page.get_by_test_id("zones-geojson").click()
    exported.value.save_as(tmp_path / "zones.geojson")
    assert (
        json.loads((tmp_path / "zones.geojson").read_text())["features"][0]["properties"]["name"]
        == "desk"
    )
    page.get_by_test_id("zones-file").set_input_files(tmp_path / "zones.geojson")
    page.get_by_test_id("toast-action").filter(has_text="Keep both").click()
    expect(page.get_by_test_id("zone")).to_have_count(2)
    page.get_by_test_id("map-canvas").focus()
    page.keyboard.press("Control+z")
    expect(page.get_by_test_id("zone")).to_have_count(1)
    page.get_by_test_id("zone-delete").click()
    expect(page.get_by_test_id("zone")).to_have_count(0)
    page.get_by_test_id("zone-sets").click()
    page.get_by_test_id("zone-sets-entry").get_by_role("button", name="Use").click()
    expect(page.get_by_test_id("zone")).to_have_count(1)


def test_a_mask_is_exported_on_one_grid_also_while_the_map_grows(
    page: Page, operations: FakeOperations, tmp_path: Path
) -> None:
    operations.zones.add(ZoneDraft(name="desk", polygon=((-5.0, -4.0), (-4.0, -4.0), (-4.0, -3.0))))
    asked, saved = list[str](), list[Download]()

    def grow_once(route: Route) -> None:
        asked.append(route.request.url)
        if len(asked) == 1:
            operations.grow(-20.0, 0.0)
        route.continue_()

    def note(download: Download) -> None:
        saved.append(download)

    page.route("**/zones.pgm*", grow_once)
    page.on("download", note)
    page.get_by_test_id("zone-files").click()
    page.get_by_test_id("zones-mask").click()
    eventually(page, lambda: len(saved) == 2)
    assert len(asked) == 2
    files = {}
    for one in saved:
        one.save_as(tmp_path / one.suggested_filename)
        files[one.suggested_filename] = (tmp_path / one.suggested_filename).read_bytes()
    mask = read(files["zones.yaml"], files["zones.pgm"], "mask")
    closed = mask.cells(State.OCCUPIED)
    assert closed[mask.spec.cell(-4.1, -3.9)] and not closed[mask.spec.cell(4.1, -3.9)]


def test_a_click_on_an_object_in_the_camera_image_drafts_a_zone(
    page: Page, operations: FakeOperations
) -> None:
    expect(page.get_by_test_id("camera")).to_have_attribute("data-serial", re.compile(r"\d+"))
    box = page.get_by_test_id("camera").bounding_box()
    assert box is not None
    page.get_by_test_id("camera").click(
        position={"x": 0.5 * box["width"], "y": 0.7 * box["height"]}
    )
    expect(page.get_by_test_id("zone-name")).to_have_value("Red floor")
    page.get_by_test_id("zone-finish").click()
    expect(page.get_by_test_id("zone")).to_have_count(1)
    assert operations.zones.stored[0].name == "Red floor"


def test_layers_theme_and_keys_are_one_press_away_and_a_tablet_shows_it_all(
    page: Page, operations: FakeOperations
) -> None:
    page.set_viewport_size({"width": 1024, "height": 768})
    await_map(page)
    assert page.evaluate(
        "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
    ) == [1024, 768]
    shot = page.get_by_test_id("map-canvas").screenshot()
    page.get_by_test_id("map-layers-menu").click()
    for layer in ("free", "inflation", "obstacle", "class-cup"):
        page.get_by_test_id(f"layer-{layer}").uncheck()
    # Another class with its number is another layer.
    operations.beware.edit("cup", {"name": "mug"})
    expect(page.get_by_test_id("layer-class-cup")).to_have_count(0)
    mug = page.locator("#map-layers li", has=page.get_by_test_id("layer-class-mug"))
    expect(mug).to_have_text("mug")
    expect(mug.get_by_label("Opacity of mug")).to_have_count(1)
    expect(mug.get_by_role("checkbox")).to_be_checked()
    page.get_by_test_id("map-layers-menu").click()
    assert page.get_by_test_id("map-canvas").screenshot() != shot
    theme = page.evaluate("document.documentElement.dataset.theme")
    page.get_by_test_id("map-canvas").focus()
    page.keyboard.press("d")
    assert page.evaluate("document.documentElement.dataset.theme") != theme
    page.keyboard.press("?")
    expect(page.get_by_test_id("help")).to_contain_text("stop, anywhere")
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("help")).to_be_hidden()


def test_the_legend_has_the_colours_of_the_map_in_either_theme(page: Page) -> None:
    await_map(page)
    entry = page.locator("#map-layers li", has=page.get_by_test_id("layer-free"))
    colours = set()
    for theme in ("dark", "light"):
        page.emulate_media(color_scheme="light" if theme == "light" else "dark")
        expect(page.locator("html")).to_have_attribute("data-theme", theme)
        shown = entry.locator(".swatch").evaluate("(s) => getComputedStyle(s).backgroundColor")
        colour = [int(part) for part in re.findall(r"\d+", shown)]

        def is_on_the_map(colour: list[int] = colour) -> bool:
            shot = Image.open(io.BytesIO(page.get_by_test_id("map-canvas").screenshot()))
            differs = np.abs(np.asarray(shot.convert("RGB")).astype(int) - colour).max(axis=2)
            return bool((differs <= 2).mean() > 0.1)

        eventually(page, is_on_the_map)
        colours.add(shown)
    assert len(colours) == 2


def test_the_arrow_of_the_robot_is_narrow_and_points_ahead(page: Page) -> None:
    await_map(page)
    assert page.evaluate(FRONT) == [True, True, False, False, False]


def test_the_hint_of_a_tool_leaves_the_scale_bar_free_and_the_points_are_below_their_name(
    page: Page, operations: FakeOperations
) -> None:
    operations.zones.add(ZoneDraft(name="Gap", polygon=((-1.0, -3.0), (1.0, -3.0), (1.0, -2.0))))
    await_map(page)
    page.get_by_test_id("zone-edit").click()
    hint = page.get_by_test_id("hint")
    expect(hint).to_contain_text("Enter saves")
    stage = page.locator(".stage").bounding_box()
    box = hint.bounding_box()
    assert stage is not None and box is not None
    widest = 2.5 * 60 + 5 + 14  # of the scale bar, with what is around it
    assert box["x"] + box["width"] <= stage["x"] + stage["width"] - widest
    field, points = (
        page.locator(part).bounding_box()
        for part in (".draft .field:has(textarea)", "#draft-corners")
    )
    assert field is not None and points is not None
    assert points["y"] - field["y"] < 24
