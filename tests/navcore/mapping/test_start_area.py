"""Where the robot is put down the floor is free, as far round and ahead as it is told."""

from __future__ import annotations

import dataclasses

import numpy as np

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


def known_floor(clear_m: float, ahead_m: float, *points: tuple[float, float]) -> list[bool]:
    """Whether the floor at points (x ahead, y to the left of the start, metres) is measured or
    taken for free after an image."""
    config = dataclasses.replace(NavigatorConfig(), start_clear_m=clear_m, start_ahead_m=ahead_m)
    navigator = Navigator(spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=config)
    navigator.tick(picture(WALL, pose=START), ORDER)
    known = navigator.map.explored.known(SPEC)
    placed = START.to_parent(np.array(points)).tolist()
    return [bool(known[SPEC.cell(x, y)]) for x, y in placed]


def test_in_a_narrow_place_the_floor_is_known_ahead_and_not_beside() -> None:
    before_the_view, beside, behind = (0.7, 0.0), (0.0, 1.0), (-1.0, 0.0)
    assert known_floor(0.5, 1.2, before_the_view, beside, behind) == [True, False, False]
    assert known_floor(1.2, 0.0, before_the_view, beside, behind) == [True, True, True]
    assert known_floor(0.5, 0.0, before_the_view, beside, behind) == [False, False, False]
    corner, past_the_corner = (0.55, 0.37), (0.55, 0.5)
    assert known_floor(0.0, 0.6, (0.3, 0.37), corner, past_the_corner) == [True, True, False]
