"""A map returns to a checkpoint with all that it held then, stored or not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.config.perception.perception import ObservationConfig
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.grid.growth import growth_to
from navcore.mapping.correction import prepare
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage.stored_scans import NO_SCANS
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import NOTHING, BewareList
from tests.navcore.mapping.points.test_fading import unlabelled
from tests.navcore.mapping.test_terrain import CONFIG, assert_same_ground, looked, with_kerb
from tests.navcore.scene import SPEC, Box, picture

WALL = Box(x=(2.0, 2.2), y=(-1.0, 1.0), z=(0.0, 1.0))
NO_CLASSES = BewareList(classes=())


def see(point_map: PointMap, pose: Pose2) -> None:
    frame = picture(WALL, pose=pose)
    seen = unlabelled(frame)
    point_map.insert(observe(frame, seen, NO_CLASSES, SPEC, ObservationConfig()), frame, seen)


@pytest.fixture
def held() -> PointMap:
    """A map of one look, a kerb, and the second of two rejections."""
    point_map = PointMap(SPEC, CONFIG)
    see(point_map, Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    looked(point_map, with_kerb(0.2))
    for _ in range(2):
        point_map.edits.reject(7, np.array([[1.0, 0.5]]), 0.9)
    point_map.edits.take_back(1)
    return point_map


def test_all_that_has_come_since_is_taken_back(held: PointMap) -> None:
    scans = held.scans
    checkpoint, before = held.checkpoint(), held.state()
    ground = PointMap(SPEC, CONFIG)
    ground.pose_ids.extend(held.poses)
    ground.terrain.restore(held.terrain.records())
    see(held, Pose2(x_m=-1.0, y_m=1.0, yaw_rad=1.0))
    looked(held, dataclasses.replace(with_kerb(0.1), pose=Pose2(x_m=-1.0, y_m=1.0, yaw_rad=1.0)))
    held.edits.reject(7, np.array([[2.0, 0.5]]), 0.9)
    growth = growth_to(SPEC, (-1, -1, SPEC.rows + 1, SPEC.cols + 1))
    assert growth is not None
    held.grow(growth)
    held.return_to(checkpoint)
    after = held.state()
    np.testing.assert_array_equal(after.points.points_map, before.points.points_map)
    np.testing.assert_array_equal(after.poses, before.poses)
    np.testing.assert_array_equal(after.visible.bools, before.visible.bools)
    assert [one.id for one in after.rejections] == [one.id for one in before.rejections] == [2]
    again, _ = held.edits.reject(7, np.array([[2.0, 0.5]]), 0.9)
    assert again.id > 3, "the number of one that was taken back is not given again"
    assert_same_ground(held.terrain, ground.terrain)
    assert held.spec == SPEC
    assert held.scans is scans and scans() is NO_SCANS


def test_the_poses_of_a_checkpoint_are_constants_once_the_map_has_returned_to_it(
    held: PointMap,
) -> None:
    there = {0: Pose2(x_m=0.0, y_m=0.5, yaw_rad=0.0)}
    checkpoint = held.checkpoint()
    held.correct(there)
    prepared = prepare(held.snapshot(), {0: Pose2(x_m=0.0, y_m=1.0, yaw_rad=0.0)})
    held.return_to(checkpoint)
    assert held.poses[0].y_m == 0.0
    assert not held.apply(prepared)
    with pytest.raises(BadConfiguration, match="belongs to the loaded map"):
        held.correct(there)


@pytest.mark.parametrize("is_whole", [True, False])
def test_an_erasure_of_before_is_undone_as_without_a_trial(is_whole: bool) -> None:
    def undone(*, is_taken_back: bool) -> tuple[int, int]:
        """Number of cells of the prior map, and of erased points that are back, at the end."""
        point_map = PointMap(SPEC, CONFIG)
        prior = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
        prior[60:100, 60:140] = True
        point_map.load_prior(prior)
        see(point_map, Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))
        cells = np.arange(prior.size if is_whole else prior.size // 2)
        erased = point_map.edits.erase(cells, [NOTHING, 7])
        points = erased.records
        if is_taken_back:
            checkpoint = point_map.checkpoint()
            see(point_map, Pose2(x_m=-1.0, y_m=1.0, yaw_rad=1.0))
            point_map.return_to(checkpoint)
        old = point_map.edits._not_erased_since(erased.number - 1, points)
        assert len(points) and not len(old), "erased areas stay erased"
        point_map.edits.put_back(erased)
        held = point_map.layers.prior
        return int(held.bools.sum()) if held else 0, len(point_map.points.pose_ids)

    assert undone(is_taken_back=True) == undone(is_taken_back=False)
