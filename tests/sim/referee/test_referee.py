"""The referee counts every contact and intrusion once, and tells who caused it."""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import ValuesView

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.grid import GridSpec
from navcore.robot.profile import HUSKY
from sim.models.solids import Polygon, rectangle
from sim.referee.clearance import Outlines, distance_m
from sim.referee.contacts import Contacts
from sim.referee.referee import Referee
from sim.robot.skid_steer import pose_of
from sim.scenario.layout import items
from sim.scenario.schema import Furniture, Item, Marking, Person, Scenario
from tests.sim.worlds import blind, drive, open_floor, shifted, wait

PERIOD_S = 1 / 240
BOX = Furniture(kind="box", at=(2.0, 0.0), size_m=(1.0, 1.0, 1.0))


def pass_by(referee: Referee, y_m: float, *, speed_mps: float = 1.0) -> None:
    """Move along y = y_m from x = −1 to 5 without physics."""
    for step in range(round(6.0 / speed_mps * 240) + 1):
        pose = Pose2(x_m=-1.0 + step * speed_mps * PERIOD_S, y_m=y_m, yaw_rad=0.0)
        rolling = Twist(v_mps=speed_mps, w_radps=0.0)
        referee.observe(
            t_s=(step + 1) * PERIOD_S, pose=pose, rolling=rolling, people=(), period_s=PERIOD_S
        )


def right_end_m(scenario: Scenario) -> float:
    """y of the corner of the items that lies farthest to the right."""
    return min(
        float(outline[:, 1].min()) for item in items(scenario) for outline in item.outlines()
    )


def test_a_near_miss_is_measured_and_is_no_contact() -> None:
    referee = Referee(open_floor(furniture=(BOX,)))
    pass_by(referee, 0.5 + 0.35 + 0.07)
    assert referee.collisions == 0
    assert referee.min_clearance_m == pytest.approx(0.07, abs=1e-6)


def test_a_contact_counts_once_however_long_it_lasts() -> None:
    referee = Referee(open_floor(furniture=(BOX,)))
    pass_by(referee, 0.8)
    assert referee.collisions == 1 and referee.min_clearance_m == 0.0


def test_two_objects_struck_are_two_collisions() -> None:
    other = Furniture(kind="cylinder", at=(4.0, 0.3))
    referee = Referee(open_floor(furniture=(BOX, other)))
    pass_by(referee, 0.8)
    assert referee.collisions == 2
    log = referee.summary()["contacts"]
    assert [(contact["what"], contact["collided"]) for contact in log] == [
        ("box", True),
        ("cylinder", True),
    ]


def test_the_physical_robot_collides_with_a_box_before_it() -> None:
    with blind(open_floor(furniture=(BOX,))) as simulator:
        drive(simulator, 0.5, 0.0, 3.0)
        assert simulator.referee.collisions == 1
        assert simulator.true_pose().x_m < 1.05  # the box has held it
        wait(simulator, 0.5)
        assert simulator.referee.collisions == 1


@pytest.mark.parametrize(
    "scenario", [open_floor(markings=(Marking(name="red", polygon=shifted(2.0, 0.0)),))]
)
def test_an_intrusion_counts_once_with_its_duration(scenario: Scenario) -> None:
    referee = Referee(scenario)
    pass_by(referee, 0.0)
    assert referee.beware_intrusions == 1 and referee.collisions == 0
    assert referee.beware_intrusion_s == pytest.approx(
        2.0, abs=0.02
    )  # 1 m of area and 1 m of robot at 1 m/s
    clear = Referee(scenario)
    pass_by(clear, 0.86)
    assert clear.beware_intrusions == 0 and clear.beware_intrusion_s == 0.0


