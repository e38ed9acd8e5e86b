"""Exposure, white balance and motion blur of images."""

from __future__ import annotations

import numpy as np
import pytest

from navcore.learning.data.photometry import NEUTRAL_K, channel_light, exposed, motion_blurred

GREY = np.full((4, 6, 3), 100, dtype=np.uint8)


def test_a_good_exposure_in_neutral_light_changes_nothing() -> None:
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    assert (exposed(levels, 1.0) == levels).all()
    assert channel_light(NEUTRAL_K) == pytest.approx(1.0)


@pytest.mark.parametrize(("light", "level"), [(0.2, 48), (2.0, 137), (30.0, 255)])
def test_levels_follow_the_light_by_the_power_of_srgb_and_are_clipped(
    light: float, level: int
) -> None:
    assert (exposed(GREY, light) == level).all()


@pytest.mark.parametrize(("kelvin", "brightest", "darkest"), [(3000.0, 0, 2), (9000.0, 2, 0)])
def test_warm_light_is_red_and_cold_light_blue(kelvin: float, brightest: int, darkest: int) -> None:
    pixel = exposed(GREY, 1.0, kelvin)[0, 0].astype(int)
    assert pixel[1] == 100
    assert pixel[brightest] - 100 > 5 and 100 - pixel[darkest] > 5


@pytest.mark.parametrize("way_px", [0.4, 1.0, 2.5, -6.0])
def test_blur_spreads_a_line_evenly_over_the_way_of_the_image(way_px: float) -> None:
    line = np.zeros((3, 31, 3), dtype=np.uint8)
    line[:, 15] = 240
    blurred = motion_blurred(line, way_px)[1, :, 0].astype(float)
    # A pixel has a width of its own: what moves by less than one stays within three.
    width = max(abs(way_px), 1.0)
    assert blurred.sum() == pytest.approx(240, abs=6)
    assert (blurred == blurred[::-1]).all()
    assert (
        np.flatnonzero(blurred)[[0, -1]] == 15 + np.array([-1, 1]) * np.ceil((width - 1) / 2)
    ).all()


def test_an_image_at_rest_stays_itself() -> None:
    assert motion_blurred(GREY, 0.0) is GREY
