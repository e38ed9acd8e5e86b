"""The pictures of the READMEs: the real console in the simulated office, driven as by hand."""

from __future__ import annotations

import io
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, expect, sync_playwright

from app.console.application import ConsoleOptions, console
from app.runtime.start.segmenter_choice import SegmenterChoice
from tests.screenshots.pointer import SHOW_POINTER
from tests.web.page.chromium import ARGUMENTS, CHROMIUM, await_map, middle_of, on_page

FOLDER = Path(__file__).parents[2] / "web"
ANIMATION = "zone.webp"
SIZE = (1440, 900)
ANIMATION_SIZE = (960, 600)
LENGTH_S = 11.0
"""Length of the animated picture."""
FRAME_S = 1 / 6
PATIENCE_MS = 120_000
GOALS = ("-7.2, -6.8", "-1, 0")
ZONE = ((-9.4, -7.1), (-8.8, -7.1), (-8.8, -5.8), (-9.4, -5.8))
"""Corners of a zone across the way from the start to the first goal, metres."""
ZONE_AHEAD = ((-4.4, -0.4), (-3.6, -0.4), (-3.6, 0.5), (-4.4, 0.5))
"""Corners of a zone across the way to the second goal."""


@dataclass
class Film:
    """Frames of a page with the times at which they were taken."""

    page: Page
    shots: list[bytes] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)

    def take(self) -> None:
        """Take a frame, not before it is due."""
        if self.times_s:
            due_s = self.times_s[-1] + FRAME_S - time.monotonic()
            self.page.wait_for_timeout(max(1000 * due_s, 0.0))
        self.times_s.append(time.monotonic())
        self.shots.append(self.page.screenshot(type="jpeg", quality=92))

    def length_s(self) -> float:
        """Return the time since the first frame."""
        return time.monotonic() - self.times_s[0]

    def save(self, file: Path) -> None:
        """Write the frames; each is shown for as long as it was on the screen."""
        ends_s = [*self.times_s[1:], self.times_s[-1] + 1.0]
        durations = [round(1000 * (b - a)) for a, b in zip(self.times_s, ends_s, strict=True)]
        # Not while the robot drives: the console needs the processor more.
        first, *others = (
            Image.open(io.BytesIO(shot)).resize(ANIMATION_SIZE, Image.Resampling.LANCZOS)
            for shot in self.shots
        )
        first.save(
            file, save_all=True, append_images=others, duration=durations, loop=0, quality=60
        )


def take_pictures(folder: Path = FOLDER) -> list[Path]:
    """Write the animated picture and the four screenshots; returns the files."""
    with tempfile.TemporaryDirectory() as data, sync_playwright() as playwright:
        options = ConsoleOptions(
            scenario="office", port=0, data=Path(data), choice=SegmenterChoice(kind="colour")
        )
        with console(options) as running:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            page = browser.new_page(
                viewport={"width": SIZE[0], "height": SIZE[1]}, color_scheme="dark"
            )
            page.set_default_timeout(PATIENCE_MS)
            expect.set_options(timeout=PATIENCE_MS)
            page.goto(f"{running.url}/#map")
            expect(page.get_by_test_id("connection")).to_have_text("live")
            await_map(page)
            files = [_film_a_zone(page, folder / ANIMATION), *_screenshots(page, folder)]
            browser.close()
    return files


def _film_a_zone(page: Page, file: Path) -> Path:
    """Draw the corners of a zone, start the mission, and finish the zone while the robot drives
    towards it, so that its path bends."""
    for number, goal in enumerate(GOALS, start=1):
        page.get_by_test_id("goal-input").fill(goal)
        page.get_by_test_id("goal-add").click()
        expect(page.get_by_test_id("goal")).to_have_count(number)
    page.evaluate(SHOW_POINTER)
    at = middle_of(page.get_by_test_id("mode-draw"))
    page.mouse.click(*at)
    film = Film(page)
    for corner in ZONE:
        at = _glide(film, at, on_page(page, *corner))
        page.mouse.click(*at)
    at = _glide(film, at, middle_of(page.get_by_test_id("start")))
    page.mouse.click(*at)
    at = _glide(film, at, middle_of(page.get_by_test_id("zone-finish")))
    expect(page.get_by_test_id("state-badge")).to_contain_text("DRIVING")
    film.take()
    page.mouse.click(*at)
    while film.length_s() < LENGTH_S:
        film.take()
    film.save(file)
    return file


def _glide(
    film: Film, start: tuple[float, float], end: tuple[float, float], frames: int = 3
) -> tuple[float, float]:
    """Move the pointer along a line, a frame at each step; returns where it ends."""
    for step in range(1, frames + 1):
        share = step / frames
        film.page.mouse.move(*(a + share * (b - a) for a, b in zip(start, end, strict=True)))
        film.take()
    return end


def _screenshots(page: Page, folder: Path) -> list[Path]:
    """Take the map, why the path runs as it does, the layers, and the event log in the light
    theme."""
    page.evaluate("document.getElementById('drawn-pointer').remove()")
    page.get_by_test_id("mode-navigate").click()
    files = [_shot(page, folder / "screenshot.jpg")]
    page.get_by_test_id("mode-draw").click()
    for corner in ZONE_AHEAD:
        page.mouse.click(*on_page(page, *corner))
    page.get_by_test_id("zone-finish").click()
    page.get_by_test_id("mode-navigate").click()
    page.get_by_test_id("tab-why").click()
    expect(page.get_by_test_id("why-rule").filter(has_text="Zone 2")).to_be_visible()
    page.get_by_test_id("fit").click()
    files.append(_shot(page, folder / "screenshot-why.jpg"))
    page.get_by_test_id("tab-why").click()
    page.get_by_test_id("map-layers-menu").click()
    files.append(_shot(page, folder / "screenshot-layers.jpg"))
    page.keyboard.press("Escape")
    page.get_by_test_id("tab-log").click()
    page.emulate_media(color_scheme="light")
    files.append(_shot(page, folder / "screenshot-log.jpg"))
    return files


def _shot(page: Page, file: Path) -> Path:
    page.wait_for_timeout(1500)
    shot = Image.open(io.BytesIO(page.screenshot(caret="hide")))
    shot.convert("RGB").save(file, quality=82, optimize=True, progressive=True)
    return file
