"""Colour rules: which pixels fit and which do not."""

from __future__ import annotations

import colorsys
import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.mission.beware_list import NOTHING, BewareClass, BewareList, ColourRule
from navcore.perception.colour_segmenter import ColourSegmenter
from tests.navcore.laws import law
from tests.navcore.scene import Colour, picture

FRAME = picture()


def label(colour: Colour, *entries: BewareClass) -> int:
    """Return the class of an image of one colour."""
    frame = dataclasses.replace(FRAME, rgb=np.full_like(FRAME.rgb, colour))
    labels = ColourSegmenter().segment(frame, BewareList(classes=entries))
    assert labels.class_ids.shape == labels.confidence.shape == FRAME.depth_m.shape
    assert (labels.confidence == 1).all()
    assert len(np.unique(labels.class_ids)) == 1
    return int(labels.class_ids[0, 0])


def entry(
    first: float,
    last: float,
    class_id: int = 3,
    *,
    min_saturation: float = 0.5,
    min_value: float = 0.2,
) -> BewareClass:
    rule = ColourRule(hue_deg=(first, last), min_saturation=min_saturation, min_value=min_value)
    return BewareClass(name=f"hue {class_id}", class_id=class_id, colour=rule)


def rgb(hue_deg: float, saturation: float = 1.0, value: float = 1.0) -> Colour:
    red, green, blue = (
        round(255 * part) for part in colorsys.hsv_to_rgb(hue_deg / 360, saturation, value)
    )
    return red, green, blue


@pytest.mark.parametrize("hue", [350, 355, 0, 5, 10])
@pytest.mark.parametrize("span", [(345, 15), (340, 20)])
def test_a_range_that_wraps_around_red_holds_reds_on_both_sides(
    hue: float, span: tuple[float, float]
) -> None:
    assert label(rgb(hue), entry(*span)) == 3


@pytest.mark.parametrize("hue", [30, 60, 120, 180, 240, 300, 330])
def test_a_range_that_wraps_around_red_holds_nothing_else(hue: float) -> None:
    assert label(rgb(hue), entry(345, 15)) == NOTHING


@pytest.mark.parametrize("span", [(330, 360), (0, 30)])
def test_pure_red_is_both_the_first_hue_and_the_last(span: tuple[float, float]) -> None:
    assert label((255, 0, 0), entry(*span)) == 3


@law(100)
@given(st.floats(0, 359.9), st.floats(0, 359.9), st.floats(0, 359.9))
def test_a_hue_well_inside_the_range_is_hit_and_one_well_outside_is_not(
    first: float, last: float, hue: float
) -> None:
    width, along = (last - first) % 360, (hue - first) % 360
    hit = label(rgb(hue), entry(first, last)) == 3
    if 3 < along < width - 3:
        assert hit
    if width + 3 < along < 357:
        assert not hit


@law(60)
@given(st.integers(0, 255), st.floats(0, 360), st.floats(0, 360))
def test_grey_is_never_hit_whatever_the_hue(level: int, first: float, last: float) -> None:
    assert label((level, level, level), entry(first, last)) == NOTHING


def test_pale_and_dark_colours_are_hit_only_when_the_rule_says_so() -> None:
    assert label(rgb(120, saturation=0.3), entry(90, 150)) == NOTHING
    assert label(rgb(120, saturation=0.3), entry(90, 150, min_saturation=0.2)) == 3
    assert label(rgb(120, value=0.1), entry(90, 150)) == NOTHING
    assert label(rgb(120, value=0.1), entry(90, 150, min_value=0.05)) == 3


@pytest.mark.parametrize(
    ("saturation", "value", "hit", "missed"),
    [
        ((0.0, 0.15), (0.85, 1.0), rgb(0, 0.05, 0.95), rgb(0, 0.0, 0.7)),
        ((0.0, 0.15), (0.85, 1.0), (255, 255, 255), rgb(60, 0.9, 0.95)),
        ((0.0, 1.0), (0.0, 0.2), (20, 20, 20), rgb(0, 0.0, 0.5)),
    ],
    ids=["white, not grey", "white, not yellow", "black, not grey"],
)
def test_white_and_black_are_hit_by_upper_bounds(
    saturation: tuple[float, float], value: tuple[float, float], hit: Colour, missed: Colour
) -> None:
    rule = ColourRule(
        hue_deg=(0.0, 360.0),
        min_saturation=saturation[0],
        max_saturation=saturation[1],
        min_value=value[0],
        max_value=value[1],
    )
    white_or_black = BewareClass(name="marking", class_id=3, colour=rule)
    assert label(hit, white_or_black) == 3
    assert label(missed, white_or_black) == NOTHING


def test_where_rules_overlap_the_first_of_the_list_wins() -> None:
    wide, narrow = entry(0, 200, class_id=7), entry(100, 140, class_id=8)
    assert label(rgb(120), narrow, wide) == 8
    assert label(rgb(120), wide, narrow) == 7
    assert label(rgb(60), narrow, wide) == 7


def test_a_disabled_class_is_labelled_all_the_same() -> None:
    assert label(rgb(120), dataclasses.replace(entry(90, 150), enabled=False)) == 3


def test_a_class_without_a_colour_labels_nothing() -> None:
    assert label(rgb(120), BewareClass(name="cup", class_id=1)) == NOTHING
