"""Patterns of two colours on the floor: what alternates is found, what does not is not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.geometry.arrays import Bools
from navcore.mission.beware_list import BewareClass, BewareList, ColourPattern, ColourRule
from navcore.perception.colour_segmenter import ColourSegmenter
from tests.navcore.scene import GREY, Box, Colour, Paint, Span, picture

YELLOW: Colour = (245, 200, 10)
BLACK: Colour = (22, 22, 24)
BLACK_SECOND = ColourPattern(max_gap_m=0.3, max_value=0.25)
BARE_SECOND = ColourPattern(max_gap_m=0.6, min_line_m=0.4)
X: Span = (1.0, 1.3)


def taken(pattern: ColourPattern, *things: Box | Paint) -> Bools:
    """Return the pixels that yellow in a pattern takes."""
    rule = ColourRule(hue_deg=(36.0, 64.0), min_saturation=0.55, pattern=pattern)
    entry = BewareClass(name="marking", class_id=3, colour=rule)
    labels = ColourSegmenter().segment(picture(*things), BewareList(classes=(entry,)))
    return np.asarray(labels.class_ids == 3)


def stripes(count: int, first: Colour = YELLOW, second: Colour = BLACK) -> list[Paint]:
    """Return stripes of 15 cm side by side along y."""
    sides = [-0.075 * count + 0.15 * k for k in range(count + 1)]
    return [
        Paint(x=X, y=(sides[k], sides[k + 1]), colour=second if k % 2 else first)
        for k in range(count)
    ]


def painted(*things: Box | Paint) -> Bools:
    return np.asarray((picture(*things).rgb != GREY).any(axis=2))


def test_stripes_of_two_colours_are_taken_whole_and_nothing_beside_them() -> None:
    tape = stripes(8)
    found, whole = taken(BLACK_SECOND, *tape), painted(*tape)
    assert found[whole].mean() > 0.9
    assert not found[~whole].any()


@pytest.mark.parametrize(
    "things",
    [
        [],
        [Paint(x=X, y=(-0.6, 0.6), colour=YELLOW)],
        [Paint(x=X, y=(-0.6, 0.6), colour=BLACK)],
        [Paint(x=X, y=(-0.6, 0.0), colour=YELLOW), Paint(x=X, y=(0.0, 0.6), colour=BLACK)],
        [Paint(x=(0.9, 3.0), y=(0.0, 2.0), colour=BLACK), Paint(x=X, y=(-0.1, 0.0), colour=YELLOW)],
        stripes(3),
        stripes(8, second=GREY),
        [Box(x=X, y=(0.0, 0.15), z=(0.0, 0.4), colour=YELLOW), *stripes(2, BLACK, BLACK)],
    ],
    ids=[
        "plain floor", "yellow alone", "black alone", "one edge", "edge of a shadow",
        "one black stripe", "yellow and bare floor", "tall"
    ],
)  # fmt: skip
def test_what_does_not_alternate_is_no_pattern(things: list[Box | Paint]) -> None:
    assert not taken(BLACK_SECOND, *things).any()


def test_bare_floor_between_lines_is_taken_and_that_beside_a_single_line_is_not() -> None:
    lines = [Paint(x=(1.0, 1.8), y=(y, y + 0.1), colour=YELLOW) for y in (-0.5, -0.05, 0.4)]
    hull = painted(Paint(x=(1.0, 1.8), y=(-0.5, 0.5)))
    with_rim = painted(Paint(x=(0.95, 1.85), y=(-0.55, 0.55)))  # a cell more
    found = taken(BARE_SECOND, *lines)
    assert found[hull].mean() > 0.9
    assert not found[~with_rim].any()
    assert not taken(BARE_SECOND, lines[1]).any()
    far = dataclasses.replace(BARE_SECOND, max_gap_m=0.2)
    assert not taken(far, *lines).any()


def test_short_pieces_are_no_lines_and_large_areas_no_symbols() -> None:
    dots = [Paint(x=X, y=(y, y + 0.1), colour=YELLOW) for y in (-0.5, -0.05, 0.4)]
    assert not taken(BARE_SECOND, *dots).any()
    assert taken(dataclasses.replace(BARE_SECOND, min_line_m=0.0), *dots).any()  # control
    small = dataclasses.replace(BLACK_SECOND, max_size_m=0.8)
    assert taken(small, *stripes(4)).any()
    assert not taken(small, *stripes(8)).any()