@pytest.mark.parametrize("yaw_rad", [0.0, 0.4])
def test_an_intrusion_is_weighed_by_the_area_of_the_footprint_in_it(yaw_rad: float) -> None:
    marking = Marking(name="red", polygon=((2.0, -3.0), (9.0, -3.0), (9.0, 3.0), (2.0, 3.0)))
    over_it_twice = Marking(
        name="red too", polygon=((2.0, -3.0), (9.0, -3.0), (9.0, 3.0), (2.0, 3.0))
    )
    referee = Referee(open_floor(markings=(marking, over_it_twice)))
    pose = Pose2(
        x_m=2.0, y_m=0.0, yaw_rad=yaw_rad
    )  # its middle on the edge: half of it is inside, however it is turned
    for step in range(240):
        referee.observe(
            t_s=(step + 1) * PERIOD_S, pose=pose, rolling=STANDSTILL, people=(), period_s=PERIOD_S
        )
    half_m2 = HUSKY.length_m * HUSKY.width_m / 2
    assert referee.summary()["beware_intrusion_m2s"] == pytest.approx(
        half_m2, abs=1e-4
    )  # a union: nothing counts twice
    assert referee.summary()["intruded"] == {"red": 1, "red too": 1}
    assert referee.beware_intrusion_s == pytest.approx(1.0)


def test_a_corner_of_the_footprint_is_enough_to_intrude() -> None:
    corner = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi / 4)
    reach_m = HUSKY.circumscribed_radius_m
    bearing = math.pi / 4 + math.atan2(HUSKY.width_m, HUSKY.length_m)
    for out_m, times in ((0.01, 0), (-0.01, 1)):
        x, y = (
            (reach_m + 0.1 + out_m) * math.cos(bearing),
            (reach_m + 0.1 + out_m) * math.sin(bearing),
        )
        small = tuple(
            (x + 0.1 * math.cos(a), y + 0.1 * math.sin(a))
            for a in np.arange(64) * math.pi / 32 + bearing
        )
        referee = Referee(open_floor(markings=(Marking(name="red", polygon=small),)))
        referee.observe(t_s=PERIOD_S, pose=corner, rolling=STANDSTILL, people=(), period_s=PERIOD_S)
        assert referee.beware_intrusions == times


def test_a_displaced_item_is_judged_at_its_present_position_too() -> None:
    cup = Item(kind="cup", at=(0.0, 5.0))
    for now, times in (((0.0, 5.0), 0), ((2.0, 0.0), 1)):
        referee = Referee(open_floor(items=(cup,)))
        pose = Pose2(x_m=2.0, y_m=0.3, yaw_rad=0.0)
        lies = (Pose2(x_m=now[0], y_m=now[1], yaw_rad=0.0),)
        referee.observe(
            t_s=PERIOD_S, pose=pose, rolling=STANDSTILL, people=(), period_s=PERIOD_S, items=lies
        )
        assert referee.beware_intrusions == times


def test_the_simulator_tells_the_referee_the_position_of_a_displaced_item() -> None:
    with blind(
        open_floor(items=(Item(kind="bag", at=(1.2, 0.0)),), start=(0.0, 0.0, 0.0))
    ) as simulator:
        drive(simulator, 0.5, 0.0, 3.0)
        wait(simulator, 0.5)
        assert (
            simulator.referee.beware_intrusions == 1
        )  # it lay there, and is pushed on, and is one bag
        assert simulator.referee.summary()["intruded"] == {"bag": 1}


def test_a_bag_that_is_touched_slowly_and_hardly_moves_counts() -> None:
    bag = Item(kind="bag", at=(1.2, 0.0))
    with blind(open_floor(items=(bag,), start=(0.0, 0.0, 0.0))) as simulator:
        lies = pose_of(simulator.client, simulator.world.item_bodies[0])

        def moved_m() -> float:
            now = pose_of(simulator.client, simulator.world.item_bodies[0])
            return lies.distance_to(now.x_m, now.y_m)

        drive(simulator, 0.5, 0.0, 0.6)
        assert moved_m() < 5e-4 and simulator.referee.beware_intrusions == 0
        while moved_m() < 5e-4:
            drive(simulator, 0.05, 0.0, 0.02)
        assert moved_m() < 0.003  # the footprint is not yet over where it lay
        assert simulator.referee.beware_intrusions == 1


