"""Known space as other threads read it."""

from __future__ import annotations

import numpy as np

from navcore.config.mapping import MappingConfig
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.grid.growth import growth_to
from navcore.mapping.explored.visibility import VisibilityMap
from navcore.mapping.points.pose_ids import PoseIds

SPEC = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.1)
SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def test_unseen_floor_is_that_of_one_grid_also_while_it_grows() -> None:
    explored = VisibilityMap(SPEC, MappingConfig().raycast, PoseIds(0.5, 20.0))
    explored.mark_driven(SQUARE, Pose2(x_m=0.5, y_m=0.5, yaw_rad=0.0))
    before = explored.unseen_on(SPEC)
    assert 0 < (~before).sum() < before.size
    growth = growth_to(SPEC, (-1, -1, SPEC.rows, SPEC.cols))
    assert growth is not None
    explored.spec = growth.new  # the think thread has come to here
    np.testing.assert_array_equal(explored.unseen_on(SPEC), before)
    explored.spec = SPEC
    explored.grow(growth)
    np.testing.assert_array_equal(explored.unseen_on(SPEC), before)
