"""The page on which the network is taught: marking by mouse and keys, and the stop."""

from __future__ import annotations

import re
from collections.abc import Callable

import httpx
import numpy as np
import numpy.typing as npt
import pytest
from playwright.sync_api import BrowserContext, FloatRect, Page, Route, expect

from app.teaching.networks.versions import MODEL_NAME, write_version
from tests.app.teaching.scenes import BLOCK, HEIGHT, WIDTH
from tests.web.api.test_teaching import look
from tests.web.conftest import PASSWORD
from tests.web.fake_operations import FakeOperations
from tests.web.page.chromium import IS_TOPMOST, IS_WITHIN_VIEWPORT, eventually
from web.interface.teaching import Annotation, ClassFigures, NetworkVersion
from web.server import ConsoleServer

EXPORT = "/api/v1/teach/frames.zip"
ON_BLOCK = (30, 37)
"""Column and row of a pixel of the block."""


def opened(
    new_context: Callable[..., BrowserContext], server: ConsoleServer, width: int, height: int
) -> Page:
    """Return the page in a window of a size."""
    page = new_context(viewport={"width": width, "height": height}).new_page()
    page.goto(f"{server.url}/teach")
    return page


def click_pixel(page: Page, col: float, row: float) -> None:
    """Click the middle of a pixel of the image."""
    box = page.get_by_test_id("marks").bounding_box()
    assert box is not None
    scale = box["width"] / WIDTH
    page.mouse.click(box["x"] + (col + 0.5) * scale, box["y"] + (row + 0.5) * scale)


def marked(client: httpx.Client, name: str) -> npt.NDArray[np.bool_]:
    """Return the stored pixels of a class in the first frame."""
    stored = client.get("/api/v1/teach/frames/000001/labels").json()
    flat = np.repeat(stored["runs"][0::2], stored["runs"][1::2]).reshape(HEIGHT, WIDTH)
    names = stored["class_names"]
    return np.asarray(flat == names.index(name) + 1 if name in names else flat < 0)


@pytest.mark.long
def test_an_object_is_marked_by_mouse_and_keys_and_every_edit_is_saved(
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
) -> None:
    page = opened(new_context, server, 1440, 900)
    look(operations)
    expect(page.get_by_test_id("rollback")).to_be_disabled()
    expect(page.get_by_test_id("train")).to_be_disabled()
    page.get_by_test_id("capture").click()
    expect(page.get_by_test_id("frame-000001")).to_contain_text("not marked")
    page.get_by_test_id("capture").click()
    expect(page.locator(".toast")).to_contain_text("there already")
    page.get_by_test_id("new-class").fill("shoe")
    page.get_by_test_id("add-class").click()
    expect(page.get_by_test_id("class")).to_have_value("shoe")
    click_pixel(page, *ON_BLOCK)
    expected = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    expected[BLOCK] = True
    eventually(page, lambda: np.array_equal(marked(client, "shoe"), expected))
    expect(page.get_by_test_id("frame-000001")).to_contain_text("shoe")

    page.keyboard.press("e")
    expect(page.get_by_test_id("tool-eraser")).to_have_attribute("aria-checked", "true")
    click_pixel(page, *ON_BLOCK)
    eventually(page, lambda: 0 < marked(client, "shoe").sum() < expected.sum())
    page.keyboard.press("Control+z")
    eventually(page, lambda: np.array_equal(marked(client, "shoe"), expected))
    page.keyboard.press("Control+Shift+z")
    eventually(page, lambda: marked(client, "shoe").sum() < expected.sum())
    page.keyboard.press("b")
    click_pixel(page, *ON_BLOCK)
    eventually(page, lambda: np.array_equal(marked(client, "shoe"), expected))

    look(operations, 3.0, 60)
    page.get_by_test_id("capture").click()
    current = page.locator("[aria-current=true]")
    expect(current).to_have_attribute("data-testid", "frame-000002")
    page.keyboard.press("p")
    expect(current).to_have_attribute("data-testid", "frame-000001")
    page.get_by_test_id("train").click()
    expect(page.locator(".toast").last).to_contain_text("1 annotated frames show it")


def capture_two(client: httpx.Client, operations: FakeOperations) -> None:
    """Capture two images that differ, with a class to mark."""
    client.post("/api/v1/beware", json={"name": "shoe"})
    for x_m, brightness in ((1.0, 120), (3.0, 60)):
        look(operations, x_m, brightness)
        client.post("/api/v1/teach/frames")


