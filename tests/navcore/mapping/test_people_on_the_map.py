"""No map keeps people: neither those in whom no tracker believes, nor those of a map that is
loaded; what depth shows of them stays an obstacle while it may be one."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import PERSON, BewareClass, BewareList
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.labels import Labels, LabelSource
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from tests.navcore.scene import ORIGIN, Box, picture

DEFAULT = NavigatorConfig().map
SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.05)
PERSON_ID = 11
BEWARE = BewareList(classes=(BewareClass(name=PERSON, class_id=PERSON_ID),))
ORDER = NavigationRequest(goal=None, beware=BEWARE, zones=())
POST = Box(x=(2.0, 2.24), y=(-0.2, 0.2), z=(0.0, 1.75))
WALL = Box(x=(3.5, 3.6), y=(-4.0, 4.0), z=(0.0, 2.0))
AWAY = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi)
_TENTH_NS = 100_000_000


class CallsThePostAPerson:
    """A network that labels what stands 1.5 to 2.5 m ahead as a person, while it is `sure`."""

    def __init__(self) -> None:
        self.sure = True

    def segment(self, frame: Frame, beware: BewareList) -> Labels:
        post = self.sure & (frame.depth_m > 1.5) & (frame.depth_m < 2.5)
        lens = frame.intrinsics
        post &= np.arange(lens.height)[:, None] < lens.cy
        post &= np.abs(np.arange(lens.width) - lens.cx) < 0.1 * lens.fx
        return Labels(
            class_ids=np.where(post, PERSON_ID, 0).astype(np.uint8),
            confidence=np.full(frame.depth_m.shape, 0.9, np.float32),
        )

    def source_of(self, entry: BewareClass) -> LabelSource:
        return LabelSource.NETWORK


class Drive:
    """A navigator before a post and a wall, and the time of its frames."""

    def __init__(self, rules: MappingConfig = DEFAULT) -> None:
        config = dataclasses.replace(NavigatorConfig(), map=rules)
        self.network, self._tenths = CallsThePostAPerson(), 0
        self.navigator = Navigator(spec=SPEC, profile=HUSKY, segmenter=self.network, config=config)

    def see(self, frames: int, *, pose: Pose2 = ORIGIN, sure: bool = True) -> None:
        """Process so many frames, ten a second."""
        self.network.sure = sure
        for _ in range(frames):
            frame = picture(POST, WALL, pose=pose, stamp_ns=self._tenths * _TENTH_NS)
            self.navigator.tick(frame, ORDER)
            self._tenths += 1

    def cells(self) -> tuple[int, int, int]:
        """Occupied cells of people, of the post and of the wall."""
        grid = layer_grid(self.navigator.map, BEWARE, ())
        (row, left), (_, right) = SPEC.cell(1.8, -0.4), SPEC.cell(2.4, 0.4)
        post = grid.geometric[row : row + 16, left:right].sum()
        wall = grid.geometric[:, SPEC.cell(3.3, 0.0)[1] :].sum()
        return int(grid.beware[PERSON_ID].sum()), int(post), int(wall)


def test_a_post_that_one_image_called_a_person_is_an_obstacle_a_while_later() -> None:
    drive = Drive()
    drive.see(12, pose=AWAY, sure=False)
    drive.see(1)
    named, post, wall = drive.cells()
    assert named > 0 and post > 0
    drive.see(40, pose=AWAY, sure=False)
    assert drive.cells() == (named, post, wall)
    drive.see(15, pose=AWAY, sure=False)
    assert drive.cells() == (0, post, wall)


def test_control_without_the_rule_it_stays_a_person() -> None:
    drive = Drive(dataclasses.replace(DEFAULT, people_s=600.0))
    drive.see(12, pose=AWAY, sure=False)
    drive.see(1)
    named, _, _ = drive.cells()
    drive.see(55, pose=AWAY, sure=False)
    assert drive.cells()[0] == named > 0


def test_a_person_whom_the_tracker_follows_stays_for_as_long_as_it_does() -> None:
    drive = Drive()
    drive.see(15)
    named, _, _ = drive.cells()
    kept_s = drive.navigator.config.perception.people.standing_unseen_s
    drive.see(round(10 * kept_s) - 20, pose=AWAY, sure=False)
    assert drive.cells()[0] == named > 0
    drive.see(20 + 10 * 6, pose=AWAY, sure=False)
    assert drive.cells()[0] == 0


def test_a_map_that_is_loaded_holds_no_people() -> None:
    first, second = Drive(), Drive()
    first.see(15)
    second.navigator.map.restore(first.navigator.map.state())
    second.navigator.adopt_map()
    assert second.cells()[0] > 0
    for _ in range(30):
        second.see(1, sure=False)
        if second.navigator.place.is_known:
            break
    assert second.cells()[0] == 0


def test_their_bodies_go_with_them_and_a_wall_behind_stays() -> None:
    drive = Drive()
    drive.see(15)
    _, post, wall = drive.cells()
    assert post > 0
    drive.navigator.map.forget_people(BEWARE.people_ids)
    assert drive.cells() == (0, 0, wall)
