"""Random missions and zones are reachable and can be bypassed, and detections are counted by the
truth."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely

from navcore.errors import BadConfiguration
from navcore.geometry.camera import back_project_pixels
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.grid.grid import GridSpec
from navcore.robot.profile import HUSKY
from sim.referee.detections import DetectionScore
from sim.referee.referee import Referee
from sim.scenario.load import load_scenario
from sim.scenario.schema import Furniture, Item, MapExtent, Marking, Person, Scenario
from sim.scenario.variation import randomise
from sim.truth.clearance import grown_obstacles
from sim.truth.random_missions import draw_mission, draw_zones
from tests.sim.worlds import open_floor, seeing, shifted

MARGINS_M = {"landmine": 0.5, "cup": 0.05}


def drawn(scenario: Scenario, seed: int) -> Scenario:
    return draw_mission(
        scenario,
        seed,
        robot=HUSKY,
        margin_m=0.15,
        start_clear_m=1.2,
        start_ahead_m=1.2,
        margins_m=MARGINS_M,
    )


def test_random_missions_in_the_office_have_clearance_and_a_path_and_depend_on_the_seed() -> None:
    office, spec = load_scenario("office"), GridSpec.centred(size_m=(32.0, 22.0), resolution_m=0.05)
    missions = set()
    for seed in range(6):
        scenario = drawn(randomise(office, seed), seed)
        assert scenario == drawn(randomise(office, seed), seed)
        referee = Referee(scenario)
        path_m = referee.shortest_m(spec, HUSKY.width_m / 2 + 0.15, scenario.goals)
        assert (
            path_m is not None
            and path_m >= math.dist(scenario.start[:2], scenario.goals[0]) - 1e-6 >= 4.9
        )
        pose = Pose2(x_m=scenario.start[0], y_m=scenario.start[1], yaw_rad=scenario.start[2])
        referee.observe(t_s=1 / 240, pose=pose, rolling=STANDSTILL, people=(), period_s=1 / 240)
        assert referee.violations() == 0 and referee.min_clearance_m > 0.5
        missions.add((scenario.start, scenario.goals))
    assert len(missions) == 6


def test_no_goal_is_drawn_behind_a_wall_or_in_a_margin() -> None:
    wall = Furniture(kind="box", at=(4.0, 0.0), size_m=(0.2, 20.0, 2.0))
    mine = Item(kind="landmine", at=(-3.0, 0.0))
    for seed in range(12):
        scenario = drawn(open_floor(furniture=(wall,), items=(mine,)), seed)
        assert (scenario.start[0] < 4.0) == (scenario.goals[0][0] < 4.0)
        assert math.dist(scenario.goals[0], mine.at) > HUSKY.width_m / 2 + 0.15 + 0.5


def test_a_world_without_clearance_is_refused_in_one_sentence() -> None:
    tight = dataclasses.replace(open_floor(), size_m=(2.0, 2.0), map=MapExtent(size_m=(2.0, 2.0)))
    with pytest.raises(BadConfiguration, match="too small or too full"):
        drawn(tight, 0)


def test_where_a_wide_clearance_leaves_one_corner_to_start_in_it_is_refused() -> None:
    world = randomise(load_scenario("clutter"), 0)
    with pytest.raises(BadConfiguration, match="starts that differ"):
        drawn(world, 0)
    starts = set()
    for seed in range(8):
        scenario = draw_mission(
            world,
            seed,
            robot=HUSKY,
            margin_m=0.15,
            start_clear_m=0.91,
            start_ahead_m=1.2,
            margins_m=MARGINS_M,
        )
        ahead = scenario.start_pose.to_parent(np.array([(0.0, -0.35), (1.2, -0.35), (1.2, 0.35)]))
        floor = shapely.Polygon([*ahead, scenario.start_pose.to_parent(np.array([0.0, 0.35]))])
        outlines = [shapely.Polygon(one) for one in grown_obstacles(scenario, MARGINS_M, HUSKY)]
        assert not shapely.intersects(outlines, floor).any()
        starts.add((scenario.start[0] > 0.0, scenario.start[1] > 0.0))
    assert len(starts) >= 3


def test_zones_lie_on_the_path_and_leave_another() -> None:
    scenario = dataclasses.replace(open_floor(start=(-8.0, 0.0, 0.0)), goals=((8.0, 0.0),))
    spec = GridSpec.centred(size_m=(20.0, 20.0), resolution_m=0.05)
    for seed in range(6):
        zones = draw_zones(scenario, seed, 2, robot=HUSKY, inflation_m=0.5, margins_m={})
        assert len(zones) == 2
        straight = shapely.LineString([(-8.0, 0.0), (8.0, 0.0)])
        assert shapely.distance(shapely.Polygon(zones[0]), straight) < 0.5
        referee = Referee(scenario)
        before_m = referee.shortest_m(spec, 0.5, scenario.goals)
        referee.set_zones([np.array(zone) for zone in zones])
        after_m = referee.shortest_m(spec, 0.5, scenario.goals)
        assert before_m is not None and after_m is not None and after_m > before_m + 0.01


def test_what_was_seen_and_is_not_on_the_map_is_missed_and_what_is_not_there_is_false() -> None:
    hidden = Item(kind="bottle", at=(2.0, -1.0))
    scenario = open_floor(
        items=(Item(kind="cup", at=(2.0, 0.0)), hidden, Item(kind="book", at=(-3.0, 0.0))),
        markings=(Marking(name="red", polygon=shifted(2.5, 1.5)),),
        furniture=(Furniture(kind="box", at=(1.4, -0.7), size_m=(0.2, 0.5, 1.5)),),
    )
    score, spec = DetectionScore(scenario), GridSpec.centred(size_m=(20.0, 20.0), resolution_m=0.05)
    with seeing(scenario) as simulator:
        for _ in range(3):
            frame = simulator.capture()
            person = Pose2(x_m=-4.0, y_m=0.0, yaw_rad=0.0)
            score.observe(frame, simulator.true_pose().matrix() @ frame.T_base_camera, [person])
    nothing = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    red, cup = nothing.copy(), nothing.copy()
    red[spec.cell(2.5, 1.5)] = True
    cup[spec.cell(-6.0, 6.0)] = cup[spec.cell(-6.05, 6.05)] = cup[spec.cell(6.0, 6.0)] = True
    people = nothing.copy()
    people[spec.cell(-4.3, 0.2)] = people[spec.cell(4.0, -4.0)] = True  # one where a person was
    held = {"red floor": red, "cup": cup, "person": people, "bottle": nothing, "book": nothing}
    found = score.counts_by_class(held, spec)
    none = {"there": 0, "seen": 0, "not_passed": 0, "missed": 0, "false": 0}
    assert found["red floor"] == {**none, "there": 1, "seen": 1}
    assert found["cup"] == {**none, "there": 1, "seen": 1, "missed": 1, "false": 2}
    assert found["bottle"] == {**none, "there": 1, "not_passed": 1}  # behind the box
    assert found["book"]["not_passed"] == 1  # behind the robot
    assert found["person"] == {**none, "false": 1}
    assert all(one["there"] == one["seen"] + one["not_passed"] for one in found.values())

    unlisted = score.counts_by_class({"cup": red}, spec)  # which is real by any name
    assert unlisted == {"cup": {**none, "there": 1, "seen": 1, "missed": 1}}

    # A map that has drifted by 1 m holds what it shows there.
    drifted = {name: np.roll(cells, 20, axis=1) for name, cells in held.items()}
    drifted["person"] = people
    shift = np.array([1.0, 0.0])
    assert score.counts_by_class(drifted, spec, lambda outline: outline + shift) == found
    assert score.counts_by_class(drifted, spec) != found


def test_a_thing_is_not_held_by_the_cells_of_the_one_beside_it() -> None:
    things = (Item(kind="cup", at=(2.0, 0.0)), Item(kind="bottle", at=(2.0, 0.3)))
    scenario = open_floor(items=things)
    score, spec = DetectionScore(scenario), GridSpec.centred(size_m=(20.0, 20.0), resolution_m=0.05)
    with seeing(scenario) as simulator:
        for _ in range(3):
            frame = simulator.capture()
            score.observe(frame, simulator.true_pose().matrix() @ frame.T_base_camera)
    nothing = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
    for y_m, held in ((0.0, "cup"), (0.1, "cup"), (0.22, "bottle"), (0.5, "bottle")):
        cells = nothing.copy()
        cells[spec.cell(2.0, y_m)] = True
        found = score.counts_by_class({"cup": nothing, "bottle": cells}, spec)
        missed = {name for name, counts in found.items() if counts["missed"]}
        assert missed == {"cup", "bottle"} - {held}
        assert not found["bottle"]["false"]


@pytest.mark.parametrize("name", ["cup", "red floor", "person", "spill"])
def test_the_labels_of_the_simulator_lie_on_the_objects(name: str) -> None:
    scenario = open_floor(
        items=(Item(kind="cup", at=(1.5, 0.0)),),
        markings=(
            Marking(name="mat", polygon=shifted(0.0, 3.0), beware=False),
            Marking(name="red", polygon=shifted(3.0, 1.5)),
            Marking(name="puddle", polygon=shifted(3.0, -1.5), surface="water"),
        ),
        people=(Person(points=((4.5, 0.0),)),),
    )
    at = {"cup": (1.5, 0.0), "red floor": (3.0, 1.5), "spill": (3.0, -1.5), "person": (4.5, 0.0)}[
        name
    ]
    with seeing(scenario) as simulator:
        frame, shown = simulator.capture(), simulator.true_labels()
        T_map_camera = simulator.true_pose().matrix() @ frame.T_base_camera
    rows, cols = np.nonzero(shown[name])
    assert len(rows) > 20
    z = frame.depth_m[rows, cols]
    optical = back_project_pixels(rows, cols, z, frame.intrinsics)
    points = (optical @ T_map_camera[:3, :3].T + T_map_camera[:3, 3])[z > 0, :2]
    assert np.median(np.hypot(*(points - at).T)) < 0.5
    assert not any((shown[name] & other).any() for key, other in shown.items() if key != name)