def test_a_region_is_of_the_class_that_was_selected_when_it_was_clicked(
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
) -> None:
    capture_two(client, operations)
    page = opened(new_context, server, 1024, 768)
    expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")
    chosen = page.get_by_test_id("class")
    chosen.select_option("shoe")
    held: list[Route] = []
    page.route("**/region", lambda route: held.append(route))
    click_pixel(page, *ON_BLOCK)
    eventually(page, lambda: len(held) == 1)
    chosen.select_option("background")
    held[0].continue_()
    expect(page.get_by_test_id("frame-000001")).to_contain_text("shoe")
    assert marked(client, "shoe")[BLOCK].all()


def test_keys_belong_to_the_field_that_has_the_focus_and_a_stroke_to_its_image(
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
) -> None:
    capture_two(client, operations)
    page = opened(new_context, server, 1024, 768)
    current = page.locator("[aria-current=true]")
    expect(current).to_have_attribute("data-testid", "frame-000001")
    chosen = page.get_by_test_id("class")
    chosen.select_option("shoe")
    chosen.press("b")
    expect(page.get_by_test_id("tool-brush")).to_have_attribute("aria-checked", "true")
    expect(chosen).to_have_value("shoe")
    rehearsal = page.get_by_test_id("rehearsal")
    rehearsal.press("e")
    expect(page.get_by_test_id("tool-brush")).to_have_attribute("aria-checked", "true")
    rehearsal.press("Space")
    eventually(page, lambda: bool(operations.stops))

    chosen.focus()
    expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")
    box = page.get_by_test_id("marks").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 40, box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + 90, box["y"] + 60)
    page.keyboard.press("n")
    expect(current).to_have_attribute("data-testid", "frame-000002")
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.up()
    expect(page.get_by_test_id("frame-000001")).to_contain_text("shoe")
    expect(page.get_by_test_id("frame-000002")).to_contain_text("not marked")

    delete = page.get_by_test_id("delete-frame")
    delete.click()
    expect(delete).to_have_text("Really delete?")
    assert len(client.get("/api/v1/teach/frames").json()["frames"]) == 2
    delete.click()
    expect(current).to_have_attribute("data-testid", "frame-000001")
    assert len(client.get("/api/v1/teach/frames").json()["frames"]) == 1


def test_marks_that_were_not_saved_are_kept_until_they_are(
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
) -> None:
    capture_two(client, operations)
    page = opened(new_context, server, 1024, 768)
    current = page.locator("[aria-current=true]")
    page.get_by_test_id("class").select_option("shoe")
    page.keyboard.press("b")
    expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")
    page.route("**/labels", lambda route: route.abort())
    click_pixel(page, *ON_BLOCK)
    expect(page.get_by_test_id("saved")).to_have_text("not saved")
    page.keyboard.press("n")
    expect(page.locator(".toast")).to_contain_text("does not answer")
    expect(current).to_have_attribute("data-testid", "frame-000001")
    assert not marked(client, "shoe").any()
    page.unroute("**/labels")
    eventually(page, lambda: bool(marked(client, "shoe").any()))

    # A stroke that is drawn while the one before is saved on the way to the next image.
    first = marked(client, "shoe").sum()
    held: list[Route] = []
    page.route("**/labels", lambda route: route.continue_() if held else held.append(route))
    click_pixel(page, 10, 10)
    page.keyboard.press("n")
    eventually(page, lambda: len(held) == 1)
    click_pixel(page, 50, 10)
    held[0].continue_()
    expect(current).to_have_attribute("data-testid", "frame-000002")
    both = marked(client, "shoe")
    assert both[10, 10] and both[10, 50] and both.sum() > first

    page.keyboard.press("p")
    expect(current).to_have_attribute("data-testid", "frame-000001")
    expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")
    click_pixel(page, 50, 40)
    page.keyboard.press("Meta+z")
    click_pixel(page, 30, 40)
    page.goto("about:blank")
    eventually(page, lambda: bool(marked(client, "shoe")[40, 30]))
    assert not marked(client, "shoe")[40, 50]


def test_two_pages_do_not_overwrite_the_marks_of_each_other(
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
) -> None:
    capture_two(client, operations)
    one, other = (opened(new_context, server, 1024, 768) for _ in range(2))
    for page in (one, other):
        page.get_by_test_id("class").select_option("shoe")
        page.keyboard.press("b")
        expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")
    click_pixel(one, 10, 10)
    expect(one.get_by_test_id("saved")).to_have_text("saved")
    eventually(other, lambda: shows(other, 10, 10))
    expect(other.get_by_test_id("undo")).to_be_disabled()
    click_pixel(other, 50, 10)
    expect(other.get_by_test_id("saved")).to_have_text("saved")
    assert marked(client, "shoe")[10, 10] and marked(client, "shoe")[10, 50]

    eventually(one, lambda: shows(one, 50, 10))
    one.route("**/teach/frames", lambda route: route.abort())  # it learns of no other marks
    click_pixel(other, 30, 40)
    eventually(other, lambda: bool(marked(client, "shoe")[40, 30]))
    click_pixel(one, 70, 40)
    expect(one.locator(".toast")).to_contain_text("marked elsewhere meanwhile")
    assert shows(one, 30, 40) and not shows(one, 70, 40)
    assert not marked(client, "shoe")[40, 70]
    click_pixel(one, 70, 40)
    eventually(one, lambda: bool(marked(client, "shoe")[40, 70]))
    assert marked(client, "shoe")[40, 30]


