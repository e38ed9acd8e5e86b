"""The 3D view as a hand and an eye meet it: a goal with a heading by drag, own layers, the robot
followed, and a background of the theme."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable
from typing import get_args

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import BrowserContext, Locator, Page, expect

from navcore.mission.zone import MAX_CORNERS
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import eventually, on_page
from web.server import ConsoleServer
from web.viewer.messages import Draft, Mode

PLACES = """() => {
  const root = document.getElementById("viewer").contentDocument.getElementById("root");
  const open = [root[Object.keys(root).find((name) => name.startsWith("__reactContainer$"))]];
  while (open.length) {
    const fiber = open.pop();
    const state = fiber.memoizedProps?.value?.mutable?.current;
    if (state?.nodeRefFromName && state.scene) return Object.fromEntries(
      Object.entries(state.nodePoseData).filter(([name]) => state.nodeRefFromName[name])
        .map(([name, { position }]) => [name, state.nodeRefFromName[name].position.toArray()
          .every((value, i) => Math.abs(value - position[i]) < 1e-3)]));
    for (const next of [fiber.sibling, fiber.child]) if (next) open.push(next);
  }
}"""
"""JavaScript: whether each node of viser's page is drawn where the console has placed it."""

NOTE_SENT = """() => {
  const send = WebSocket.prototype.send;
  window.noteSent = "";
  WebSocket.prototype.send = function (data) {
    const message = typeof data === "string" ? JSON.parse(data) : {};
    if (message.type === "draft") window.noteSent = message.note;
    return send.call(this, data);
  };
}"""
"""JavaScript: keep the note of the newest draft that the page sends to the 3D view."""


def open_3d(page: Page) -> tuple[float, float]:
    """Show the 3D view from above; returns the pixel in its middle."""
    page.get_by_test_id("view-3d").click()
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")
    expect(page.locator("body")).to_have_attribute("data-drawn", "yes", timeout=60_000)
    page.get_by_test_id("look-top").click()
    box = page.get_by_test_id("view-3d-frame").bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.mark.long
def test_what_the_3d_view_shows_is_where_it_belongs(page: Page, operations: FakeOperations) -> None:
    operations.goals.add(2.0, 1.0)
    page.get_by_test_id("view-3d").click()
    expect(page.locator("body")).to_have_attribute("data-drawn", "yes", timeout=60_000)
    eventually(page, lambda: bool(page.evaluate(PLACES)["/floor/0_0"]))
    # Nothing changes any more, and nothing asks for a frame.
    eventually(page, lambda: all(page.evaluate(PLACES).values()))


@pytest.mark.long
def test_a_goal_gets_its_heading_by_drag_in_the_3d_view(
    page: Page, operations: FakeOperations
) -> None:
    x, y = open_3d(page)
    x, y = x - 80, y + 110  # free floor
    page.evaluate(NOTE_SENT)
    page.get_by_test_id("mode-goal").click()
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url))
    page.mouse.move(x, y)
    eventually(page, lambda: any(url.endswith("/preview") for url in sent))
    # Beside the goal the view says how long the path is, and forgets it with the goal.
    eventually(page, lambda: " m" in page.evaluate("noteSent"))
    page.mouse.down()
    page.mouse.move(x + 10, y - 40, steps=4)
    page.mouse.move(x + 2, y - 90, steps=4)
    page.mouse.up()
    expect(page.get_by_test_id("goal")).to_have_count(1)
    eventually(page, lambda: page.evaluate("noteSent") == "")
    (goal,) = operations.state().queue
    assert goal.yaw_rad is not None and abs(goal.yaw_rad - math.pi / 2) < 0.2
    # A click without a drag has no heading.
    page.mouse.click(x + 50, y + 20)
    expect(page.get_by_test_id("goal")).to_have_count(2)
    other = operations.state().queue[1]
    assert other.yaw_rad is None and other.x_m > goal.x_m and other.y_m < goal.y_m
    # A drag may end beside the view.
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 60, steps=4)
    page.mouse.move(x, 2)
    page.mouse.up()
    expect(page.get_by_test_id("goal")).to_have_count(3)
    assert operations.state().queue[2].yaw_rad is not None


