"""Network and colour rules together: which label wins, that no hypothesis is lost, and what finds
which class."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import DEFAULT_PERCEPTION
from navcore.mapping.points.confidence import initial_confidence
from navcore.mission.beware_list import NOTHING, PERSON, BewareClass, BewareList, ColourRule
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.fused_segmenter import FusedSegmenter, fuse, weigh
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.laws import law
from tests.navcore.scene import RED, Box, Paint, picture

RED_RULE = ColourRule(hue_deg=(340.0, 20.0), max_height_m=0.05)
RED_FLOOR = BewareClass(name="red floor", class_id=1, colour=RED_RULE)
BOOK = BewareClass(name="book", class_id=2, min_confidence=0.5)
CUP = BewareClass(
    name="cup",
    class_id=3,
    colour=ColourRule(hue_deg=(200.0, 250.0), max_height_m=0.15, fallback=True),
)
LIST = BewareList(classes=(RED_FLOOR, BOOK, CUP))
FRAME = picture(Paint(x=(1.0, 2.0), y=(-0.5, 0.5)))


class Oracle:
    """A network that labels every image the same."""

    def __init__(self, class_id: int, confidence: float, *names: str) -> None:
        self._said, self._names = (class_id, confidence), names

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        shape = frame.depth_m.shape
        class_id, confidence = self._said
        return Labels(
            class_ids=np.full(shape, class_id, np.uint8),
            confidence=np.full(shape, confidence, np.float32),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK if entry.name in self._names else LabelSource.NOTHING


def painted_part(labels: Labels) -> tuple[set[int], set[int]]:
    """Return the class ids on the red paint and beside it."""
    red = (FRAME.rgb == RED).all(axis=2)
    return set(np.unique(labels.class_ids[red]).tolist()), set(
        np.unique(labels.class_ids[~red]).tolist()
    )


def test_the_network_wins_where_it_is_confident_and_the_paint_where_it_is_not() -> None:
    assert painted_part(
        FusedSegmenter(Oracle(2, 0.9, "book"), HUSKY.depth_sensor).segment(FRAME, LIST)
    ) == ({2}, {2})
    assert painted_part(
        FusedSegmenter(Oracle(2, 0.4, "book"), HUSKY.depth_sensor).segment(FRAME, LIST)
    ) == ({1}, {2})
    off = LIST.edited("book", enabled=False)
    assert painted_part(
        FusedSegmenter(Oracle(2, 0.9, "book"), HUSKY.depth_sensor).segment(FRAME, off)
    ) == ({1}, {2})


ALONE = LIST.replaced(
    dataclasses.replace(entry, colour=dataclasses.replace(RED_RULE, alone=True))
    if entry == RED_FLOOR
    else entry
    for entry in LIST.classes
)


def test_where_the_network_knows_the_class_its_colour_counts_only_with_the_network() -> None:
    sure, unsure = Oracle(NOTHING, 0.97, "red floor"), Oracle(NOTHING, 0.6, "red floor")
    assert painted_part(FusedSegmenter(sure, HUSKY.depth_sensor).segment(FRAME, LIST)) == (
        {NOTHING},
        {NOTHING},
    )
    assert painted_part(FusedSegmenter(unsure, HUSKY.depth_sensor).segment(FRAME, LIST)) == (
        {1},
        {NOTHING},
    )
    # The same paint alone: the operator trusts the colour, or no network knows the class.
    assert painted_part(FusedSegmenter(sure, HUSKY.depth_sensor).segment(FRAME, ALONE)) == (
        {1},
        {NOTHING},
    )
    unaware = Oracle(NOTHING, 0.97, "book")
    assert painted_part(FusedSegmenter(unaware, HUSKY.depth_sensor).segment(FRAME, LIST)) == (
        {1},
        {NOTHING},
    )


def test_network_and_colour_strengthen_and_weaken_each_other_and_are_never_certain() -> None:
    labels = FusedSegmenter(Oracle(1, 0.6, "red floor"), HUSKY.depth_sensor).segment(FRAME, LIST)
    red = (FRAME.rgb == RED).all(axis=2)
    evidence = DEFAULT_PERCEPTION.evidence
    for part, factor in ((red, evidence.fits), (~red, evidence.misses)):
        odds = labels.confidence[part] / (1 - labels.confidence[part])
        np.testing.assert_allclose(odds, factor * 0.6 / 0.4, rtol=1e-4)
    certain = FusedSegmenter(Oracle(1, 1.0, "red floor"), HUSKY.depth_sensor).segment(FRAME, LIST)
    assert (certain.confidence < 1).all()


class KnowsBoth(Oracle):
    """A network that knows all classes of the list."""

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK


def test_a_class_whose_colour_is_evidence_hides_no_other_while_it_is_off() -> None:
    red = (FRAME.rgb == RED).all(axis=2)
    book = FusedSegmenter(KnowsBoth(2, 0.7, "book"), HUSKY.depth_sensor)
    on, off = (
        book.segment(FRAME, LIST.edited("red floor", enabled=is_on)) for is_on in (True, False)
    )
    assert (on.class_ids[red] == 1).all() and on.mask(LIST)[red].all()  # both are possible
    without = LIST.edited("red floor", enabled=False)
    assert (off.class_ids[red] == 2).all() and off.mask(without)[red].all()
    # The map learns of both, whatever is on.
    for labels in (on, off):
        shown = [{int(v) for v in np.unique(one.class_ids[red])} for one in labels.all_hypotheses]
        assert {1} in shown and {2} in shown


@law(50)
@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.booleans())
def test_more_of_the_network_is_never_less_of_the_class(a: float, b: float, fit: bool) -> None:
    low, high = sorted((a, b))
    said = Labels(
        class_ids=np.ones((1, 2), np.uint8), confidence=np.array([[low, high]], np.float32)
    )
    less, more = weigh(said, 1, np.full((1, 2), fit)).confidence[0]
    assert 0 <= less <= more < 1


def test_both_may_find_the_same_class_and_a_rule_alone_is_certain_of_it() -> None:
    labels = FusedSegmenter(Oracle(1, 0.6, "red floor"), HUSKY.depth_sensor).segment(FRAME, ALONE)
    red = (FRAME.rgb == RED).all(axis=2)
    assert set(np.unique(labels.class_ids)) == {1}
    assert (labels.confidence[red] == 1).all()
    assert (labels.confidence[~red] == np.float32(0.6)).all()


def test_a_network_is_never_as_certain_as_a_rule_that_speaks_alone() -> None:
    # 1 / (1 + 1e-8) is exactly 1 in single precision.
    for oracle in (Oracle(2, 1.0, "book"), WithExample(2, 1.0, "book")):
        labels = FusedSegmenter(oracle, HUSKY.depth_sensor).segment(FRAME, LIST)
        assert (labels.class_ids == 2).all() and (labels.confidence < 1).all()
        for one in labels.all_hypotheses:
            assert (one.confidence[np.isin(one.class_ids, (2, 9))] < 1).all()
    network = labels.confidence.ravel()[:1]
    first = initial_confidence(network, np.zeros(1, np.bool_), MappingConfig().confidence)
    assert first < 1, "what the map keeps can be refuted"


def test_both_hypotheses_of_a_pixel_go_onto_the_map_enabled_or_not() -> None:
    red = (FRAME.rgb == RED).all(axis=2)
    for beware in (
        LIST,
        LIST.edited("book", enabled=False),
        LIST.edited("red floor", enabled=False),
    ):
        for confidence in (0.9, 0.4):
            network, rules = (
                FusedSegmenter(Oracle(2, confidence, "book"), HUSKY.depth_sensor)
                .segment(FRAME, beware)
                .all_hypotheses
            )
            assert (network.class_ids == 2).all()
            assert (network.confidence == np.float32(confidence)).all()
            np.testing.assert_array_equal(rules.class_ids, np.where(red, 1, 0))
            assert (rules.confidence == 1).all()


class Shown(Oracle):
    """A network that labels the pixels of some colours only."""

    def __init__(
        self, class_id: int, confidence: float, name: str, *colours: tuple[int, int, int]
    ) -> None:
        super().__init__(class_id, confidence, name)
        self._colours = colours

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        said = np.logical_or.reduce([(frame.rgb == colour).all(axis=2) for colour in self._colours])
        whole = super().segment(frame, beware)
        return dataclasses.replace(
            whole, class_ids=np.where(said, whole.class_ids, np.uint8(NOTHING))
        )


BLUE = (20, 40, 200)
PERSON_CLASS = BewareClass(name=PERSON, class_id=11, min_height_m=0.5)
WITH_PEOPLE = BewareList(classes=(*LIST.classes, PERSON_CLASS))


def test_the_red_shoes_of_a_person_are_no_red_floor() -> None:
    shoes = Box(x=(2.0, 2.3), y=(-0.2, 0.2), z=(0.0, 0.08), colour=RED)
    frame = picture(shoes, Box(x=(2.0, 2.3), y=(-0.2, 0.2), z=(0.08, 1.7), colour=BLUE))
    for beware in (WITH_PEOPLE, WITH_PEOPLE.edited(PERSON, enabled=False)):
        labels = FusedSegmenter(Shown(11, 0.9, PERSON, RED, BLUE), HUSKY.depth_sensor).segment(
            frame, beware
        )
        assert not any(
            (one.class_ids == RED_FLOOR.class_id).any() for one in (labels, *labels.all_hypotheses)
        )
        unsure = (
            FusedSegmenter(Shown(11, 0.3, PERSON, RED, BLUE), HUSKY.depth_sensor)
            .segment(frame, beware)
            .all_hypotheses
        )
        assert any((one.class_ids == RED_FLOOR.class_id).any() for one in unsure)


def test_red_floor_before_a_person_stays_red_floor_where_a_network_labels_it_as_the_person() -> (
    None
):
    frame = picture(
        Box(x=(2.0, 2.3), y=(-0.2, 0.2), z=(0.0, 1.7), colour=BLUE),
        Paint(x=(1.7, 2.0), y=(-0.2, 0.2)),
    )
    red = (frame.rgb == RED).all(axis=2)
    _, rules = (
        FusedSegmenter(Shown(11, 0.9, PERSON, RED, BLUE), HUSKY.depth_sensor)
        .segment(frame, WITH_PEOPLE)
        .all_hypotheses
    )
    np.testing.assert_array_equal(rules.class_ids == RED_FLOOR.class_id, red)


@pytest.mark.parametrize("changes", [{}, {"enabled": False}, {"min_confidence": 0.8}])
def test_red_floor_stays_red_floor_even_where_a_network_labels_it_as_a_person(
    changes: dict[str, object],
) -> None:
    beware = WITH_PEOPLE.edited(PERSON, **changes)
    _, rules = (
        FusedSegmenter(Shown(11, 0.7, PERSON, RED), HUSKY.depth_sensor)
        .segment(FRAME, beware)
        .all_hypotheses
    )
    np.testing.assert_array_equal(
        rules.class_ids == RED_FLOOR.class_id, (FRAME.rgb == RED).all(axis=2)
    )


def test_a_rule_that_is_off_hides_no_other_whose_colours_it_shares() -> None:
    wide = BewareClass(
        name="warm floor", class_id=4, colour=ColourRule(hue_deg=(300.0, 60.0), max_height_m=0.05)
    )
    beware = BewareList(classes=(wide, RED_FLOOR, CUP))
    for segmenter in (ColourSegmenter(), FusedSegmenter(Oracle(0, 1.0), HUSKY.depth_sensor)):
        both = segmenter.segment(FRAME, beware)
        assert painted_part(both)[0] == {4}
        assert {tuple(np.unique(one.class_ids)) for one in both.all_hypotheses} >= {
            (0, 4),
            (0, 1),
        }
        assert painted_part(segmenter.segment(FRAME, beware.edited("warm floor", enabled=False)))[
            0
        ] == {1}


@law(60)
@given(st.integers(0, 2**32 - 1), st.lists(st.booleans(), min_size=3, max_size=3), st.floats(0, 1))
def test_no_pixel_that_binds_the_robot_by_one_of_them_is_free_by_both(
    seed: int, enabled: list[bool], least: float
) -> None:
    rng = np.random.default_rng(seed)
    beware = BewareList(
        classes=tuple(
            dataclasses.replace(entry, enabled=on, min_confidence=least)
            for entry, on in zip(LIST.classes, enabled, strict=True)
        )
    )
    seen = Labels(
        class_ids=rng.integers(0, 4, (20, 30), dtype=np.uint8),
        confidence=rng.random((20, 30), dtype=np.float32),
    )
    coloured: npt.NDArray[np.uint8] = rng.choice([0, 0, 1, 3], (20, 30)).astype(np.uint8)
    colour = Labels(class_ids=coloured, confidence=np.ones((20, 30), dtype=np.float32))
    both = fuse(seen, coloured, beware)
    np.testing.assert_array_equal(both.mask(beware), seen.mask(beware) | colour.mask(beware))
    assert (both.class_ids[(seen.class_ids != NOTHING) | (coloured != NOTHING)] != NOTHING).all()


def test_the_mask_is_the_union_of_the_enabled_classes_with_enough_confidence() -> None:
    labels = Labels(
        class_ids=np.array([[0, 1, 2, 2, 3]], np.uint8),
        confidence=np.array([[1, 0.5, 0.49, 0.5, 1]], np.float32),
    )
    np.testing.assert_array_equal(labels.mask(LIST), [[False, True, False, True, True]])
    np.testing.assert_array_equal(
        labels.mask(LIST.edited("cup", enabled=False)), [[False, True, False, True, False]]
    )


def test_a_fallback_rule_is_silent_once_a_network_knows_the_class() -> None:
    blue = picture(Box(x=(1.0, 1.3), y=(-0.2, 0.2), z=(0.0, 0.1), colour=(30, 60, 220)))
    assert (
        3
        in FusedSegmenter(Oracle(0, 0.9, "book"), HUSKY.depth_sensor).segment(blue, LIST).class_ids
    )
    assert (
        3
        not in FusedSegmenter(Oracle(0, 0.9, "cup"), HUSKY.depth_sensor)
        .segment(blue, LIST)
        .class_ids
    )
    assert 3 in ColourSegmenter().segment(blue, LIST).class_ids


def test_a_rule_holds_only_up_to_its_height() -> None:
    kerb = picture(Box(x=(1.2, 1.5), y=(-0.2, 0.2), z=(0.0, 0.12), colour=RED))
    red = (kerb.rgb == RED).all(axis=2)
    found = ColourSegmenter().segment(kerb, LIST).class_ids[red] == 1
    assert 0 < found.mean() < 0.3


def test_a_flat_print_of_a_tall_object_is_left_to_the_colour_rules() -> None:
    tall = LIST.edited("book", min_height_m=0.1)
    red = (FRAME.rgb == RED).all(axis=2)

    class Print(Oracle):
        def segment(self, frame: Frame, beware: BewareList) -> Labels:
            return Labels(
                class_ids=np.where(red, 2, 0).astype(np.uint8),
                confidence=np.ones(red.shape, np.float32),
            )

    assert painted_part(
        FusedSegmenter(Print(2, 1.0, "book"), HUSKY.depth_sensor).segment(FRAME, tall)
    ) == ({1}, {0})
    assert painted_part(
        FusedSegmenter(Print(2, 1.0, "book"), HUSKY.depth_sensor).segment(FRAME, LIST)
    ) == ({2}, {0})


def test_the_source_of_a_class_is_stated_also_when_there_is_none() -> None:
    both = FusedSegmenter(Oracle(0, 1.0, "red floor", "cup"), HUSKY.depth_sensor)
    snake = BewareClass(name="snake", class_id=9)
    assert [both.source_of(entry) for entry in (RED_FLOOR, CUP, BOOK, snake)] == [
        LabelSource.WEIGHED,
        LabelSource.NETWORK,
        LabelSource.NOTHING,
        LabelSource.NOTHING,
    ]
    assert both.source_of(ALONE.named("red floor")) is LabelSource.BOTH
    assert FusedSegmenter(Oracle(0, 1.0), HUSKY.depth_sensor).source_of(CUP) is LabelSource.COLOUR
    assert [ColourSegmenter().source_of(entry) for entry in (CUP, BOOK)] == [
        LabelSource.COLOUR,
        LabelSource.NOTHING,
    ]


class WithExample(Oracle):
    """A network that labels the left half of every image by example."""

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        seen = super().segment(frame, beware)
        class_ids = np.zeros_like(seen.class_ids)
        class_ids[:, : frame.depth_m.shape[1] // 2] = 9
        by_example = Labels(class_ids=class_ids, confidence=seen.confidence)
        return dataclasses.replace(seen, hypotheses=(seen, by_example))


def test_a_class_by_example_comes_behind_what_binds_and_is_a_source_of_its_own_on_the_map() -> None:
    toy = BewareClass(name="toy", class_id=9)
    beware = BewareList(classes=(*LIST.classes, toy))
    red, half = (FRAME.rgb == RED).all(axis=2), FRAME.depth_m.shape[1] // 2
    unsure = FusedSegmenter(WithExample(2, 0.4, "book"), HUSKY.depth_sensor).segment(FRAME, beware)
    assert set(np.unique(unsure.class_ids[red])) == {1}
    assert set(np.unique(unsure.class_ids[:, :half][~red[:, :half]])) == {9}
    sure = FusedSegmenter(WithExample(2, 0.9, "book"), HUSKY.depth_sensor).segment(FRAME, beware)
    assert set(np.unique(sure.class_ids)) == {2}
    for labels in (sure, unsure):
        *_, last = labels.hypotheses
        assert (last.class_ids[:, :half] == 9).all()