def shows(page: Page, col: int, row: int) -> bool:
    """Return whether the page shows a mark in a pixel."""
    alpha = "([x, y]) => marks.getContext('2d').getImageData(x, y, 1, 1).data[3]"
    return bool(page.evaluate(alpha, [col, row]))


def test_marks_whose_answer_was_lost_are_no_conflict_with_those_that_follow(
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
) -> None:
    capture_two(client, operations)
    page = opened(new_context, server, 1024, 768)
    page.get_by_test_id("class").select_option("shoe")
    page.keyboard.press("b")
    expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")

    def lose(route: Route) -> None:
        if route.request.method == "PUT":
            route.fetch()
        route.abort()

    page.route("**/labels", lose)
    click_pixel(page, 10, 10)
    expect(page.get_by_test_id("saved")).to_have_text("not saved")
    assert marked(client, "shoe")[10, 10]
    page.unroute("**/labels")
    click_pixel(page, 50, 10)
    expect(page.get_by_test_id("saved")).to_have_text("saved")
    assert marked(client, "shoe")[10, 10] and marked(client, "shoe")[10, 50]


def test_marks_that_are_refused_are_kept_and_those_of_a_deleted_image_are_not(
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
) -> None:
    capture_two(client, operations)
    page = opened(new_context, server, 1024, 768)
    current = page.locator("[aria-current=true]")
    page.get_by_test_id("class").select_option("shoe")
    page.keyboard.press("b")
    expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")
    said = {"error": {"code": "bad_value", "message": "no such class", "where": None}}
    page.route("**/labels", lambda route: route.fulfill(status=422, json=said))
    click_pixel(page, *ON_BLOCK)
    expect(page.get_by_test_id("saved")).to_have_text("not saved")
    page.keyboard.press("n")
    expect(page.locator(".toast")).to_contain_text("No such class")
    expect(current).to_have_attribute("data-testid", "frame-000001")
    page.unroute("**/labels")
    page.keyboard.press("n")
    expect(current).to_have_attribute("data-testid", "frame-000002")
    assert marked(client, "shoe").any()

    expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")
    page.route(
        "**/labels",
        lambda route: (
            route.fulfill(status=413, json=said)
            if route.request.method == "PUT"
            else route.continue_()
        ),
    )
    click_pixel(page, *ON_BLOCK)
    expect(page.get_by_test_id("saved")).to_have_text("not saved")
    page.get_by_test_id("delete-frame").click()
    page.get_by_test_id("delete-frame").click()
    expect(current).to_have_attribute("data-testid", "frame-000001")


def test_a_network_that_does_not_find_its_class_is_no_success(
    new_context: Callable[..., BrowserContext],
    server: ConsoleServer,
    client: httpx.Client,
    operations: FakeOperations,
) -> None:
    figures = (
        ClassFigures(
            name="cup", pixels=9, old=0.5, new=0.3, change=(-0.3, -0.1), images="rendered"
        ),
        ClassFigures(name="shoe", pixels=9, new=0.02, images="captured"),
    )
    folder = operations.teaching.networks.versions.folder / "taught 1"
    folder.mkdir(parents=True)
    (folder / MODEL_NAME).write_bytes(b"weights")
    write_version(
        folder,
        NetworkVersion(
            name="taught 1",
            origin="training",
            sha256="0" * 64,
            class_names=("background", "cup", "shoe"),
            taught=("shoe",),
            figures=figures,
            not_found=("shoe",),
        ),
    )
    page = opened(new_context, server, 1440, 900)
    expect(page.get_by_test_id("missed-taught 1")).to_contain_text("does not find shoe yet")
    expect(page.get_by_test_id("networks")).to_contain_text("Finds less well than before: cup")
    use = page.get_by_test_id("use-taught 1")
    expect(use).to_have_text("Use anyway")
    refused = client.post("/api/v1/teach/networks/taught 1/use")
    assert refused.status_code == 409 and "mark more images" in refused.text
    with page.expect_request("**/use?force=true"):
        use.click()


def overlap(one: FloatRect, other: FloatRect | None) -> bool:
    """Return whether two boxes of the page share a pixel."""
    return other is not None and (
        one["x"] + 1 < other["x"] + other["width"]
        and other["x"] + 1 < one["x"] + one["width"]
        and one["y"] + 1 < other["y"] + other["height"]
        and other["y"] + 1 < one["y"] + one["height"]
    )