def test_an_item_that_is_pushed_beside_its_outline_counts() -> None:
    """The engine has it as a box, of which a corner lies beside the disc here."""
    disc = Item(kind="landmine", at=(1.5, 0.0), yaw_deg=45.0)
    right_m = right_end_m(open_floor(items=(disc,)))
    disc = dataclasses.replace(disc, at=(1.5, HUSKY.width_m / 2 + 0.02 - right_m))
    with blind(open_floor(items=(disc,), start=(0.0, 0.0, 0.0))) as simulator:
        lies = pose_of(simulator.client, simulator.world.item_bodies[0])
        while simulator.true_pose().x_m < 2.5 and simulator.referee.beware_intrusions == 0:
            drive(simulator, 0.5, 0.0, 1 / 240)
        now = pose_of(simulator.client, simulator.world.item_bodies[0])
        assert simulator.referee.beware_intrusions == 1
        assert lies.distance_to(now.x_m, now.y_m) < 0.003, "at the first push"
        assert simulator.referee.min_item_clearance_m > 0.006


def test_the_clearance_from_items_is_apart_from_that_of_walls_and_people() -> None:
    cup = Item(kind="cup", at=(2.0, 0.6))
    referee = Referee(open_floor(items=(cup,), furniture=(BOX,)))
    for y_m in (-1.0, -1.2):
        pass_by(referee, y_m)
    gap_m = right_end_m(open_floor(items=(cup,))) + 1.0 - HUSKY.width_m / 2
    assert referee.summary()["min_item_clearance_m"] == pytest.approx(gap_m, abs=1e-4)
    assert referee.summary()["min_clearance_m"] == pytest.approx(0.15, abs=1e-4)
    assert Referee(open_floor()).min_item_clearance_m == math.inf


@pytest.mark.parametrize("speed_mps", [0.015, 0.5])
def test_a_robot_that_pushes_against_a_wall_which_it_touched_at_rest_collides(
    speed_mps: float,
) -> None:
    """The wall holds it, so only its wheels tell, also where they creep."""
    referee = Referee(open_floor(furniture=(BOX,)))
    pose = Pose2(x_m=1.5 - HUSKY.length_m / 2, y_m=0.0, yaw_rad=0.0)
    steps = math.ceil(0.03 / (speed_mps * PERIOD_S))
    for step in range(steps + 1):
        rolling = Twist(v_mps=speed_mps if step else 0.0, w_radps=0.0)
        referee.observe(
            t_s=step * PERIOD_S, pose=pose, rolling=rolling, people=(), period_s=PERIOD_S
        )
        assert step or referee.collisions == 0
    assert referee.touched and referee.collisions == 1


@pytest.mark.parametrize(("apart_s", "collisions"), [(1.0, 1), (10.0, 0)])
def test_what_is_driven_against_a_person_adds_up_over_contacts_that_follow_each_other(
    apart_s: float, collisions: int
) -> None:
    contacts = Contacts(lambda number: "person", lambda number: True)
    for n in range(3):
        t_s = n * apart_s
        contacts.judge({7: (0.0, 0.0)}, driving=False, t_s=t_s)
        contacts.judge({7: (0.015, 0.015)}, driving=True, t_s=t_s + PERIOD_S)
        contacts.judge({}, driving=True, t_s=t_s + 2 * PERIOD_S)
    assert (contacts.collisions > 0) == (collisions > 0)
    assert contacts.struck_while_standing == 3


def test_who_touches_a_robot_again_that_makes_way_after_a_collision_is_not_driven_into_twice() -> (
    None
):
    contacts = Contacts(lambda number: "person", lambda number: True)
    contacts.judge({7: (0.01, 0.01)}, driving=True, t_s=0.0)
    contacts.judge({7: (0.03, 0.03)}, driving=True, t_s=PERIOD_S)
    contacts.judge({}, driving=True, t_s=1.0)
    for step in range(3):
        contacts.judge({7: (0.0, 0.0)}, driving=True, t_s=2.0 + step * PERIOD_S)
    assert (contacts.collisions, contacts.struck_while_standing) == (1, 1)


def test_a_marking_without_beware_may_be_driven_over() -> None:
    referee = Referee(
        open_floor(markings=(Marking(name="mat", polygon=shifted(2.0, 0.0), beware=False),))
    )
    pass_by(referee, 0.0)
    assert referee.violations() == 0


def test_a_cup_is_judged_by_its_original_position() -> None:
    with blind(open_floor(items=(Item(kind="cup", at=(1.2, 0.0)),))) as simulator:
        drive(simulator, 0.5, 0.0, 2.0)
        assert simulator.referee.beware_intrusions == 1