@pytest.mark.long
def test_layers_and_following_are_remembered_by_the_browser(page: Page) -> None:
    open_3d(page)
    page.get_by_test_id("layers").click()
    page.get_by_test_id("layer-3d-floor").click()
    page.keyboard.press("Escape")
    follow = page.get_by_test_id("look-follow")
    expect(follow).to_have_attribute("aria-pressed", "false")
    follow.click()
    expect(follow).to_have_attribute("aria-pressed", "true")
    page.reload()
    expect(follow).to_have_attribute("aria-pressed", "true")
    expect(page.get_by_test_id("layer-3d-floor")).not_to_be_checked()
    expect(page.get_by_test_id("layer-3d-zones")).to_be_checked()


@pytest.mark.long
def test_the_background_is_that_of_the_theme_also_when_it_changes(
    new_context: Callable[..., BrowserContext], server: ConsoleServer
) -> None:
    context = new_context(viewport={"width": 1280, "height": 720}, color_scheme="dark")
    page = context.new_page()
    page.goto(f"{server.url}/#3d")
    expect(page.locator("body")).to_have_attribute("data-viewer", "live")

    def is_behind() -> bool:
        stage = page.evaluate(
            "getComputedStyle(document.documentElement).getPropertyValue('--stage')"
        )
        wanted = np.frombuffer(bytes.fromhex(stage.strip()[1:]), dtype=np.uint8).astype(int)
        shot = page.locator(".stage").screenshot()
        pixels = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)
        # From the south, the sky is in the upper corners.
        corners = [pixels[8, 8], pixels[8, -8]]
        return bool(np.abs(np.array(corners) - wanted).max() <= 3)

    eventually(page, is_behind)
    page.emulate_media(color_scheme="light")
    expect(page.locator("html")).to_have_attribute("data-theme", "light")
    eventually(page, is_behind)


SCENE = """async () => {
  const material = (transparent, opacity) => ({ transparent, opacity, blending: 1, blendAlpha: 0 });
  const made = { points: material(false, 1), floor: material(true, 0.5), path: material(false, 1) };
  const node = (one) => ({ traverse: (act) => [{}, { material: one }].forEach(act) });
  const scene = {};
  const nodeRefFromName = {
    "/cloud": node(made.points), "/floor": node(made.floor), "/path": node(made.path),
  };
  const state = { memoizedProps: { value: { mutable: { current: { scene, nodeRefFromName } } } } };
  const root = document.body.appendChild(document.createElement("div"));
  document.getElementById("root")?.remove();
  root.id = "root";
  root.__reactContainer$test = { child: { sibling: state } };
  await new Promise((onload) => {
    document.head.append(Object.assign(document.createElement("script"),
      { src: "/page/viewer/opacity.js", onload }));
  });
  const drawn = (detail) => {
    window.dispatchEvent(new CustomEvent("fade", { detail }));
    window.prepareFrame();
    scene.onBeforeRender();
    return structuredClone(made);
  };
  return [drawn({ cloud: 0.3, floor: 0.4 }), drawn({ floor: 0.4 }), drawn({})];
}"""
"""JavaScript: the materials of a scene as viser's page keeps it, after three changes."""


def test_opacity_is_set_on_what_a_layer_draws_and_taken_back(page: Page) -> None:
    both, floor, none = page.evaluate(SCENE)
    own = none["points"]
    assert (own["transparent"], own["opacity"], own["blending"]) == (False, 1, 1)
    # Points have no opacity of their own: they are mixed with what is behind them.
    assert (both["points"]["transparent"], both["points"]["blendAlpha"]) == (True, 0.3)
    assert both["points"]["blending"] == 5 and floor["points"] == own
    assert [one["floor"]["opacity"] for one in (both, floor, none)] == [0.2, 0.2, 0.5]
    untouched = {"transparent": False, "opacity": 1, "blending": 1, "blendAlpha": 0}
    assert both["path"] == floor["path"] == none["path"] == untouched


