"""What left is cleared from the map, and what is hidden, out of view or flat stays."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.robot.frame import Frame
from tests.navcore.mapping.small_maps import AWAY, BLIND, PATCH, TALL, WALL, drive
from tests.navcore.scene import ORIGIN, RED_FLOOR, RED_ID, RED_LIST, SPEC, Box, picture

assert RED_FLOOR.colour is not None
RED_COLOUR = RED_FLOOR.colour


def test_what_left_while_the_robot_was_away_is_cleared_at_the_known_pose() -> None:
    cloud = drive(picture(TALL, WALL), *(picture(WALL, pose=pose) for pose in AWAY))
    drive(picture(WALL), cloud=cloud)
    assert layer_grid(cloud, RED_LIST, ()).geometric[:, : SPEC.cell(3.0, 0.0)[1]].sum() == 0


def test_at_a_known_pose_a_hidden_point_and_a_floor_marking_stay() -> None:
    cloud = drive(picture(WALL, PATCH), *(picture(pose=pose) for pose in AWAY))
    before = layer_grid(cloud, RED_LIST, ())
    drive(picture(Box(x=(1.0, 1.1), y=(-2, 2), z=(0, 2))), cloud=cloud)
    after = layer_grid(cloud, RED_LIST, ())
    assert not (before.geometric & ~after.geometric).any()
    np.testing.assert_array_equal(before.beware[RED_ID], after.beware[RED_ID])


@pytest.mark.parametrize("then", [(WALL,), ()], ids=["a wall behind", "bare floor behind"])
@pytest.mark.parametrize("yaw", [0.0, 0.2], ids=["same pose", "another pose"])
def test_what_is_seen_through_is_cleared(then: tuple[Box, ...], yaw: float) -> None:
    cloud = drive(picture(TALL))
    before, version = layer_grid(cloud, RED_LIST, ()).geometric.sum(), cloud.version
    drive(picture(*then, pose=dataclasses.replace(ORIGIN, yaw_rad=yaw)), cloud=cloud)
    left = layer_grid(cloud, RED_LIST, ()).geometric[:, : SPEC.cell(3.0, 0.0)[1]]
    assert before > 5
    assert left.sum() == 0
    assert cloud.version > version


@pytest.mark.parametrize(
    "look_away",
    [
        lambda: picture(pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi)),
        lambda: picture(Box(x=(1.0, 1.1), y=(-2, 2), z=(0, 2))),
        lambda: BLIND,
        lambda: picture(pose=Pose2(x_m=-6.0, y_m=0.0, yaw_rad=0.0)),
    ],
    ids=["behind the robot", "hidden", "nothing measured", "too far"],
)
def test_points_out_of_view_stay(look_away: Callable[[], Frame]) -> None:
    cloud = drive(picture(TALL, PATCH))
    before = layer_grid(cloud, RED_LIST, ()).occupied()
    drive(look_away(), cloud=cloud)
    assert not (before & ~layer_grid(cloud, RED_LIST, ()).occupied()).any()
    assert before.any()


def test_an_object_that_is_still_there_is_kept_while_driving_past() -> None:
    path = [Pose2(x_m=0.1 * k, y_m=0.05 * k, yaw_rad=0.02 * k) for k in range(10)]
    cloud = drive(*(picture(TALL, WALL, PATCH, pose=pose) for pose in path))
    first = layer_grid(drive(picture(TALL, PATCH)), RED_LIST, ())
    now = layer_grid(cloud, RED_LIST, ())
    assert (first.geometric & ~now.geometric).sum() <= 0.1 * first.geometric.sum()
    assert not (first.beware[RED_ID] & ~now.beware[RED_ID]).any()


def test_a_floor_marking_is_not_lost_when_its_label_flickers() -> None:
    def marked(cloud: PointMap) -> npt.NDArray[np.bool_]:
        return layer_grid(cloud, RED_LIST, ()).beware[RED_ID]

    cloud = drive(picture(PATCH))
    before = marked(cloud)
    for yaw in (0.0, 0.0, 0.1, 0.4):
        drive(picture(pose=dataclasses.replace(ORIGIN, yaw_rad=yaw)), cloud=cloud)
    assert before.sum() > 10
    np.testing.assert_array_equal(marked(cloud), before)


def test_a_beware_object_that_is_carried_away_is_cleared() -> None:
    """Control of the flicker rule: an object with a height is seen through, unlike a marking."""
    cup = BewareList(
        classes=(
            BewareClass(
                name="cup", class_id=3, colour=dataclasses.replace(RED_COLOUR, max_height_m=1.0)
            ),
        )
    )
    red_box = dataclasses.replace(TALL, colour=(220, 20, 20))
    cloud = drive(picture(red_box), beware=cup)
    assert layer_grid(cloud, cup, ()).beware[3].sum() > 5
    drive(picture(WALL), cloud=cloud, beware=cup)
    high = cloud.points.points_map[cloud.points.class_ids == 3]
    assert np.count_nonzero(np.greater(high[:, 2], 0.2)) == 0