def test_a_zone_counts_on_entering_but_not_when_it_is_drawn_over_the_robot() -> None:
    zone = np.array(shifted(2.0, 0.0))
    referee = Referee(open_floor())
    referee.set_zones((zone,))
    pass_by(referee, 0.0)
    assert referee.zone_intrusions == 1 and referee.zone_intrusion_s == pytest.approx(2.0, abs=0.02)
    over = Referee(open_floor())
    still = {"rolling": STANDSTILL, "people": (), "period_s": PERIOD_S}
    over.observe(t_s=PERIOD_S, pose=Pose2(x_m=2.0, y_m=0.0, yaw_rad=0.0), **still)  # type: ignore[arg-type]
    over.set_zones((zone,))
    over.observe(t_s=2 * PERIOD_S, pose=Pose2(x_m=2.1, y_m=0.0, yaw_rad=0.0), **still)  # type: ignore[arg-type]
    assert over.zone_intrusions == 0
    over.set_zones(
        (zone, np.array(shifted(9.0, 9.0)))
    )  # another zone changes nothing about this one
    for x_m in (5.0, 2.0):
        over.observe(t_s=1.0, pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0), **still)  # type: ignore[arg-type]
    assert over.zone_intrusions == 1


@pytest.mark.parametrize(("drift_m", "gap_m"), [(0.0, 0.0), (0.2, 0.15)])
def test_an_intrusion_tells_when_it_was_and_how_near_the_robot_came_by_its_odometry(
    drift_m: float, gap_m: float
) -> None:
    referee = Referee(open_floor())
    referee.set_zones((np.array(shifted(9.0, 9.0)), np.array(shifted(2.0, 0.0))))
    y_m = (
        0.5 + HUSKY.width_m / 2 - 0.05
    )  # 5 cm of the footprint over the zone, which reaches to 0.5 m
    for step in range(1, 481):
        t_s = step * PERIOD_S
        believed = Pose2(x_m=2.0 * t_s, y_m=y_m + drift_m, yaw_rad=0.0)
        here = Pose2(x_m=2.0 * t_s, y_m=y_m, yaw_rad=0.0)
        referee.observe(
            t_s=t_s,
            pose=here,
            rolling=Twist(v_mps=2.0, w_radps=0.0),
            people=(),
            period_s=PERIOD_S,
            odometry=believed,
        )
    (intrusion,) = referee.summary()["intrusions"]
    assert intrusion["what"] == "zone 2" and intrusion["gap_by_odometry_m"] == pytest.approx(
        gap_m, abs=1e-3
    )
    assert intrusion["t_s"] == pytest.approx(0.5, abs=0.01) and intrusion[
        "duration_s"
    ] == pytest.approx(1.0, abs=0.02)
    assert referee.zone_intrusions == 1 and referee.zone_intrusion_s == pytest.approx(1.0, abs=0.02)


def walker(yields: bool) -> Person:
    return Person(points=((2.5, 0.0), (-2.5, 0.0)), speed_mps=1.0, yields=yields)


def test_a_person_who_does_not_yield_strikes_the_standing_robot_without_a_collision() -> None:
    with blind(
        open_floor(people=(walker(yields=False),), start=(0.0, 0.0, 0.0)), seed=2
    ) as simulator:
        wait(simulator, 11.0)
        assert simulator.referee.struck_while_standing >= 1
        assert simulator.referee.collisions == 0
        assert {"person"} == {
            contact["what"] for contact in simulator.referee.summary()["contacts"]
        }
        assert simulator.true_pose().distance_to(0.0, 0.0) < 0.01  # it is not pushed


def test_a_person_who_walks_against_the_robot_askew_does_not_push_it_aside() -> None:
    person = Person(points=((1.5, 0.0), (-1.5, 0.0)), speed_mps=0.8, yields=False, begins_at=0.0)
    with blind(open_floor(people=(person,), start=(0.0, -0.42, 0.46)), seed=2) as simulator:
        wait(simulator, 4.0)
        assert simulator.referee.struck_while_standing == 1
        assert simulator.true_pose().distance_to(0.0, -0.42) < 0.02