@pytest.mark.long
def test_a_layer_is_faded_in_the_page_of_the_operator_who_fades_it_alone(
    page: Page, new_context: Callable[..., BrowserContext], server: ConsoleServer
) -> None:
    def show_3d(shown: Page) -> Locator:
        """Show the 3D view and its layers; returns the root of viser's page."""
        shown.get_by_test_id("view-3d").click()
        expect(shown.locator("body")).to_have_attribute("data-viewer", "live", timeout=60_000)
        shown.evaluate("document.getElementById('layers-3d').showPopover()")
        return shown.frame_locator("#viewer").locator("html")

    viser = show_3d(page)
    expect(viser).to_have_attribute("data-faded", "", timeout=60_000)
    opacity = page.get_by_test_id("opacity-3d-floor")
    opacity.fill("10")
    expect(viser).to_have_attribute("data-faded", "floor", timeout=60_000)
    # The first console is still there while another one opens, which gets the layer as it is.
    other = new_context().new_page()
    other.goto(f"{server.url}/#map")
    of_other = show_3d(other)
    expect(of_other).to_have_attribute("data-faded", "", timeout=60_000)
    expect(viser).to_have_attribute("data-faded", "floor")
    other.close()
    opacity.fill("100")
    expect(viser).to_have_attribute("data-faded", "", timeout=60_000)


def test_the_view_is_told_only_of_modes_that_it_knows(page: Page) -> None:
    told: list[str] = []

    def note(frame: str | bytes) -> None:
        message = json.loads(frame)
        if message["type"] == "draft":
            told.append(message["mode"])

    page.on(
        "websocket", lambda link: link.on("framesent", note) if "/viewer/" in link.url else None
    )
    page.reload()
    eventually(page, lambda: told == ["navigate"])
    page.get_by_test_id("mode-draw").click()
    page.get_by_test_id("sites-button").click()
    page.get_by_test_id("dock-set").click()  # asks for a point of the map
    expect(page.get_by_test_id("hint")).to_contain_text("Click the middle of the robot")
    eventually(page, lambda: told[-2:] == ["draw", "navigate"])
    assert set(told) <= set(get_args(Mode))


def test_a_draft_with_too_many_corners_does_not_end_the_link_to_the_view(page: Page) -> None:
    told: list[str | bytes] = []
    page.on(
        "websocket",
        lambda link: (
            link.on("framesent", lambda sent: told.append(sent)) if "/viewer/" in link.url else None
        ),
    )
    page.reload()
    eventually(page, lambda: len(told) > 0)
    page.evaluate(
        """async () => {
            const { changed, draft, setTool } = await import("/page/zones/draft.js");
            setTool("corridor");
            draft.corners = Array.from({ length: 1500 }, (_, i) => [i / 100, (i % 2) / 10]);
            changed();
        }"""
    )
    eventually(page, lambda: len(Draft.model_validate_json(told[-1]).corners) == MAX_CORNERS)


def test_freehand_is_drawn_on_the_map(page: Page) -> None:
    page.get_by_test_id("view-3d").click()
    page.get_by_test_id("mode-draw").click()
    expect(page.get_by_test_id("view-3d")).to_have_attribute("aria-selected", "true")
    page.get_by_test_id("zone-tool").select_option("free")
    expect(page.get_by_test_id("view-map")).to_have_attribute("aria-selected", "true")
    x, y = on_page(page, -3.0, 4.0)
    page.mouse.move(x, y)
    page.mouse.down()
    for right, down in ((60, 0), (60, 60), (0, 60), (0, 2)):
        page.mouse.move(x + right, y + down, steps=4)
    page.mouse.up()
    expect(page.get_by_test_id("draft-note")).to_contain_text("corners")
