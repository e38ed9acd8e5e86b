"""No map keeps people: neither those in whom no tracker believes, nor those of a map that is
loaded; what depth shows of them stays an obstacle while it may be one."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from navcore.config.mapping import MappingConfig
from navcore.config.navigator import NavigatorConfig
from navcore.costmap.costmap import layer_grid
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mapping.mapper import Mapper
from navcore.mapping.people_sightings import PeopleSightings
from navcore.mission.beware_list import PERSON, BewareClass, BewareList
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.labels import Labels, LabelSource
from navcore.perception.people.track import Track
from navcore.perception.people.tracker import PeopleTracker
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

    def __init__(self, rules: MappingConfig = DEFAULT, post: Box = POST) -> None:
        config = dataclasses.replace(NavigatorConfig(), map=rules)
        self.people: tuple[Track, ...] = ()
        self.network, self._post, self._tenths = CallsThePostAPerson(), post, 0
        self.navigator = Navigator(spec=SPEC, profile=HUSKY, segmenter=self.network, config=config)

    def see(self, frames: int, *, pose: Pose2 = ORIGIN, sure: bool = True) -> None:
        """Process so many frames, ten a second."""
        self.network.sure = sure
        for _ in range(frames):
            frame = picture(self._post, WALL, pose=pose, stamp_ns=self._tenths * _TENTH_NS)
            self.people = self.navigator.tick(frame, ORDER).people
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


def test_a_person_in_view_stays_one_wherever_the_robot_saw_them_first() -> None:
    """Also one whom the tracker cannot tell from what they sit at."""
    drive = Drive(post=dataclasses.replace(POST, y=(-1.2, 1.2)))
    drive.see(5)
    there = Pose2(x_m=-0.3, y_m=0.0, yaw_rad=0.0)
    for _ in range(70):
        drive.see(1, pose=there)
        assert drive.cells()[0] > 0
    assert not drive.people
    drive.see(60, pose=AWAY, sure=False)
    assert drive.cells()[0] == 0


def test_one_place_gets_old_while_a_person_is_seen_at_another() -> None:
    sightings = PeopleSightings(5.0)
    sightings.note(np.array([[1.1, 1.1]]), 0)
    for second in range(7):
        sightings.note(np.array([[4.2, -2.2]]), second * 10**9)
        cells = sightings.take_old(second * 10**9, SPEC)
        assert bool(len(cells)) == (second == 5)
        if second == 5:
            rows, cols = np.divmod(cells, SPEC.cols)
            at = SPEC.centres(np.column_stack([rows, cols]))
            assert np.abs(at - (1.25, 1.25)).max() == pytest.approx(0.75, abs=0.06)


def test_what_is_beside_a_new_sighting_does_not_get_old_and_time_may_run_backwards() -> None:
    sightings = PeopleSightings(5.0)
    sightings.note(np.array([[1.1, 1.1]]), 0)
    sightings.note(np.array([[1.6, 1.1]]), 4 * 10**9)
    cells = sightings.take_old(6 * 10**9, SPEC)
    assert SPEC.centres(np.column_stack(np.divmod(cells, SPEC.cols)))[:, 0].max() < 2.0
    (row, col) = SPEC.cell(1.6, 1.1)
    assert row * SPEC.cols + col not in cells
    assert len(sightings.take_old(10**9, SPEC)) > 0
    assert len(sightings.take_old(10**9, SPEC)) == 0


def test_a_followed_person_is_seen_all_around() -> None:
    sightings = PeopleSightings(5.0)
    sightings.note(np.array([[1.1, 1.1]]), 0)
    sightings.note(np.array([[2.0, 1.1]]), 4 * 10**9, 1.0)
    (row, col) = SPEC.cell(1.1, 1.1)
    assert row * SPEC.cols + col not in sightings.take_old(6 * 10**9, SPEC)


@pytest.mark.parametrize("is_told", [True, False], ids=["told", "control"])
def test_people_whom_a_correction_has_moved_get_old_where_they_are_now(is_told: bool) -> None:
    drive = Drive()
    drive.see(12, pose=AWAY, sure=False)
    drive.see(1)
    point_map, mapper = (
        drive.navigator.map,
        Mapper(drive.navigator.map, PeopleTracker(), HUSKY, NavigatorConfig()),
    )

    def look(stamp_ns: int) -> None:
        frame = picture(WALL, pose=AWAY, stamp_ns=stamp_ns)
        drive.network.sure = False
        mapper.update(frame, drive.network.segment(frame, BEWARE), BEWARE)

    mapper.update(
        picture(POST, WALL, stamp_ns=0),
        drive.network.segment(picture(POST, WALL), BEWARE),
        BEWARE,
    )
    point_map.correct(
        {
            k: Pose2(x_m=p.x_m, y_m=p.y_m + 2.0, yaw_rad=p.yaw_rad)
            for k, p in enumerate(point_map.poses)
        }
    )
    if is_told:
        mapper.follow_correction()
    look(10**9)
    assert drive.cells()[0] > 0
    look(7 * 10**9)
    assert (drive.cells()[0] == 0) is is_told


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


@pytest.mark.parametrize(("x_m", "body_stays"), [(-1.0, False), (1.0, True)])
def test_their_bodies_go_with_them_where_they_are_far(x_m: float, body_stays: bool) -> None:
    """What is near may be out of the camera's sight when the robot is switched on."""
    drive = Drive()
    drive.see(15)
    _, post, wall = drive.cells()
    assert post > 0
    drive.navigator.map.forget_people(BEWARE.people_ids, Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0))
    assert drive.cells() == (0, post if body_stays else 0, wall)


def test_without_people_on_the_list_those_of_a_loaded_map_are_forgotten_later() -> None:
    drive = Drive()
    drive.see(15)
    mapper = Mapper(drive.navigator.map, PeopleTracker(), HUSKY, NavigatorConfig())
    mapper.begin_loaded_map()
    frame = picture(WALL, pose=AWAY, stamp_ns=10**10)
    drive.network.sure = False
    labels = drive.network.segment(frame, BEWARE)
    mapper.update(frame, labels, BewareList(classes=()))
    assert drive.cells()[0] > 0
    mapper.update(frame, labels, BEWARE)
    assert drive.cells()[0] == 0
