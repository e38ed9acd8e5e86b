"""Memory of the map: nothing where the camera sees through, everything where it has no view."""

from __future__ import annotations

import math

import pytest

from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.scene import Box, picture

TENTH_NS = 100_000_000
SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.05)
ORDER = NavigationRequest(goal=None, beware=BewareList(classes=()), zones=())
STANDING_PERSON = Box(x=(1.88, 2.12), y=(0.1, 0.5), z=(0.0, 1.75))
WALL = Box(x=(5.0, 5.1), y=(-6.0, 6.0), z=(0.0, 2.5))
KERB = Box(x=(2.0, 2.2), y=(-0.3, 0.3), z=(0.0, 0.2))


def looker() -> Navigator:
    return Navigator(
        spec=SPEC, profile=HUSKY, segmenter=ColourSegmenter(), config=NavigatorConfig()
    )


def held(navigator: Navigator, frame: Frame, thing: Box) -> int:
    """Return the number of occupied cells at and around an object after one more frame."""
    (top, left), (bottom, right) = (
        SPEC.cell(thing.x[0] - 0.2, thing.y[0] - 0.2),
        SPEC.cell(thing.x[1] + 0.2, thing.y[1] + 0.2),
    )
    return int(navigator.tick(frame, ORDER).occupancy.grid.geometric[top:bottom, left:right].sum())


@pytest.mark.parametrize(("stood_frames", "away"), [(5, False), (40, False), (40, True)])
def test_a_person_who_left_is_cleared_within_a_second_in_view_and_stays_outside_of_it(
    stood_frames: int, away: bool
) -> None:
    # The wall matters: a pixel that measures nothing may show something too near or too dark, and
    # proves nothing.
    navigator, pose = looker(), Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi if away else 0.0)
    for k in range(stood_frames):
        before = held(
            navigator, picture(WALL, STANDING_PERSON, stamp_ns=k * TENTH_NS), STANDING_PERSON
        )
    for k in range(stood_frames, stood_frames + 10):
        left = held(navigator, picture(WALL, pose=pose, stamp_ns=k * TENTH_NS), STANDING_PERSON)
    assert before > 5
    assert left == (before if away else 0)


def test_obstacles_too_near_for_the_camera_are_remembered_while_the_robot_stays() -> None:
    navigator = looker()
    for k in range(18):
        seen = held(
            navigator,
            picture(KERB, pose=Pose2(x_m=0.1 * k, y_m=0.0, yaw_rad=0.0), stamp_ns=k * TENTH_NS),
            KERB,
        )
        if k == 8:
            before = seen
    assert before > 5
    near = Pose2(x_m=1.7, y_m=0.0, yaw_rad=0.0)  # the bumper is above it
    for k in range(18, 80):
        seen = held(
            navigator, picture(pose=near, stamp_ns=k * TENTH_NS), KERB
        )  # not removed: it is out of sight
    assert seen >= before // 2
