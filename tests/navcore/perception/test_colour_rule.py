"""Colour rules from a click: also of what has no hue, on a floor that has none either."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from navcore.mission.beware_list import ColourRule
from navcore.perception.colour_rule import rule_at
from navcore.perception.colour_segmenter import matches_colour

SHAPE = (120, 160)
TAPE = (slice(50, 60), slice(20, 140))
FLOOR = 150
"""Grey of the floor, 0 to 255."""


def clicked(rgb: tuple[int, int, int]) -> tuple[float, float, ColourRule]:
    """Return the shares of a tape of some colour and of the grey floor around it that the rule of a
    click on the tape takes, without their blurred edge, and the rule. The light falls off to the
    right."""
    image = np.full((*SHAPE, 3), FLOOR, dtype=np.float64)
    image[TAPE] = rgb
    light = np.linspace(1.05, 0.95, SHAPE[1])[None, :, None]
    noise = np.random.default_rng(0).normal(0.0, 3.0, image.shape)
    picture = np.clip(image * light + noise, 0, 255).astype(np.uint8)
    picture = np.asarray(cv2.GaussianBlur(picture, (3, 3), 0), dtype=np.uint8)
    rule = rule_at(55, 80, rgb=picture, heights_m=np.zeros(SHAPE, dtype=np.float32))
    taken = matches_colour(picture, rule)
    tape = np.zeros(SHAPE, dtype=np.uint8)
    tape[TAPE] = 1
    inside, floor = cv2.erode(tape, np.ones((3, 3))) > 0, cv2.dilate(tape, np.ones((3, 3))) == 0
    return float(taken[inside].mean()), float(taken[floor].mean()), rule


@pytest.mark.parametrize("grey", [245, 215, 90, 15])
def test_a_click_on_white_grey_or_black_tape_takes_the_tape_and_not_the_grey_floor(
    grey: int,
) -> None:
    tape, floor, rule = clicked((grey, grey, grey))
    assert tape > 0.9 and floor == 0.0
    assert rule.hue_deg == (0.0, 360.0) and rule.min_saturation == 0.0


def test_a_click_on_a_colour_takes_its_hue_however_bright_or_pure_it_is() -> None:
    tape, floor, rule = clicked((230, 200, 30))
    assert tape > 0.95 and floor == 0.0
    first, last = rule.hue_deg
    assert 30 < first < 52 < last < 70
    assert (rule.max_saturation, rule.max_value) == (1.0, 1.0)


def test_a_click_on_black_says_nothing_of_its_saturation_which_is_noise() -> None:
    _, _, rule = clicked((15, 12, 18))
    assert (rule.min_saturation, rule.max_saturation, rule.min_value) == (0.0, 1.0, 0.0)
    assert rule.max_value < 0.3
