"""Patterns on the floor, from the simulated camera to the beware cells of the map."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely

from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.costmap.local_costmap import beware_cells
from navcore.geometry.arrays import Points
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mapping.point_map import PointMap
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import DepthSensor
from sim.models.floor_paint import PaintPattern
from sim.scenario.schema import Marking
from sim.simulator import Simulator
from tests.sim.worlds import open_floor

CELL_M = 0.05
SPEC = GridSpec.centred(size_m=(10.0, 10.0), resolution_m=CELL_M)
SQUARE = ((-0.48, -0.48), (0.48, -0.48), (0.48, 0.48), (-0.48, 0.48))
POLYGONS: dict[PaintPattern, tuple[tuple[float, float], ...]] = {
    "tape": ((-0.08, -0.62), (0.08, -0.62), (0.08, 0.62), (-0.08, 0.62)),
    "hatched": SQUARE,
    "bay": SQUARE,
    "high-voltage": ((-0.25, -0.4), (0.45, 0.0), (-0.25, 0.4)),
    "radiation": SQUARE,
}
DISTANCES_M = (1.5, 2.25, 3.0)


def looks(marking: Marking) -> list[Frame]:
    """Return what the camera sees of a marking at the origin from each distance to its middle."""
    frames = []
    with Simulator(open_floor(markings=(marking,)), seed=4, camera_rate_hz=0.001,
                   camera_size=(640, 480),
                   start=Pose2(x_m=-5.0, y_m=0.0, yaw_rad=0.0)) as simulator:  # fmt: skip
        ahead_m = simulator.profile.camera.T_base_camera[0, 3]
        for distance_m in DISTANCES_M:
            pose = Pose2(x_m=-distance_m - ahead_m, y_m=0.0, yaw_rad=0.0)
            simulator.teleport(pose)
            frames.append(dataclasses.replace(simulator.capture(), pose=simulator.true_pose()))
    return frames


def cells(frame: Frame, beware: BewareList) -> Points:
    """Return the centres of the beware cells after one look."""
    cloud = PointMap(SPEC, MappingConfig())
    labels = ColourSegmenter().segment(frame, beware)
    cloud.insert(observe(frame, labels, beware, SPEC, ObservationConfig()), frame, labels)
    return beware_cells(layer_grid(cloud, beware, ()))


@pytest.mark.parametrize("pattern", POLYGONS)
def test_a_marking_becomes_beware_cells_that_cover_it_and_nothing_else(
    pattern: PaintPattern,
) -> None:
    marking = Marking(name="marking", polygon=POLYGONS[pattern], pattern=pattern)
    area = shapely.Polygon(marking.polygon)
    shipped = default_beware_list()
    off = shipped.replaced(dataclasses.replace(one, enabled=False) for one in shipped.classes)
    on = off.edited(marking.beware_class, enabled=True)
    centres = SPEC.centres(np.argwhere(np.ones((SPEC.rows, SPEC.cols))))
    inside = {tuple(cell) for cell in centres[shapely.contains_xy(area, *centres.T)].round(3)}
    for distance_m, frame in zip(DISTANCES_M, looks(marking), strict=True):
        found = cells(frame, on)
        covered = len(inside & {tuple(cell) for cell in found.round(3)}) / len(inside)
        # A cell that the outline crosses belongs to the marking, within the error of depth.
        squares = shapely.box(*(found - CELL_M / 2).T, *(found + CELL_M / 2).T)
        error_m = DepthSensor().depth_error_m(distance_m, frame.intrinsics.fx)
        outside = int((shapely.distance(squares, area) > error_m).sum()) / len(inside)
        assert covered >= 0.8, (distance_m, covered)
        assert outside < 0.02, (distance_m, outside)
        assert len(cells(frame, off)) == 0  # control
