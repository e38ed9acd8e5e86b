"""Confidence: images speak for and against what a network has detected; certain points keep it."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navcore.config.mapping import ConfidenceConfig, MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.arrays import Bools
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.confidence import ALL_RECOGNISED, initial_confidence
from navcore.mapping.points.people_points import class_set
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from tests.navcore.laws import law
from tests.navcore.mapping.small_maps import ALL, assert_same, layers, rebuilt
from tests.navcore.scene import SPEC, picture

MAT = BewareClass(name="mat", class_id=7)
LIST = BewareList(classes=(MAT,))
FLOOR = picture()


def labels(confidence: float, *, there: bool) -> Labels:
    class_ids = np.zeros(FLOOR.depth_m.shape, dtype=np.uint8)
    if there:
        class_ids[85:95, 70:90] = MAT.class_id
    return Labels(
        class_ids=class_ids, confidence=np.full(class_ids.shape, confidence, dtype=np.float32)
    )


def look(
    cloud: PointMap, seen: Labels, frame: Frame = FLOOR, recognised: Bools = ALL_RECOGNISED
) -> int:
    """Return how many cells the mat occupies after one more image."""
    cloud.insert(observe(frame, seen, LIST, SPEC, ObservationConfig()), frame, seen, recognised)
    return int(layer_grid(cloud, LIST, ()).beware[MAT.class_id].sum())


def test_a_confident_detection_counts_at_once_and_an_uncertain_one_after_some_images() -> None:
    assert look(PointMap(SPEC, MappingConfig()), labels(0.95, there=True)) > 0
    cloud = PointMap(SPEC, MappingConfig())
    bound = [look(cloud, labels(0.7, there=True)) for _ in range(5)]
    assert bound[0] == 0
    assert bound[-1] > 0


def test_a_confident_detection_counts_whatever_confidence_the_list_asks_for() -> None:
    cloud, seen = PointMap(SPEC, MappingConfig()), labels(0.99, there=True)
    for _ in range(20):
        look(cloud, seen)
    bound = [
        int(layer_grid(cloud, LIST.edited("mat", min_confidence=least), ()).beware[7].sum())
        for least in (0.5, 0.95, 0.99, 1.0)
    ]
    assert bound[0] > 0
    assert bound == bound[:1] * 4


def test_where_nothing_was_detected_before_one_detection_is_not_enough_but_two_are() -> None:
    cloud = PointMap(SPEC, MappingConfig())
    assert look(cloud, labels(0.9, there=False)) == 0
    assert look(cloud, labels(0.9, there=True)) == 0
    assert look(cloud, labels(0.9, there=True)) > 0
    certain = PointMap(SPEC, MappingConfig())
    look(certain, labels(1.0, there=False))
    assert look(certain, labels(1.0, there=True)) > 0


def test_a_false_detection_stops_counting_after_a_few_images_and_is_forgotten_after_more() -> None:
    cloud = PointMap(SPEC, MappingConfig())
    assert look(cloud, labels(0.9, there=True)) > 0
    bound = [look(cloud, labels(0.9, there=False)) for _ in range(15)]
    assert 0 in bound[:6]
    assert bound[-1] == 0
    assert not (cloud.points.class_ids == MAT.class_id).any()


def test_what_nothing_can_show_now_stays_as_it_is() -> None:
    cloud, others = PointMap(SPEC, MappingConfig()), class_set([MAT.class_id + 1])
    for _ in range(10):
        held = look(cloud, labels(0.9, there=True))
    assert held > 0
    empty = labels(0.9, there=False)
    for _ in range(30):  # the network has failed, or the class is off the list
        assert look(cloud, empty, recognised=others) == held
    for _ in range(30):  # a colour lens sees past the object
        uncoloured = np.ones(FLOOR.depth_m.shape, dtype=np.bool_)
        assert look(cloud, empty, dataclasses.replace(FLOOR, uncoloured=uncoloured)) == held
    assert [look(cloud, empty) for _ in range(30)][-1] == 0  # control


def test_an_object_detected_in_many_images_is_not_lost_when_some_miss_it() -> None:
    cloud = PointMap(SPEC, MappingConfig())
    for _ in range(10):
        held = look(cloud, labels(0.9, there=True))
    for _ in range(8):
        assert look(cloud, labels(0.9, there=False)) >= 0.9 * held


def test_what_a_source_behind_the_network_shows_is_held_as_if_the_network_showed_it() -> None:
    network, example = labels(0.9, there=False), labels(0.8, there=True)
    both = dataclasses.replace(network, hypotheses=(network, example))
    one, other = PointMap(SPEC, MappingConfig()), PointMap(SPEC, MappingConfig())
    held = [look(one, both) for _ in range(10)]
    assert held == [look(other, example) for _ in range(10)]
    assert held[-1] > 0
    nothing = dataclasses.replace(network, hypotheses=(network, network))
    assert [look(one, nothing) for _ in range(20)][-1] == 0


def test_a_certain_point_stays_when_later_images_of_the_same_colour_lose_its_label() -> None:
    cloud = PointMap(SPEC, MappingConfig())
    held = look(cloud, labels(1.0, there=True))
    for _ in range(20):
        assert look(cloud, labels(1.0, there=False)) == held > 0


def test_the_initial_confidence_never_exceeds_the_network_and_certainty_stays_certain() -> None:
    rules = ConfidenceConfig()
    claims = np.linspace(0.2, 0.999, 50, dtype=np.float32)
    new, known = np.zeros(50, np.bool_), np.ones(50, np.bool_)
    first = initial_confidence(claims, new, rules)
    assert np.all(first <= claims + 0.1)
    assert np.all(np.diff(first) >= 0)
    assert np.all(initial_confidence(claims, known, rules) < first)
    certain = np.ones(2, dtype=np.float32)
    assert initial_confidence(certain, np.array([False, True]), rules).tolist() == [1.0, 1.0]


@law(20)
@given(st.integers(0, 2**32 - 1))
def test_layers_after_updates_of_confidence_equal_those_rebuilt_from_the_points(seed: int) -> None:
    rng, cloud = np.random.default_rng(seed), PointMap(SPEC, MappingConfig())
    for _ in range(6):
        seen = Labels(
            class_ids=rng.choice([0, 0, 1, 2], FLOOR.depth_m.shape).astype(np.uint8),
            confidence=rng.random(FLOOR.depth_m.shape).astype(np.float32),
        )
        frame = dataclasses.replace(FLOOR, stamp_ns=int(rng.integers(1 << 40)))
        cloud.insert(observe(frame, seen, ALL, SPEC, ObservationConfig()), frame, seen)
        assert_same(layers(cloud, ALL), rebuilt(cloud, ALL))
