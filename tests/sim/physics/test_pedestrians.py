"""Walkers begin and pause where their line says, and go on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2
from navcore.robot.profile import HUSKY
from sim.physics.pedestrians import BODY_DIAMETER_M, Walker
from sim.scenario.load import load_scenario
from sim.scenario.schema import Person

AFAR = Pose2(x_m=50.0, y_m=0.0, yaw_rad=0.0)
PERIOD_S = 0.01


def xs(person: Person, seconds: float) -> list[float]:
    """Return x once a second."""
    walker = Walker(person, np.random.default_rng(0), PERIOD_S)
    seen = [walker.pose.x_m]
    for step in range(1, round(seconds / PERIOD_S) + 1):
        walker.step(AFAR)
        if step % 100 == 0:
            seen.append(round(walker.pose.x_m, 2))
    return seen


def test_a_walker_begins_at_the_given_share_and_turns_at_the_end() -> None:
    person = Person(points=((0.0, 0.0), (4.0, 0.0)), speed_mps=1.0, begins_at=0.5)
    assert xs(person, 4) == pytest.approx([2.0, 3.0, 4.0, 3.0, 2.0], abs=0.03)


def test_a_walker_pauses_at_each_point_for_the_given_time() -> None:
    person = Person(
        points=((0.0, 0.0), (2.0, 0.0), (0.0, 0.0)),
        speed_mps=1.0,
        begins_at=0.0,
        pauses_s=(0.0, 2.0, 100.0),
    )
    assert xs(person, 8) == pytest.approx([0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0, 0.0, 0.0], abs=0.03)


def test_who_does_not_yield_walks_until_they_touch_the_robot_and_turns_back_later() -> None:
    person = Person(points=((0.0, 0.0), (9.0, 0.0)), speed_mps=1.0, begins_at=0.0, yields=False)
    walker, robot = (
        Walker(person, np.random.default_rng(0), PERIOD_S),
        Pose2(x_m=3.0, y_m=0.2, yaw_rad=0.0),
    )
    seen = []
    for _ in range(700):
        walker.step(robot)
        seen.append(walker.pose.x_m)
    touched_m = 3.0 - HUSKY.length_m / 2 - BODY_DIAMETER_M / 2
    assert max(seen) == pytest.approx(touched_m, abs=0.011) and max(seen) <= touched_m
    assert seen[-1] < 1.0


def test_who_stands_in_the_robot_may_walk_out_of_it() -> None:
    person = Person(points=((0.0, 0.0), (9.0, 0.0)), speed_mps=1.0, begins_at=0.5, yields=False)
    walker = Walker(person, np.random.default_rng(0), PERIOD_S)
    for _ in range(100):
        walker.step(Pose2(x_m=4.2, y_m=0.0, yaw_rad=0.0))
    assert walker.pose.x_m == pytest.approx(5.5, abs=0.02)


def test_pauses_must_be_one_for_each_point(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(
        'name = "bad"\nsize_m = [8.0, 8.0]\nstart = [0.0, 0.0, 0.0]\n[map]\nsize_m = [9.0, 9.0]\n'
        "[[people]]\npoints = [[2.0, 0.0], [2.0, 2.0]]\npauses_s = [1.0]\n",
        encoding="utf-8",
    )
    with pytest.raises(BadConfiguration, match="pauses_s"):
        load_scenario(path)