def test_a_person_who_yields_does_not_strike_the_robot() -> None:
    with blind(
        open_floor(people=(walker(yields=True),), start=(0.0, -1.0, 1.57)), seed=2
    ) as simulator:
        start = simulator.moving_poses()[0]
        for _ in range(110):
            wait(simulator, 0.1)
            drive(simulator, 0.0, 0.0, 0.0)
        assert simulator.moving_poses()[0] != start
        assert simulator.referee.struck_while_standing == 0


@pytest.mark.parametrize(("speed_mps", "collisions"), [(-0.2, 0), (0.2, 1)])
def test_a_robot_that_was_struck_collides_if_it_drives_on_against_the_person_but_not_away(
    speed_mps: float, collisions: int
) -> None:
    referee = Referee(open_floor())
    for step in range(241):  # the person stays in touch with the front, as one who follows
        x_m = 0.0 if step == 0 else step * speed_mps * PERIOD_S
        front_m = x_m + HUSKY.length_m / 2
        referee.observe(
            t_s=step * PERIOD_S,
            pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0),
            rolling=Twist(v_mps=speed_mps if step else 0.0, w_radps=0.0),
            people=(Pose2(x_m=front_m + 0.2, y_m=0.1, yaw_rad=0.0),),
            period_s=PERIOD_S,
        )
    assert referee.struck_while_standing == 1
    assert referee.collisions == collisions


@pytest.mark.parametrize(("speed_mps", "collisions"), [(-0.2, 0), (0.2, 1)])
def test_a_robot_that_pushes_against_a_person_who_stands_in_its_way_drives_into_them(
    speed_mps: float, collisions: int
) -> None:
    """It does not get on, so only its wheels tell."""
    person = Person(points=((1.5, 0.0), (-1.5, 0.0)), speed_mps=0.8, yields=False, begins_at=0.0)
    with blind(open_floor(people=(person,), start=(0.0, 0.0, 0.0)), seed=2) as simulator:
        wait(simulator, 3.0)
        assert simulator.referee.struck_while_standing == 1
        assert simulator.referee.collisions == 0
        drive(simulator, speed_mps, 0.0, 2.0)
        assert simulator.referee.collisions == collisions


@pytest.mark.parametrize(("speed_mps", "collisions"), [(-0.2, 0), (0.2, 1)])
def test_a_person_who_catches_up_with_a_robot_that_drives_away_is_not_driven_into(
    speed_mps: float, collisions: int
) -> None:
    referee = Referee(open_floor())
    for step in range(481):  # the person walks towards the front, and touches it after a while
        x_m = step * speed_mps * PERIOD_S
        gap_m = max(1.0 - 0.8 * step * PERIOD_S, 0.0)
        referee.observe(
            t_s=step * PERIOD_S,
            pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0),
            rolling=Twist(v_mps=speed_mps, w_radps=0.0),
            people=(Pose2(x_m=x_m + HUSKY.length_m / 2 + 0.2 + gap_m, y_m=0.1, yaw_rad=0.0),),
            period_s=PERIOD_S,
        )
    assert referee.collisions == collisions
    assert referee.struck_while_standing == 1 - collisions


def test_driving_into_a_person_is_a_collision() -> None:
    with blind(open_floor(people=(Person(points=((1.5, 0.0),)),))) as simulator:
        drive(simulator, 0.5, 0.0, 2.5)
        assert simulator.referee.collisions == 1 and simulator.referee.struck_while_standing == 0
        contact, *_ = simulator.referee.summary()["contacts"]
        assert (contact["what"], contact["collided"]) == ("person", True)


def test_stops_are_intervals_with_their_reason() -> None:
    referee = Referee(open_floor())
    for step in range(241):
        reason = "camera" if 60 <= step < 120 else "plan" if 120 <= step < 180 else None
        referee.note_stop(reason)
        here = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
        referee.observe(
            t_s=(step + 1) * PERIOD_S, pose=here, rolling=STANDSTILL, people=(), period_s=PERIOD_S
        )
    assert referee.stops == [
        {"t_s": 0.25, "duration_s": 0.25, "reason": "camera", "count": 1, "until_s": 0.5},
        {"t_s": 0.5, "duration_s": 0.25, "reason": "plan", "count": 1, "until_s": 0.75},
    ]


