"""The pipeline of the paper's figure 3 in a running simulator: frames are annotated, a class that
the network never knew is taught, the network is exchanged without a restart, and the robot drives
round what it would have driven over. And a training is cancelled and resumed in the page.

Minutes, as a training has the lowest priority. What is learned does not depend on the speed of the
machine: the frames are those of a simulator that is stepped, from given poses, and are uploaded;
the seed of the training is given. The parts of the pipeline, and all of it but page and drive, are
tested in `tests/app/teaching`.
"""

from __future__ import annotations

import dataclasses
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
import shapely
from playwright.sync_api import Page, expect, sync_playwright

from app.console.application import ConsoleOptions, RunningConsole, console
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.teaching.frames.frame_archive import exported
from app.teaching.frames.frame_store import FrameStore
from navcore.perception.esanet.inference.network_file import SHIPPED
from navcore.perception.esanet.network.preprocess import Size
from navcore.perception.esanet.weights import weights_file
from tests.app.teaching.shoe_room import (
    SHOE,
    VIEWPOINTS,
    annotated_frames,
    frames_of_the_shoe,
    room_file,
    shoe_in,
)
from tests.system.conftest import state_when
from tests.web.page.chromium import ARGUMENTS, CHROMIUM, NEEDS_BROWSER

pytestmark = [
    NEEDS_BROWSER,
    pytest.mark.long,
    pytest.mark.timeout(3600),
]

PATIENCE_S = 240.0
TWO_POINTS = re.compile(r"^[\d.]+,[\d.]+ [\d.]+,[\d.]+")
"""A curve of at least two points."""
TRAINING_S = 900.0
"""A training has the lowest priority: beside other work it takes long."""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped network at a quarter of its working size."""
    shipped = weights_file.load(SHIPPED)
    path = tmp_path_factory.mktemp("weights") / "small.safetensors"
    card = dataclasses.replace(shipped.card, size=Size(height=256, width=416), ranges=None)
    weights_file.save(shipped.network, card, path, half=True)
    return path


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a room with a shoe between start and goal."""
    return room_file(tmp_path_factory.mktemp("world"))


@pytest.fixture
def frames(tmp_path: Path, world: Path) -> FrameStore:
    """Frames of the shoe from given poses."""
    return frames_of_the_shoe(tmp_path / "frames", world)


@pytest.fixture
def shoe_room(tmp_path: Path, small: Path, world: Path) -> Iterator[RunningConsole]:
    """A console in the room with the shoe."""
    choice = SegmenterChoice(kind="network", weights=small, engine="torch f32", live=True)
    options = ConsoleOptions(scenario=str(world), port=0, data=tmp_path / "shoe", choice=choice)
    with console(options) as started:
        yield started


def eventually(holds: Callable[[], bool], patience_s: float = PATIENCE_S) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + patience_s
    while not holds():
        assert time.monotonic() < deadline, "it never happened"
        time.sleep(0.3)


def add(program: httpx.Client, frames: FrameStore) -> int:
    """Upload frames and return how many were added."""
    with exported(frames) as file:
        answer = program.post("/api/v1/teach/frames.zip", content=file.read())
    return int(answer.json()["added"])


def off_the_line_m(program: httpx.Client) -> float:
    """Return how far a path to the other end of the room passes the shoe; NaN without one."""
    preview = program.post("/api/v1/preview", json={"goal": {"x_m": 2.2, "y_m": 0.0}})
    path = preview.json()["path"] if preview.is_success else []
    if len(path) < 2:
        return float("nan")
    return float(shapely.LineString(path).distance(shapely.Point(SHOE)))


def shoe_at(program: httpx.Client, frame_id: str) -> tuple[int, int] | None:
    """Return row and column of the middle of the shoe in a frame; None where it does not show
    it."""
    data = program.get(f"/api/v1/teach/frames/{frame_id}.png").content
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB)
    assert image is not None
    return shoe_in(np.asarray(image, dtype=np.uint8))


def annotate(page: Page, frame_id: str, at: tuple[int, int]) -> None:
    """Annotate the shoe in a frame by one click of the mouse."""
    page.get_by_test_id(f"frame-{frame_id}").click()
    expect(page.get_by_test_id(f"frame-{frame_id}")).to_have_attribute("aria-current", "true")
    expect(page.get_by_test_id("canvas")).to_have_attribute("aria-busy", "false")
    box = page.get_by_test_id("marks").bounding_box()
    assert box is not None
    scale = box["width"] / 424
    page.mouse.click(box["x"] + (at[1] + 0.5) * scale, box["y"] + (at[0] + 0.5) * scale)
    expect(page.get_by_test_id(f"frame-{frame_id}")).to_contain_text("shoe")


def finished(run: dict[str, Any] | None) -> bool:
    """Return whether a training has ended; fails if it has failed."""
    if run is None:
        return False  # the request is on its way
    assert run["phase"] != "failed", run
    return bool(run["phase"] == "done")


