"""Rejections: what an operator said is not there counts only with better evidence."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2
from navcore.grid.growth import growth_to
from navcore.mapping.point_map import PointMap
from navcore.mapping.points.rejections import MAX_REJECTIONS
from navcore.mapping.storage.map_file import load, save
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import NOTHING, BewareClass, BewareList
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame
from tests.navcore.scene import SPEC, picture

MAT, RUG = BewareClass(name="mat", class_id=7), BewareClass(name="rug", class_id=8)
LIST = BewareList(classes=(MAT, RUG))
FLOOR = picture()
PLACE = (slice(85, 100), slice(60, 100))
ELSEWHERE = (slice(85, 100), slice(5, 25))


def labels(*parts: tuple[slice, slice], class_id: int = 7, confidence: float = 0.9) -> Labels:
    class_ids = np.zeros(FLOOR.depth_m.shape, dtype=np.uint8)
    for part in parts:
        class_ids[part] = class_id
    return Labels(
        class_ids=class_ids, confidence=np.full(class_ids.shape, confidence, dtype=np.float32)
    )


def look(point_map: PointMap, seen: Labels, frame: Frame = FLOOR) -> dict[int, int]:
    """Return the number of cells of each class after one more image."""
    seen = point_map.rejections.without(frame, seen)
    point_map.insert(observe(frame, seen, LIST, SPEC, ObservationConfig()), frame, seen)
    return cells(point_map)


def cells(point_map: PointMap) -> dict[int, int]:
    return {
        class_id: int(layer.sum())
        for class_id, layer in layer_grid(point_map, LIST, ()).beware.items()
    }


def positions(point_map: PointMap, class_id: int = 7) -> np.ndarray:
    points = point_map.points
    return points.points_map[points.class_ids == class_id, :2].astype(np.float64)


@pytest.fixture
def rejected() -> PointMap:
    """A map on which a mat was seen with 90 % and rejected."""
    point_map = PointMap(SPEC, MappingConfig())
    assert look(point_map, labels(PLACE))[7] > 0
    point_map.edits.reject(7, positions(point_map), 0.9)
    return point_map


def test_a_rejected_place_is_free_at_once_and_stays_free_for_looks_that_are_no_surer(
    rejected: PointMap,
) -> None:
    assert cells(rejected)[7] == 0
    for confidence in (0.5, 0.9, 0.95):
        assert [look(rejected, labels(PLACE, confidence=confidence))[7] for _ in range(8)] == [
            0
        ] * 8
    bound = [look(rejected, labels(PLACE, confidence=0.98))[7] for _ in range(4)]
    assert bound[-1] > 0


def test_the_class_counts_elsewhere_and_other_classes_count_there(rejected: PointMap) -> None:
    for _ in range(3):
        found = look(rejected, labels(PLACE, class_id=8))
        elsewhere = look(rejected, labels(ELSEWHERE))
    assert found[8] > 0 and elsewhere[7] > 0


def test_certainty_is_better_evidence_unless_certain_looks_were_rejected(
    rejected: PointMap,
) -> None:
    point_map = PointMap(SPEC, MappingConfig())
    look(point_map, labels(PLACE, confidence=1.0))
    point_map.edits.reject(7, positions(point_map), 1.0)
    assert [look(point_map, labels(PLACE, confidence=1.0))[7] for _ in range(5)] == [0] * 5
    assert look(rejected, labels(PLACE, confidence=1.0))[7] > 0
    almost = float(np.nextafter(np.float32(1), np.float32(0)))
    rejected.edits.reject(7, positions(rejected), almost)
    assert look(rejected, labels(PLACE, confidence=1.0))[7] > 0


def test_of_several_sources_only_the_rejected_label_is_struck(rejected: PointMap) -> None:
    network, colour = labels(PLACE, ELSEWHERE), labels(PLACE, class_id=8, confidence=1.0)
    fused = dataclasses.replace(network, hypotheses=(network, colour))
    left = rejected.rejections.without(FLOOR, fused)
    assert (left.class_ids[PLACE] == 8).mean() > 0.9
    assert (left.class_ids[ELSEWHERE] == 7).all()
    assert (left.hypotheses[0].class_ids[PLACE] == NOTHING).mean() > 0.9
    assert left.hypotheses[1] is colour
    assert (network.class_ids[PLACE] == 7).all()


def test_a_rejection_moves_with_its_pose_and_with_the_grid_and_is_kept_with_the_map(
    rejected: PointMap, tmp_path: Path
) -> None:
    moved = Pose2(x_m=0.5, y_m=0.4, yaw_rad=0.3)
    there = picture(pose=moved)
    rejected.correct({0: moved})
    assert look(rejected, labels(PLACE), there)[7] == 0
    growth = growth_to(SPEC, (-1, -1, SPEC.rows + 1, SPEC.cols + 1))
    assert growth is not None
    save(tmp_path / "map", rejected.state(), LIST.names)
    again = PointMap(SPEC, MappingConfig())
    again.restore(load(tmp_path / "map").state)
    assert [look(again, labels(PLACE), there)[7] for _ in range(3)] == [0] * 3
    rejected.grow(growth)
    struck = rejected.rejections.without(there, labels(PLACE))
    assert (struck.class_ids[PLACE] == NOTHING).mean() > 0.9
    # Control: where it was before the correction, the class counts.
    assert [look(again, labels(PLACE), FLOOR)[7] for _ in range(3)][-1] > 0


def test_a_rejection_that_is_taken_back_holds_no_longer(rejected: PointMap) -> None:
    (one,) = rejected.rejections.all
    assert rejected.edits.take_back(one.id + 1) is None
    assert rejected.edits.take_back(one.id) is one
    assert [look(rejected, labels(PLACE))[7] for _ in range(3)][-1] > 0


def test_a_map_without_a_pose_and_too_many_rejections_are_refused(rejected: PointMap) -> None:
    with pytest.raises(ValueError, match="a map with a pose"):
        PointMap(SPEC, MappingConfig()).edits.reject(7, np.zeros((1, 2)), 0.9)
    (one,) = rejected.rejections.all
    rejected.rejections.all = (one,) * MAX_REJECTIONS
    with pytest.raises(ValueError, match=f"at most {MAX_REJECTIONS}"):
        rejected.edits.restore_rejection(one)