def test_the_stop_is_visible_and_works_in_every_window(
    new_context: Callable[..., BrowserContext], server: ConsoleServer, operations: FakeOperations
) -> None:
    for width, height in ((1440, 900), (1024, 768), (390, 844)):
        page = opened(new_context, server, width, height)
        expect(page.get_by_test_id("exchange")).not_to_be_empty()
        stop = page.get_by_test_id("stop")
        expect(stop).to_be_visible()
        assert stop.evaluate(IS_TOPMOST) and stop.evaluate(IS_WITHIN_VIEWPORT)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        boxes = [card.bounding_box() for card in page.locator(".card").all()]
        for place, one in enumerate(boxes):
            assert one is not None and not any(overlap(one, other) for other in boxes[:place])
        export = page.get_by_test_id("frames-export")
        export.scroll_into_view_if_needed()
        assert export.evaluate(IS_TOPMOST)
        train = page.get_by_test_id("train")
        train.scroll_into_view_if_needed()
        assert stop.evaluate(IS_WITHIN_VIEWPORT) and train.evaluate(IS_WITHIN_VIEWPORT)
        operations.stops.clear()
        stop.click()
        eventually(page, lambda: bool(operations.stops))
        operations.stops.clear()
        page.keyboard.press("Space")
        eventually(page, lambda: bool(operations.stops))
        page.close()
    expect_words = opened(new_context, server, 390, 844).locator(".small-screen")
    expect(expect_words).to_contain_text("larger screen")


def test_a_stop_without_a_log_in_says_so_and_leads_to_it(
    new_context: Callable[..., BrowserContext], locked: ConsoleServer, operations: FakeOperations
) -> None:
    page = opened(new_context, locked, 1024, 768)

    def log_in() -> None:
        page.get_by_test_id("login-name").fill("operator")
        page.get_by_test_id("login-password").fill(PASSWORD)
        page.get_by_test_id("log-in").click()
        expect(page.get_by_test_id("connection")).to_have_text("live")
        page.goto(f"{locked.url}/teach")
        expect(page.get_by_test_id("exchange")).not_to_be_empty()

    log_in()
    page.context.clear_cookies()
    page.get_by_test_id("stop").click()
    toasts = page.locator("#toasts")
    expect(toasts).to_contain_text("THE STOP WAS REFUSED")
    # Other messages, of which the oldest ones go, leave it there.
    page.evaluate(
        """async () => {
            const { notify } = await import("/page/core/toasts.js");
            for (let i = 0; i < 6; i += 1) notify(`message ${i}`);
        }"""
    )
    expect(toasts.locator(".toast")).to_have_count(4)
    expect(toasts).to_contain_text("Message 5")
    expect(toasts).not_to_contain_text("The robot is stopped")
    toasts.get_by_test_id("toast-action").click()
    log_in()
    assert operations.stops == []
    page.get_by_test_id("stop").click()
    expect(toasts).to_contain_text("The robot is stopped")
    assert operations.stops == ["operator (console button)"]


def test_the_export_says_what_it_holds_and_is_not_offered_to_viewers(
    new_context: Callable[..., BrowserContext], locked: ConsoleServer, operations: FakeOperations
) -> None:
    def seen_by(name: str) -> Page:
        page = opened(new_context, locked, 1440, 900)
        page.get_by_test_id("login-name").fill(name)
        page.get_by_test_id("login-password").fill(PASSWORD)
        page.get_by_test_id("log-in").click()
        expect(page.get_by_test_id("connection")).to_have_text("live")
        page.goto(f"{locked.url}/teach")
        return page

    page, watched = seen_by("operator"), seen_by("viewer")
    export = page.get_by_test_id("frames-export")
    expect(export).to_have_attribute("title", "No image yet")
    expect(export).not_to_have_attribute("href", EXPORT)
    look(operations)
    captured = operations.teaching.frames.capture()
    assert captured is not None
    expect(export).to_have_attribute("href", EXPORT)
    expect(export).to_have_attribute("title", "All images, with no class: nothing is marked yet")
    labels = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    labels[ON_BLOCK[1], ON_BLOCK[0]] = 1
    operations.teaching.frames.annotate(
        captured.id, Annotation(class_names=("book",), labels=labels)
    )
    expect(export).to_have_attribute("title", re.compile("marked in them: book$"))
    of_viewer = watched.get_by_test_id("frames-export")
    expect(of_viewer).to_have_attribute("title", "Viewers cannot export the images")
    expect(of_viewer).not_to_have_attribute("href", EXPORT)


def test_the_beware_list_leads_to_the_page(page: Page) -> None:
    link = page.get_by_test_id("teach-link")
    expect(link).to_have_attribute("href", "/teach")
