"""The pictures of the READMEs are there, are shown, and are small enough for a first page."""

from __future__ import annotations

import pytest
from PIL import Image

from tests.screenshots.pictures import ANIMATION, ANIMATION_SIZE, FOLDER, SIZE

MOST_ANIMATION_BYTES = 1_500_000
MOST_BYTES = 300_000
PAGES = {
    "screenshot.jpg": FOLDER.parent / "README.md",
    "screenshot-why.jpg": FOLDER / "README.md",
    "screenshot-log.jpg": FOLDER / "README.md",
    "screenshot-layers.jpg": FOLDER / "README.md",
}


@pytest.mark.parametrize("name", PAGES)
def test_a_screenshot_is_shown_and_small(name: str) -> None:
    assert f"{name})" in PAGES[name].read_text(encoding="utf-8")
    assert (FOLDER / name).stat().st_size <= MOST_BYTES
    with Image.open(FOLDER / name) as image:
        assert image.size == SIZE


def test_the_animated_picture_is_shown_near_the_top_and_moves() -> None:
    lines = (FOLDER.parent / "README.md").read_text(encoding="utf-8").splitlines()
    assert any(f"(web/{ANIMATION})" in line for line in lines[:8])
    assert (FOLDER / ANIMATION).stat().st_size <= MOST_ANIMATION_BYTES
    with Image.open(FOLDER / ANIMATION) as image:
        assert image.size == ANIMATION_SIZE
        assert getattr(image, "n_frames", 1) > 20
