"""Ray casting: space is known up to the measured surface, and not behind it."""

from __future__ import annotations

import numpy as np

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.geometry.transform import Pose2
from navcore.mapping.point_map import PointMap
from tests.navcore.scene import SPEC, Box, picture

WALL = Box(x=(1.9, 2.1), y=(-3.0, 3.0), z=(0.0, 2.0))


def test_the_cells_before_a_wall_are_visible_and_none_behind_it() -> None:
    cloud = PointMap(SPEC, MappingConfig())
    cloud.explored.integrate_rays(
        picture(WALL, pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)), ObservationConfig()
    )
    seen = cloud.explored.seen.bools
    before = SPEC.cell(1.2, 0.0)
    assert seen[before]
    assert not seen[:, SPEC.cell(2.35, 0.0)[1] :].any()
    assert not seen[:, : SPEC.cell(-0.2, 0.0)[1]].any()


def test_an_open_view_explores_more_than_a_wall() -> None:
    areas, volumes = [], []
    for scene in ((WALL,), ()):
        cloud = PointMap(SPEC, MappingConfig())
        cloud.explored.integrate_rays(
            picture(*scene, pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)), ObservationConfig()
        )
        areas.append(cloud.explored.area_m2)
        volumes.append(cloud.explored.volume_m3)
    assert areas[1] > areas[0] > 0
    assert volumes[1] > volumes[0] > 0


def test_a_camera_that_measures_nothing_explores_nothing() -> None:
    cloud = PointMap(SPEC, MappingConfig())
    frame = picture(WALL, pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    blind = np.zeros_like(frame.depth_m)
    cloud.explored.integrate_rays(
        type(frame)(
            **{**{name: getattr(frame, name) for name in frame.__slots__}, "depth_m": blind}
        ),
        ObservationConfig(),
    )
    assert cloud.explored.area_m2 == 0


def test_a_camera_above_the_ceiling_cut_does_not_see_through_a_wall_either() -> None:
    cloud = PointMap(SPEC, MappingConfig())
    frame = picture(WALL, pose=Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    assert frame.T_map_camera[2, 3] > 0.5
    cloud.explored.integrate_rays(frame, ObservationConfig(ceiling_m=0.5))
    seen = cloud.explored.seen.bools
    assert seen[SPEC.cell(1.2, 0.0)]
    assert not seen[:, SPEC.cell(2.35, 0.0)[1] :].any()