def held_values(value: object) -> int:
    """Return the number of values that a referee holds, in its lists too."""
    parts = vars(value).values() if isinstance(value, Referee) else value
    return sum(map(held_values, parts)) if isinstance(parts, list | tuple | ValuesView) else 1


def test_a_referee_that_judges_for_hours_holds_no_more_than_one_of_a_minute() -> None:
    referee, here = Referee(open_floor()), Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    held = []
    for minute in range(1, 61):
        referee.observe(
            t_s=60.0 * minute, pose=here, rolling=STANDSTILL, people=(), period_s=PERIOD_S
        )
        held.append(held_values(referee))
    assert held[0] == held[-1]


def test_a_new_run_starts_from_zero_with_the_same_zones() -> None:
    with blind(open_floor()) as simulator:
        simulator.referee.set_zones((np.array(shifted(1.5, 0.0)),))
        drive(simulator, 0.5, 0.0, 1.0)
        simulator.new_run()
        assert simulator.referee.distance_m == 0.0
        drive(simulator, 0.5, 0.0, 1.0)
        assert simulator.referee.zone_intrusions == 1
        assert simulator.referee.distance_m == pytest.approx(0.5, rel=0.05)


def test_a_zone_drawn_over_the_robot_is_no_intrusion_of_a_run_that_begins_in_it() -> None:
    with blind(open_floor()) as simulator:
        wait(simulator, 0.1)
        simulator.referee.set_zones((np.array(shifted(0.0, 0.0)),))
        simulator.new_run()
        wait(simulator, 0.1)
        assert simulator.referee.zone_intrusions == 0


def test_a_summary_lists_a_part_of_what_it_counts() -> None:
    red = tuple(Marking(name=f"red {x}", polygon=shifted(x, 0.0)) for x in (0.5, 3.0))
    referee = Referee(open_floor(markings=red, furniture=(dataclasses.replace(BOX, at=(5.0, 0)),)))
    referee.note_stop("camera")
    pass_by(referee, 0.0)
    referee.note_stop("plan")
    whole, newest = referee.summary(), referee.summary(slice(-1, None))
    assert newest["beware_intrusions"] == whole["beware_intrusions"] == 2
    for name in ("contacts", "intrusions", "stops"):
        assert newest.pop(name) == whole.pop(name)[-1:] != []
    assert newest == whole


def test_the_true_map_blocks_what_is_nearer_than_the_inflation() -> None:
    scenario = open_floor(
        furniture=(BOX,), markings=(Marking(name="red", polygon=shifted(-4.0, 0.0)),)
    )
    spec = GridSpec.centred(size_m=(20.0, 20.0), resolution_m=0.05)
    blocked = Referee(scenario).true_blocked(spec, 0.4)
    outlines = [shapely.Polygon(shifted(x, 0.0)) for x in (2.0, -4.0)]
    cells = random.Random(0).choices(
        [(r, c) for r in range(spec.rows) for c in range(spec.cols)], k=4000
    )
    for row, col in cells:
        gap = min(shapely.Point(spec.centre(row, col)).distance(outline) for outline in outlines)
        if gap < 0.35:
            assert blocked[row, col]
        if gap > 0.55:
            assert not blocked[row, col]


convex = st.builds(
    lambda x, y, yaw, a, b: Pose2(x_m=x, y_m=y, yaw_rad=yaw).to_parent(rectangle(a, b)),
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(-math.pi, math.pi),
    st.floats(0.05, 2),
    st.floats(0.05, 2),
)


@settings(max_examples=200, deadline=None)
@given(convex, convex)
def test_the_distance_of_polygons_is_shapelys(a: Polygon, b: Polygon) -> None:
    assert distance_m(a, b) == pytest.approx(
        shapely.Polygon(a).distance(shapely.Polygon(b)), abs=1e-9
    )


@settings(max_examples=50, deadline=None)
@given(st.lists(convex, min_size=1, max_size=12))
def test_leaving_out_far_polygons_changes_no_verdict(shapes: list[Polygon]) -> None:
    body = HUSKY.footprint()
    touched, least = Outlines.of([(shape,) for shape in shapes]).proximity(body, 0.1, math.inf)
    gaps = [distance_m(body, shape) for shape in shapes]
    assert least == pytest.approx(min(gaps), abs=1e-9)
    assert list(touched) == [gap <= 0.1 for gap in gaps]
