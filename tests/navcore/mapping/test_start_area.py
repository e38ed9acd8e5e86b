"""Where the robot is put down the floor is free, as far round and ahead as it is told."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.profile import HUSKY
from tests.navcore.scene import Box, picture

SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.05)
WALL = Box(x=(3.5, 3.6), y=(-4.0, 4.0), z=(0.0, 2.0))
ORDER = NavigationRequest(goal=None, beware=BewareList(classes=()), zones=())
START = Pose2(x_m=0.5, y_m=0.2, yaw_rad=0.4)


def after_an_image(clear_m: float, ahead_m: float) -> Navigator:
    config = dataclasses.replace(NavigatorConfig(), start_clear_m=clear_m, start_ahead_m=ahead_m)
    navigator = Navigator(spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=config)
    navigator.tick(picture(WALL, pose=START), ORDER)
    return navigator


def known_floor(clear_m: float, ahead_m: float, *points: tuple[float, float]) -> list[bool]:
    """Whether the floor at points (x ahead, y to the left of the start, metres) is measured or
    taken for free after an image."""
    known = after_an_image(clear_m, ahead_m).map.explored.known(SPEC)
    placed = START.to_parent(np.array(points)).tolist()
    return [bool(known[SPEC.cell(x, y)]) for x, y in placed]


def test_in_a_narrow_place_the_floor_is_known_ahead_and_not_beside() -> None:
    before_the_view, beside, behind = (0.7, 0.0), (0.0, 1.0), (-1.0, 0.0)
    assert known_floor(0.5, 1.2, before_the_view, beside, behind) == [True, False, False]
    assert known_floor(1.2, 0.0, before_the_view, beside, behind) == [True, True, True]
    assert known_floor(0.5, 0.0, before_the_view, beside, behind) == [False, False, False]
    corner, past_the_corner = (0.55, 0.37), (0.55, 0.5)
    assert known_floor(0.0, 0.6, (0.3, 0.37), corner, past_the_corner) == [True, True, False]


@pytest.mark.parametrize("clear_m", [0.72, 0.876, 1.2])
def test_the_middles_of_the_cells_taken_for_free_lie_in_the_clear_circle(clear_m: float) -> None:
    """An object that is on no map may stand at its edge, and the pose may be a little off."""
    navigator = after_an_image(clear_m, 0.0)
    behind = START.from_parent(SPEC.centres(np.argwhere(navigator.map.explored.known(SPEC))))
    behind = behind[behind[:, 0] < -0.3]
    farthest_m = float(np.hypot(*behind.T).max())
    assert clear_m - 1.5 * SPEC.resolution_m < farthest_m < clear_m - 0.005
