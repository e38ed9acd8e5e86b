"""With a laser scanner people are followed all round; without it only where the camera looks."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navcore.geometry.transform import Pose2
from navcore.mission.beware_list import BewareList
from navcore.perception.labels import Labels
from navcore.perception.people.track import Track
from navcore.perception.people.tracker import PeopleTracker
from navcore.robot.frame import Frame
from tests.navcore.scene import ORIGIN, Box, picture, scanned

TENTH_NS = 100_000_000
NO_LIST = BewareList(classes=())
WALLS = (
    Box(x=(4.0, 4.1), y=(-5.0, 5.0), z=(0.0, 2.5)),
    Box(x=(-4.1, -4.0), y=(-5.0, 5.0), z=(0.0, 2.5)),
    Box(x=(-2.5, -2.0), y=(1.5, 1.9), z=(0.0, 0.9)),
)


def person_at(x_m: float, y_m: float) -> tuple[Box, Box]:
    """Return the two legs of a person, with the middle at a position."""
    legs = ((y_m - 0.18, y_m - 0.02), (y_m + 0.02, y_m + 0.18))
    left, right = (Box(x=(x_m - 0.08, x_m + 0.08), y=leg, z=(0.0, 1.75)) for leg in legs)
    return left, right


def unlabelled(frame: Frame) -> Labels:
    return Labels(
        class_ids=np.zeros(frame.depth_m.shape, np.uint8),
        confidence=np.ones(frame.depth_m.shape, np.float32),
    )


def follow(
    walk: list[tuple[float, float] | None], *, scanner: bool, pose: Pose2 = ORIGIN
) -> list[tuple[Track, ...]]:
    """Return the people after each tenth of a second, in which a person is at the next position of
    a walk, or nowhere."""
    tracker, found = PeopleTracker(), []
    for i, at in enumerate(walk):
        things = (*WALLS, *(() if at is None else person_at(*at)))
        frame = picture(*things, pose=pose, stamp_ns=(i + 1) * TENTH_NS)
        if scanner:
            frame = dataclasses.replace(frame, scan=scanned(*things, pose=pose))
        found.append(tracker.follow(frame, unlabelled(frame), NO_LIST))
    return found


def overtaking(seconds: float) -> list[tuple[float, float] | None]:
    """Return the walk of a person behind the robot and to its right, 0.8 m/s along its heading."""
    return [(-3.0 + 0.08 * i, -1.0) for i in range(round(10 * seconds))]


def test_a_person_who_comes_from_behind_is_followed() -> None:
    walk = overtaking(3.0)
    tracks = follow(walk, scanner=True)
    (person,) = tracks[-1]
    x_m, y_m = walk[-1] or (0.0, 0.0)
    assert abs(person.x_m - x_m) < 0.15
    assert abs(person.y_m - y_m) < 0.15
    assert abs(person.vx_mps - 0.8) < 0.2
    assert abs(person.vy_mps) < 0.2
    assert sum(bool(people) for people in tracks) > 15
    # The control: no camera that looks ahead sees them.
    assert not any(follow(walk, scanner=False))


def test_a_person_who_walks_out_of_the_camera_s_view_stays_the_same_person() -> None:
    walk: list[tuple[float, float] | None] = [(2.5 - 0.08 * i, -1.3) for i in range(50)]
    tracks = follow(walk, scanner=True)
    assert {person.id for people in tracks[-40:] for person in people} == {
        person.id for person in tracks[-1]
    }
    (person,) = tracks[-1]
    assert person.unseen_s == 0.0
    assert abs(person.x_m - (2.5 - 0.08 * 49)) < 0.15


def test_a_person_who_is_gone_is_given_up_as_soon_as_the_scanner_shows_the_floor() -> None:
    walk = [*overtaking(2.0), *[None] * 15]
    assert follow(walk, scanner=True)[len(walk) - 15]
    assert not follow(walk, scanner=True)[-1]


def test_one_who_leaves_the_range_of_people_is_expected_though_the_scanner_reaches_on() -> None:
    tracker = PeopleTracker()
    found: list[tuple[Track, ...]] = []
    for i in range(65):
        person = person_at(-2.0 - 0.08 * i, -1.0)  # after 4.3 s farther than people are looked for
        frame = picture(*person, stamp_ns=(i + 1) * TENTH_NS)
        frame = dataclasses.replace(frame, scan=scanned(*person))
        found.append(tracker.follow(frame, unlabelled(frame), NO_LIST))
    (before,), (after,) = found[40], found[-1]
    assert after.id == before.id
    assert after.unseen_s > 1.0


def test_a_robot_that_turns_among_walls_sees_no_people() -> None:
    tracker = PeopleTracker()
    for i in range(60):
        pose = Pose2(x_m=0.01 * i, y_m=0.0, yaw_rad=0.06 * i)
        frame = picture(*WALLS, pose=pose, stamp_ns=(i + 1) * TENTH_NS)
        frame = dataclasses.replace(frame, scan=scanned(*WALLS, pose=pose))
        assert not tracker.follow(frame, unlabelled(frame), NO_LIST)


CAME: list[tuple[float, float] | None] = [(3.0 - 0.08 * i, 0.0) for i in range(24)]
"""Walk of a person who comes up to the robot."""


@pytest.mark.parametrize("scanner", [True, False])
def test_a_person_who_came_up_to_the_robot_and_has_gone_is_given_up(scanner: bool) -> None:
    """The camera measures past where they stood, though it does not see the floor there."""
    walk = [*CAME, *[None] * 38]
    assert follow(walk, scanner=scanner)[len(CAME) - 1]
    assert not follow(walk, scanner=scanner)[-1]


def test_one_who_steps_aside_before_the_robot_is_expected_there_for_some_seconds() -> None:
    """The camera, which measures past where they came, does not see its flank."""
    aside: list[tuple[float, float] | None] = [(0.9, -0.8)] * 24
    assert follow([*CAME, *aside], scanner=False)[-1]


def test_one_who_is_too_near_to_be_measured_may_still_stand_there() -> None:
    tracker, empty = PeopleTracker(), picture(*WALLS).depth_m
    for i, at in enumerate([*CAME, *[None] * 15]):
        frame = picture(*WALLS, *person_at(*(at or (1.0, 0.0))), stamp_ns=(i + 1) * TENTH_NS)
        if at is None:
            blind = np.where(frame.depth_m == empty, frame.depth_m, np.float32(0.0))
            frame = dataclasses.replace(frame, depth_m=blind)
        people = tracker.follow(frame, unlabelled(frame), NO_LIST)
    (person,) = people
    assert person.x_m < 1.2