@pytest.fixture
def page(shoe_room: RunningConsole) -> Iterator[Page]:
    """The page on which a class is taught; the test fails when it reports an error."""
    expect.set_options(timeout=PATIENCE_S * 1000)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        opened = chromium.new_page(viewport={"width": 1440, "height": 900})
        opened.set_default_timeout(PATIENCE_S * 1000)
        errors: list[str] = []
        opened.on("pageerror", lambda error: errors.append(str(error)))
        opened.goto(f"{shoe_room.url}/teach")
        yield opened
        chromium.close()
        assert not errors


def test_a_class_is_taught_and_avoided(
    shoe_room: RunningConsole, page: Page, frames: FrameStore
) -> None:
    with httpx.Client(base_url=shoe_room.url, trust_env=False, timeout=PATIENCE_S) as program:
        post = program.post
        # With the network of the start it would drive over the shoe, which is on the list already.
        post("/api/v1/beware", json={"name": "shoe", "margin_m": 0.1})
        eventually(lambda: off_the_line_m(program) < 0.1)
        assert add(program, frames) == len(VIEWPOINTS)
        page.reload()

        def stored() -> list[dict[str, Any]]:
            return list(program.get("/api/v1/teach/frames").json()["frames"])

        shown = {one["id"]: at for one in stored() if (at := shoe_at(program, one["id"]))}
        assert len(shown) == len(VIEWPOINTS), (
            f"the shoe is in {len(shown)} of {len(stored())} frames"
        )
        page.get_by_test_id("capture").click()
        eventually(lambda: len(stored()) == len(VIEWPOINTS) + 1)
        page.get_by_test_id("class").select_option("shoe")
        page.get_by_test_id("rehearsal").fill("16")
        chosen = list(shown.items())
        for frame_id, at in chosen[:2]:
            annotate(page, frame_id, at)
        page.get_by_test_id("train").click()
        expect(page.locator(".toast").last).to_contain_text("at least 3 are needed")
        for frame_id, at in chosen[2:]:
            annotate(page, frame_id, at)
        none = post("/api/v1/teach/training", json={"class_names": ["cup"]})
        assert none.status_code == 409 and "no pixel" in none.text

        page.get_by_test_id("train").click()
        eventually(
            lambda: finished(program.get("/api/v1/teach/training").json()["run"]), TRAINING_S
        )
        networks = program.get("/api/v1/teach/networks").json()
        taught = networks["versions"][-1]
        figures = {one["name"]: one for one in taught["figures"]}
        assert figures["shoe"]["old"] is None and figures["shoe"]["new"] > 0.4
        assert taught["kept_share"] > 0.97 and networks["used"] == "start"

        page.get_by_test_id("use-taught 1").click()
        expect(page.get_by_test_id("exchange")).to_have_text("taught 1 is in use")
        eventually(lambda: off_the_line_m(program) > 0.4)
        post("/api/v1/goals", json={"x_m": 2.2, "y_m": 0.0})
        post("/api/v1/mission/start")
        state_when(program, lambda state: state["phase"] == "idle", PATIENCE_S)
        driven = np.array(program.get("/api/v1/path").json()["driven"])
        assert np.hypot(*(driven - SHOE).T).min() > 0.4  # half of the robot is 0.33 m wide
        page.get_by_test_id("rollback").click()
        expect(page.get_by_test_id("exchange")).to_have_text("start is in use")


def test_a_training_shows_its_curves_and_is_cancelled_and_resumed_in_the_page(
    shoe_room: RunningConsole, page: Page, tmp_path: Path, world: Path
) -> None:
    frames = annotated_frames(tmp_path / "frames", world)
    phase, curves = page.get_by_test_id("training-phase"), page.get_by_test_id("curves")
    cancel, resume = (page.get_by_test_id(f"{name}-training") for name in ("cancel", "resume"))
    with httpx.Client(base_url=shoe_room.url, trust_env=False, timeout=PATIENCE_S) as program:

        def run() -> dict[str, Any]:
            return dict(program.get("/api/v1/teach/training").json()["run"])

        program.post("/api/v1/beware", json={"name": "shoe", "margin_m": 0.1})
        assert add(program, frames) == len(VIEWPOINTS)
        page.reload()
        expect(cancel).to_be_hidden()
        expect(resume).to_be_hidden()
        page.get_by_test_id("rehearsal").fill("4")
        page.get_by_test_id("train").click()
        expect(cancel).to_be_visible()
        expect(page.get_by_test_id("train")).to_be_disabled()
        loss = curves.get_by_role("img", name="Loss")
        expect(loss).to_be_visible(timeout=TRAINING_S * 1000)
        eventually(lambda: len(run()["losses"]) > 1, TRAINING_S)
        expect(loss.locator("polyline")).to_have_attribute("points", TWO_POINTS)

        cancel.click()
        expect(phase).to_have_text("taught 1: cancelled")
        expect(cancel).to_be_hidden()
        assert not run()["running"]
        done = run()["losses"][-1]["step"]

        resume.click()
        expect(cancel).to_be_visible()
        expect(resume).to_be_hidden()
        eventually(lambda: run()["losses"][-1]["step"] > done, TRAINING_S)
        assert run()["name"] == "taught 1" and run()["losses"][0]["step"] <= done
        cancel.click()
        expect(phase).to_have_text("taught 1: cancelled")
