"""The comparison of screenshots notices what an eye notices, and nothing else."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from tests.screenshots.__main__ import REFERENCES, read
from tests.screenshots.compare import changed_tiles, looks_alike
from tests.screenshots.take import THEMES
from tests.web.page.states import SIZES, STATES

Image = npt.NDArray[np.uint8]
NAMES = [f"{size}-{theme}-{state}.webp" for size in SIZES for theme in THEMES for state in STATES]
MAPS = [name for name in NAMES if name.endswith("-map.webp")]


def alike(one: Image, other: Image) -> bool:
    return looks_alike(changed_tiles(one, other))


def stop_box(image: Image) -> tuple[slice, slice]:
    """Rows and columns of the button STOP: the largest red area."""
    red = (image[..., 0] > 170) & (image[..., 1:].max(axis=2) < 80)
    _, _, boxes, _ = cv2.connectedComponentsWithStats(red.astype(np.uint8))
    left, top, width, height, _ = boxes[1 + boxes[1:, 4].argmax()]
    return slice(top, top + height), slice(left, left + width)


def covered(image: Image, rows: slice, cols: slice) -> Image:
    """The image with a part in the colour above it."""
    other = image.copy()
    other[rows, cols] = image[max(rows.start - 3, 0), cols.start]
    return other


def test_there_is_a_reference_of_each_state_and_all_are_small() -> None:
    assert sorted(file.name for file in REFERENCES.iterdir()) == sorted(NAMES)
    assert sum(file.stat().st_size for file in REFERENCES.iterdir()) < 2.5e6
    for name in MAPS:
        width, height = SIZES[name.split("-")[0]]
        assert read(REFERENCES / name).shape == (height // 2, width // 2, 3)


@pytest.mark.parametrize("name", MAPS)
def test_a_missing_stop_is_noticed(name: str) -> None:
    image = read(REFERENCES / name)
    rows, cols = stop_box(image)
    assert (cols.stop - cols.start) * 2 >= 56 and (rows.stop - rows.start) * 2 >= 44
    assert not alike(image, covered(image, rows, cols))


@pytest.mark.parametrize("theme", THEMES)
def test_a_hidden_panel_is_noticed(theme: str) -> None:
    image = read(REFERENCES / f"desktop-{theme}-map.webp")
    beside = {"goals": slice(110, 225), "zones": slice(240, 400)}
    for rows in beside.values():
        assert not alike(image, covered(image, rows, slice(8, 140)))


def test_two_states_and_two_themes_are_told_apart() -> None:
    for size in SIZES:
        states = {name: read(REFERENCES / name) for name in NAMES if name.startswith(size)}
        dark = {name: image for name, image in states.items() if "-dark-" in name}
        plain = dark[f"{size}-dark-map.webp"]
        told = [name for name, image in dark.items() if not alike(plain, image)]
        # On a large screen goals, zones, camera and classes are beside the map, and no states.
        same = 5 if size != "phone" else 1
        assert len(told) >= len(dark) - same
        for name, image in dark.items():
            assert not alike(image, states[name.replace("-dark-", "-light-")])


@pytest.mark.parametrize("name", MAPS)
def test_live_text_another_rendering_and_noise_are_not_noticed(name: str) -> None:
    image = read(REFERENCES / name)
    assert alike(image, image)
    # Digits of a line of figures.
    text = image.copy()
    grey = (128, 128, 128)
    row = image.shape[0] // 2
    cv2.putText(text, "12.3 m 0.4", (40, row), cv2.FONT_HERSHEY_SIMPLEX, 0.25, grey, 1)
    assert not np.array_equal(text, image) and alike(image, text)
    assert alike(image, cv2.GaussianBlur(image, (3, 3), 0).astype(np.uint8))
    noise = np.random.default_rng(0).integers(-8, 9, image.shape)
    assert alike(image, np.clip(image.astype(int) + noise, 0, 255).astype(np.uint8))


def test_another_size_is_another_screen(tmp_path: Path) -> None:
    image = read(REFERENCES / MAPS[0])
    assert not alike(image, image[:-2])
