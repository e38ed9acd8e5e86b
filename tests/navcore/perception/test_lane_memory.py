"""A person who walks to and fro is expected back on their lane, where the camera does not look."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from navcore.config.perception.perception import LaneMemoryConfig
from navcore.geometry.arrays import Bools, Points
from navcore.perception.people.lane_memory import LaneMemory
from navcore.perception.people.track import Track

RULES = LaneMemoryConfig()
STEP_S, SPEED_MPS = 0.1, 0.8
GIVEN_UP_S = 8.0


def walker(x_m: float, vx_mps: float, *, unseen_s: float = 0.0, track: int = 1) -> Track:
    return Track(
        id=track,
        x_m=x_m,
        y_m=0.0,
        vx_mps=vx_mps,
        vy_mps=0.0,
        radius_m=0.3,
        age_s=5.0,
        last_seen_ns=0,
        unseen_s=unseen_s,
        walking_speed_mps=abs(vx_mps),
    )


def nowhere(positions: Points) -> Bools:
    return np.zeros(len(positions), dtype=np.bool_)


def beyond(x_m: float) -> Callable[[Points], Bools]:
    """The camera shows the floor beyond a position."""
    return lambda positions: positions[:, 0] > x_m


class Scene:
    """A memory and its clock."""

    def __init__(self) -> None:
        self.memory, self.now_s = LaneMemory(), 0.0

    def see(self, *people: Track, free: Callable[[Points], Bools] = nowhere) -> None:
        self.memory.follow(people, free(self.memory.positions), self.now_s)
        self.now_s += STEP_S

    def walk(self, from_m: float, to_m: float, *, track: int = 1) -> None:
        steps = round(abs(to_m - from_m) / (SPEED_MPS * STEP_S))
        for x_m in np.linspace(from_m, to_m, steps).tolist():
            self.see(walker(x_m, np.sign(to_m - from_m) * SPEED_MPS, track=track))

    def wait(self, seconds: float, free: Callable[[Points], Bools] = nowhere) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.see(free=free)

    @property
    def hidden_m(self) -> list[float]:
        return sorted(self.memory.hidden[:, 0].tolist())


def to_and_fro(*, second_track: int = 1) -> Scene:
    """A person walked from 0 to 4 m and back to 1 m."""
    scene = Scene()
    scene.walk(0.0, 4.0)
    scene.walk(4.0, 1.0, track=second_track)
    return scene


@pytest.mark.parametrize("second_track", [1, 2])
def test_a_person_who_came_back_may_be_on_all_of_the_lane_when_no_track_tells(
    second_track: int,
) -> None:
    scene = to_and_fro(second_track=second_track)
    assert scene.hidden_m == []  # in sight
    scene.wait(4.0 / SPEED_MPS)
    assert scene.hidden_m[0] < 0.3 and scene.hidden_m[-1] > 3.7
    assert max(np.diff(scene.hidden_m)) < 2 * RULES.spacing_m


def test_the_person_comes_from_where_they_were_lost_as_fast_as_they_walk() -> None:
    scene = to_and_fro()
    for elapsed_s in (1.0, 2.0):
        scene.wait(1.0)
        reach_m = SPEED_MPS * elapsed_s
        within = [abs(x_m - 1.0) for x_m in scene.hidden_m]
        assert reach_m - 0.4 < max(within) < reach_m + 0.4


def test_they_are_not_where_the_camera_shows_the_floor_and_return_only_from_elsewhere() -> None:
    scene = to_and_fro()
    scene.wait(6.0)
    scene.wait(1.0, free=beyond(2.0))
    assert scene.hidden_m[-1] <= 2.0
    scene.wait(1.0)
    assert 2.3 < scene.hidden_m[-1] < 3.1
    scene.wait(0.2, free=beyond(-1.0))
    scene.wait(5.0)
    assert scene.hidden_m == []  # all of the lane was seen: the person is elsewhere


def test_a_track_tells_where_the_person_is_though_they_are_out_of_sight() -> None:
    scene = to_and_fro()
    for tenths in range(round(GIVEN_UP_S * 10)):
        unseen_s = tenths / 10
        scene.see(walker(1.0 - SPEED_MPS * unseen_s, -SPEED_MPS, unseen_s=unseen_s))
        assert scene.hidden_m == []
    scene.see()
    assert scene.hidden_m != []


def test_another_person_far_from_the_lane_does_not() -> None:
    scene, elsewhere = to_and_fro(), dataclasses.replace(walker(2.0, 0.5, track=7), y_m=5.0)
    for _ in range(60):
        scene.see(elsewhere)
    assert scene.hidden_m != []


def test_each_lane_has_its_own_person() -> None:
    scene = to_and_fro()
    there = dataclasses.replace(walker(2.0, 0.5, track=7), y_m=3.0)
    for at_m in [*np.arange(0.0, 4.0, 0.08), *np.arange(4.0, 0.0, -0.08)]:
        scene.see(dataclasses.replace(there, x_m=at_m))
    scene.see(there)
    assert scene.hidden_m != []
    assert (scene.memory.hidden[:, 1] < 1.0).all()


def test_who_only_passes_or_stops_for_a_while_and_walks_on_is_not_expected_back() -> None:
    scene = Scene()
    scene.walk(0.0, 2.0)
    standing = dataclasses.replace(walker(2.0, 0.0), walking_speed_mps=SPEED_MPS)
    for _ in range(50):
        scene.see(standing)
    scene.walk(2.0, 4.0)
    scene.wait(10.0)
    assert scene.hidden_m == []


def test_a_person_is_not_expected_for_ever() -> None:
    scene = to_and_fro()
    scene.wait(RULES.remembered_s - 4.0)
    assert scene.hidden_m != []
    scene.wait(5.0)
    assert len(scene.memory.positions) == 0 and scene.hidden_m == []


def test_the_memory_is_bounded_and_keeps_the_newest() -> None:
    memory = LaneMemory(dataclasses.replace(RULES, max_positions=20))
    for step in range(60):
        one = walker(step * 0.5, SPEED_MPS)
        memory.follow((one,), nowhere(memory.positions), step * STEP_S)
    assert len(memory.positions) <= 21
    assert memory.positions[-1, 0] == pytest.approx(29.5)


def test_a_clock_that_jumps_back_forgets() -> None:
    scene = to_and_fro()
    scene.memory.follow((), nowhere(scene.memory.positions), -10.0)
    assert len(scene.memory.positions) == 0
