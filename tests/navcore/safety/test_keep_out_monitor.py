"""The gate keeps the operator's zones and the beware list by itself."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

from navcore.config.safety import DEFAULT_SAFETY
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Matrix, Pose2, Twist
from navcore.mission.zone import Zone, ZoneKind
from navcore.mission.zone_growth import distance_m, spread_of
from navcore.robot.driver import Command
from navcore.robot.profile import HUSKY
from navcore.safety.gate import Cause, GateDecision, GateInput, gate
from navcore.safety.keep_out_monitor import KeepOuts, permitted_share

HERE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
AHEAD, BACK = Twist(v_mps=1.0, w_radps=0.0), Twist(v_mps=-0.3, w_radps=0.0)
FRONT_M = HUSKY.length_m / 2


def zone(left: float, right: float, *, kind: ZoneKind = ZoneKind.KEEP_OUT) -> Zone:
    """A zone across the robot's path between two distances from its middle."""
    return Zone(
        id="z",
        name="Wet floor",
        polygon=((left, -2.0), (right, -2.0), (right, 2.0), (left, 2.0)),
        kind=kind,
        max_speed_mps=0.3 if kind is ZoneKind.SPEED_LIMIT else None,
    )


def site(right: float) -> Zone:
    """A site whose boundary lies across the robot's path at a distance from its middle."""
    return Zone(
        id="s",
        name="Yard",
        polygon=((-30.0, -30.0), (right, -30.0), (right, 30.0), (-30.0, 30.0)),
        kind=ZoneKind.STAY_INSIDE,
    )


def share(keep_outs: KeepOuts, twist: Twist = AHEAD) -> float:
    return permitted_share(keep_outs, twist, HUSKY, frame_age_s=0.05)[0]


def test_far_zones_permit_full_speed_and_near_ones_less_until_none_is_left() -> None:
    shares = [
        share(KeepOuts(pose=HERE, zones=(zone(FRONT_M + gap, FRONT_M + gap + 1.0),)))
        for gap in (3.0, 0.5, 0.3, 0.06, 0.01)
    ]
    assert shares[0] == 1.0
    assert shares == sorted(shares, reverse=True)
    assert 0.0 < shares[2] < 1.0
    assert shares[-1] == 0.0


def test_a_far_boundary_permits_full_speed_and_a_near_one_less_until_none_is_left() -> None:
    shares = [
        share(KeepOuts(pose=HERE, zones=(site(FRONT_M + gap),))) for gap in (3.0, 0.3, 0.06, 0.01)
    ]
    assert shares[0] == 1.0 and shares[-1] == 0.0
    assert shares == sorted(shares, reverse=True)
    stopped = permitted_share(
        KeepOuts(pose=HERE, zones=(site(FRONT_M + 0.01),)), AHEAD, HUSKY, frame_age_s=0.0
    )
    assert stopped == (0.0, "zone 'Yard'")
    # Away from it, and along it, the robot may drive.
    assert share(KeepOuts(pose=HERE, zones=(site(FRONT_M + 0.01),)), BACK) == 1.0


def test_a_robot_outside_a_site_may_go_back_and_no_farther_out() -> None:
    half_out = KeepOuts(pose=HERE, zones=(site(0.2),))
    assert share(half_out, BACK) == 1.0
    assert share(half_out) == 0.0
    assert share(KeepOuts(pose=HERE, zones=(site(0.2),), leaving=True)) == 1.0


def test_a_boundary_that_is_switched_off_does_not_count() -> None:
    """Control for the boundaries above."""
    off = dataclasses.replace(site(FRONT_M + 0.01), enabled=False)
    assert share(KeepOuts(pose=HERE, zones=(off,))) == 1.0


def test_the_area_is_named_and_zones_that_are_not_closed_do_not_count() -> None:
    near = zone(FRONT_M + 0.01, FRONT_M + 1.0)
    assert permitted_share(KeepOuts(pose=HERE, zones=(near,)), AHEAD, HUSKY, frame_age_s=0.0) == (
        0.0,
        "zone 'Wet floor'",
    )
    slow = zone(FRONT_M + 0.01, FRONT_M + 1.0, kind=ZoneKind.SPEED_LIMIT)
    assert share(KeepOuts(pose=HERE, zones=(slow,))) == 1.0
    assert share(KeepOuts(pose=None, zones=(near,))) == 1.0


def test_known_beware_cells_count_like_a_zone() -> None:
    def cells(x_m: float) -> Points:
        return np.array([[x_m, 0.0], [x_m, 0.05]])

    assert share(KeepOuts(pose=HERE, cells=cells(FRONT_M + 3.0))) == 1.0
    assert share(KeepOuts(pose=HERE, cells=cells(FRONT_M + 0.02))) == 0.0
    assert share(KeepOuts(pose=HERE, cells=cells(-3.0)), BACK) == 1.0


def line_beside(gap_m: float, *, growth_m: float, as_one: bool = True) -> KeepOuts:
    """A tape of 4 m that runs beside the robot, and is uncertain."""
    x = np.arange(-2.0, 2.0, 0.05)
    cells = np.column_stack([x, np.full(len(x), HUSKY.width_m / 2 + gap_m)])
    objects = np.zeros(len(x), dtype=np.int64) if as_one else None
    return KeepOuts(
        pose=HERE, cells=cells, cell_growth_m=np.full(len(x), growth_m), cell_objects=objects
    )


def test_within_the_growth_of_a_line_the_robot_drives_along_it_and_away_and_not_nearer() -> None:
    within = line_beside(0.1, growth_m=0.15)
    assert share(within) == 1.0 and share(within, BACK) == 1.0
    assert share(within, Twist(v_mps=0.3, w_radps=0.3)) == 0.0, "towards it"
    assert share(line_beside(0.1, growth_m=0.15, as_one=False)) == 0.0  # control: each by itself
    assert share(line_beside(0.2, growth_m=0.15)) == 1.0


def test_of_an_object_that_the_robot_touches_it_may_cover_no_more() -> None:
    x = np.arange(0.3, 1.5, 0.05)
    cells = np.column_stack([x, np.zeros(len(x))])
    touched = KeepOuts(pose=HERE, cells=cells, cell_objects=np.zeros(len(x), dtype=np.int64))
    assert share(touched) == 0.0 and share(touched, BACK) == 1.0


def test_a_robot_that_stands_over_an_object_may_drive_off_it() -> None:
    x, y = np.meshgrid(np.arange(-0.3, 0.3, 0.05), np.arange(-0.1, 0.1, 0.05))
    cells = np.column_stack([x.ravel(), y.ravel()])
    over = KeepOuts(pose=HERE, cells=cells, cell_objects=np.zeros(len(cells), dtype=np.int64))
    assert share(over) == 1.0 and share(over, BACK) == 1.0


def test_what_lies_just_under_the_front_is_not_driven_over() -> None:
    row = np.column_stack([np.full(5, FRONT_M - 0.01), np.linspace(-0.1, 0.1, 5)])
    under = KeepOuts(pose=HERE, cells=row, cell_objects=np.zeros(5, dtype=np.int64))
    assert share(under) == 0.0 and share(under, BACK) == 1.0


def test_a_robot_that_leaves_an_object_keeps_out_of_all_others() -> None:
    within = line_beside(0.1, growth_m=0.15)
    towards = Twist(v_mps=0.3, w_radps=0.3)
    assert share(dataclasses.replace(within, leaving=True), towards) == 1.0
    ahead = np.array([[FRONT_M + 0.02, 0.0], [FRONT_M + 0.02, 0.05]])
    both = dataclasses.replace(
        within,
        leaving=True,
        cells=np.vstack([within.cells, ahead]),
        cell_growth_m=np.append(np.full(len(within.cells), 0.15), [0.0, 0.0]),
        cell_objects=np.append(np.zeros(len(within.cells), dtype=np.int64), [1, 1]),
    )
    assert share(both, towards) == 0.0 and share(both, BACK) == 1.0


def test_only_zones_that_may_be_near_are_grown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hundreds of zones of a site must not hold up the commands."""
    spreads = list[float]()

    def counted(covariance: Matrix, sigmas: float) -> Matrix:
        spreads.append(sigmas)
        return spread_of(covariance, sigmas)

    monkeypatch.setattr("navcore.safety.keep_out_monitor.spread_of", counted)
    far = tuple(dataclasses.replace(zone(10.0 + k, 11.0 + k), id=f"far {k}") for k in range(50))
    near = zone(FRONT_M + 0.2, 3.0)
    uncertain = KeepOuts(pose=HERE, zones=(*far, near), covariance=np.eye(2) * 0.1**2)
    alone = share(dataclasses.replace(uncertain, zones=(near,)))
    per_zone = len(spreads)
    assert share(uncertain) == alone < 1.0
    assert len(spreads) == 2 * per_zone


@pytest.mark.parametrize("forbids", ["zone", "object"])
def test_a_robot_that_leaves_an_area_enters_none_whose_growth_reaches_it(forbids: str) -> None:
    under = dataclasses.replace(zone(-3.0, -0.2), id="under")
    ahead, x_m = dataclasses.replace(zone(FRONT_M + 0.15, 3.0), id="ahead"), FRONT_M + 0.15
    told = KeepOuts(pose=HERE, zones=(under,), covariance=np.eye(2) * 0.1**2, leaving=True)
    if forbids == "zone":
        told = dataclasses.replace(told, zones=(under, ahead))
    else:
        cells = np.array([[x_m, 0.05 * k] for k in range(-20, 20)])
        one = np.zeros(len(cells), dtype=np.int64)
        growth_m = np.full(len(cells), 0.2)
        told = dataclasses.replace(told, cells=cells, cell_growth_m=growth_m, cell_objects=one)
    assert 0.0 < share(told) < 1.0  # it stops before what is ahead
    at_it = dataclasses.replace(told, pose=Pose2(x_m=0.13, y_m=0.0, yaw_rad=0.0))
    assert share(at_it) == 0.0 and share(at_it, BACK) == 1.0
    # Within the growth it may turn towards the way out, as the controller has it.
    assert share(told, Twist(v_mps=0.0, w_radps=0.3)) == 1.0
    nothing = dataclasses.replace(told, zones=(under,), cells=np.empty((0, 2)))
    nothing = dataclasses.replace(nothing, cell_growth_m=None, cell_objects=None)
    assert share(nothing) == 1.0  # control


def test_a_robot_in_a_zone_may_leave_it_and_go_no_farther_in() -> None:
    half_in = KeepOuts(pose=HERE, zones=(zone(0.2, 3.0),))
    assert share(half_in, BACK) == 1.0
    assert share(half_in) == 0.0
    told = KeepOuts(pose=HERE, zones=(zone(0.2, 3.0),), leaving=True)
    assert share(told) == 1.0


def decided(keep_outs: KeepOuts, twist: Twist = AHEAD, *, sent: Twist = AHEAD) -> GateDecision:
    """The gate's decision on a velocity, by default on going on at full speed."""
    facts = GateInput(
        now_ns=0,
        frame_ns=0,
        stopped_by=None,
        command=Command(twist=twist, stamp_ns=0),
        keep_outs=keep_outs,
    )
    return gate(facts, sent=sent, period_s=0.05, profile=HUSKY)


def test_the_gate_slows_then_stops_with_the_reason() -> None:
    assert decided(KeepOuts(pose=HERE)).twist == AHEAD
    near = decided(KeepOuts(pose=HERE, zones=(zone(FRONT_M + 0.3, FRONT_M + 1.0),)))
    assert 0.0 < near.twist.v_mps < 1.0 and near.reasons == ()
    stopped = decided(KeepOuts(pose=HERE, zones=(zone(FRONT_M + 0.02, FRONT_M + 1.0),)))
    assert stopped.twist == STANDSTILL
    assert [reason.cause for reason in stopped.reasons] == [Cause.BEWARE_AHEAD]
    assert "Wet floor" in stopped.reasons[0].text


@settings(max_examples=150, deadline=None)
@given(
    v_mps=st.floats(-1.0, 1.0),
    w_radps=st.floats(-1.5, 1.5),
    yaw_rad=st.floats(-math.pi, math.pi),
    gap_m=st.floats(0.0, 1.0),
    bounded=st.booleans(),
)
@example(v_mps=-0.9375, w_radps=-0.375, yaw_rad=2.0, gap_m=0.0, bounded=False)
def test_braking_from_the_permitted_velocity_never_enters_the_zone_or_leaves_the_site(
    v_mps: float, w_radps: float, yaw_rad: float, gap_m: float, bounded: bool
) -> None:
    keep_out = site(1.0) if bounded else zone(1.0, 4.0)
    start = Pose2(x_m=1.0 - gap_m - HUSKY.circumscribed_radius_m, y_m=0.0, yaw_rad=yaw_rad)
    asked = Twist(v_mps=v_mps, w_radps=w_radps)
    permitted = share(KeepOuts(pose=start, zones=(keep_out,)), asked)
    # 0.25 s late, then the platform's braking, along the same arc.
    late_s = 0.25
    stop_s = permitted * max(
        abs(v_mps) / HUSKY.max_accel_mps2, abs(w_radps) / HUSKY.max_yaw_accel_radps2, 1e-9
    )
    pose, step_s = start, 0.005
    for k in range(round((late_s + stop_s + 0.1) / step_s)):
        left = permitted * max(0.0, 1.0 - max(0.0, k * step_s - late_s) / max(stop_s, 1e-9))
        v, w = left * v_mps, left * w_radps
        half = Pose2(x_m=0.0, y_m=0.0, yaw_rad=w * step_s / 2)
        pose = pose @ half @ Pose2(x_m=v * step_s, y_m=0.0, yaw_rad=0.0) @ half
        body = Polygon(pose.to_parent(HUSKY.footprint()))
        area = Polygon(keep_out.polygon)
        entered = body.difference(area) if bounded else body.intersection(area)
        assert entered.area < 1e-4


def stopped_from(start: Pose2, twist: Twist) -> list[Pose2]:
    """The poses of a robot that drives on for 0.25 s and brakes as the platform does."""
    late_s, step_s, pose, found = 0.25, 0.01, start, []
    brakes_s = max(
        abs(twist.v_mps) / HUSKY.max_accel_mps2, abs(twist.w_radps) / HUSKY.max_yaw_accel_radps2
    )
    for k in range(round((late_s + brakes_s) / step_s)):
        left = 1.0 if brakes_s == 0 else 1.0 - max(0.0, k * step_s - late_s) / brakes_s
        v_mps, w_radps = left * twist.v_mps, left * twist.w_radps
        pose = pose @ Pose2(x_m=v_mps * step_s, y_m=0.0, yaw_rad=w_radps * step_s)
        found.append(pose)
    return found


def drawn_case(rng: np.random.Generator) -> tuple[KeepOuts, Twist, float]:
    """A robot beside or within the growth of a zone or a boundary, a velocity, and the distance
    that its uncertainty asks for, metres."""
    sides, turned = rng.uniform(0.3, 4.0, 2), rng.uniform(-math.pi, math.pi)
    box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * sides / 2
    pose = Pose2(x_m=rng.uniform(-2, 2), y_m=rng.uniform(-2, 2), yaw_rad=turned)
    sigma_m = float(rng.choice([0.0, 0.1, 0.2, 0.5]))
    bounded = rng.random() < 0.3
    keep_out = Zone(
        id="z",
        name="Wet floor",
        polygon=tuple((float(x), float(y)) for x, y in box * (3.0 if bounded else 1.0)),
        kind=ZoneKind.STAY_INSIDE if bounded else ZoneKind.KEEP_OUT,
    )
    keep_outs = KeepOuts(pose=pose, zones=(keep_out,), covariance=sigma_m**2 * np.eye(2))
    asked = Twist(v_mps=rng.uniform(-1.0, 1.0), w_radps=rng.uniform(-1.5, 1.5))
    return keep_outs, asked, DEFAULT_SAFETY.keep_out.sigmas * sigma_m


def clearance_m(keep_out: Zone, poses: list[Pose2]) -> float:
    """The least distance of the footprint from what a zone forbids, at any of the poses."""
    bodies = shapely.polygons(np.stack([pose.to_parent(HUSKY.footprint()) for pose in poses]))
    return float(distance_m(keep_out, np.asarray(bodies)).min())


def lost_m(*, checked: bool) -> tuple[float, float, int]:
    """What the permitted velocities cost of the least of present clearance and the distance asked
    for, at most; how much of the zone is covered besides; and how many robots within the distance
    may move."""
    rng, most, deeper, moving = np.random.default_rng(0), 0.0, 0.0, 0
    for _ in range(300):
        keep_outs, asked, needed_m = drawn_case(rng)
        assert keep_outs.pose is not None
        permitted = share(keep_outs, asked) if checked else 1.0
        twist = Twist(v_mps=permitted * asked.v_mps, w_radps=permitted * asked.w_radps)
        (keep_out,), poses = keep_outs.zones, stopped_from(keep_outs.pose, twist)
        now_m = clearance_m(keep_out, [keep_outs.pose])
        if now_m > 0:
            most = max(most, min(now_m, needed_m) - clearance_m(keep_out, poses))
        elif keep_out.kind is ZoneKind.KEEP_OUT:
            area = Polygon(keep_out.polygon)
            covers = [
                Polygon(pose.to_parent(HUSKY.footprint())).intersection(area).area
                for pose in (keep_outs.pose, *poses)
            ]
            deeper = max(deeper, max(covers) - covers[0])
        moving += 0 < now_m < needed_m and permitted > 0
    return most, deeper, moving


def test_no_permitted_velocity_comes_nearer_than_the_least_of_what_is_and_what_is_asked_for() -> (
    None
):
    most, deeper, moving = lost_m(checked=True)
    assert most < 2e-3  # a corner bulges out between two poses that are checked
    assert deeper < 0.04  # the footprint is counted by points, 3 cm apart
    assert moving > 20  # and a robot that is within the distance can get out


def test_without_the_check_velocities_come_nearer() -> None:
    """Control for the test above."""
    most, deeper, _ = lost_m(checked=False)
    assert most > 0.2
    assert deeper > 0.1


def test_a_robot_within_the_growth_of_a_zone_may_back_off_and_not_drive_in() -> None:
    """The body is in the grown zone as a whole, half a metre before the zone itself."""
    within = KeepOuts(
        pose=HERE, zones=(zone(FRONT_M + 0.5, FRONT_M + 2.0),), covariance=np.diag([0.6**2, 0.0])
    )
    assert share(within, BACK) > 0.0
    permitted, reason = permitted_share(within, AHEAD, HUSKY, frame_age_s=0.05)
    assert permitted == 0.0
    assert "uncertain by 1.2 m" in reason
    assert share(within, Twist(v_mps=0.0, w_radps=0.5)) == 0.0  # a corner would come nearer
    # Along the zone it may drive on however uncertain the position is.
    beside = Pose2(x_m=0.0, y_m=0.0, yaw_rad=math.pi / 2)
    assert share(dataclasses.replace(within, pose=beside)) > 0.0


def test_a_robot_within_the_growth_of_a_beware_cell_may_back_off_and_not_drive_on() -> None:
    before = KeepOuts(
        pose=HERE, cells=np.array([[FRONT_M + 0.1, 0.0]]), cell_growth_m=np.array([0.3])
    )
    assert share(before, BACK) == 1.0
    assert share(before) == 0.0
    assert share(dataclasses.replace(before, cell_growth_m=np.array([0.0]))) > 0.0


def test_a_robot_is_stopped_before_it_passes_a_beware_cell_within_its_growth() -> None:
    aside_m, growth_m = HUSKY.width_m / 2 + 0.9, 1.0
    stopped = [
        share(
            KeepOuts(
                pose=Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0),
                cells=np.array([[0.0, aside_m]]),
                cell_growth_m=np.array([growth_m]),
            ),
            Twist(v_mps=0.3, w_radps=0.0),
        )
        == 0.0
        for x_m in np.arange(-3.0, 0.0, 0.05)
    ]
    assert any(stopped)


@pytest.mark.parametrize("keep_out", [zone(3.0, 5.0), site(3.0)], ids=["zone", "site"])
@pytest.mark.parametrize("skid", [False, True])
def test_a_broken_planner_does_not_bring_the_robot_into_a_zone_or_out_of_a_site(
    skid: bool, keep_out: Zone
) -> None:
    pose, sent, now_ns = HERE, STANDSTILL, 0
    for _ in range(200):
        now_ns += 50_000_000
        facts = GateInput(
            now_ns=now_ns,
            frame_ns=now_ns - 40_000_000,
            stopped_by=None,
            command=Command(twist=AHEAD, stamp_ns=now_ns),  # a planner that ignores the zone
            keep_outs=KeepOuts(pose=pose, zones=(keep_out,)),
        )
        sent = gate(facts, sent=sent, period_s=0.05, profile=HUSKY).twist
        grip = 1.05 if skid else 1.0
        pose = pose @ Pose2(x_m=grip * sent.v_mps * 0.05, y_m=0.0, yaw_rad=0.0)
        assert pose.x_m + FRONT_M < 3.0
    assert pose.x_m + FRONT_M > 2.7  # it came near, and stopped


def test_zones_grow_with_the_uncertainty_of_the_position_across_their_edge() -> None:
    near = (zone(FRONT_M + 0.35, FRONT_M + 2.0),)
    along, across = np.diag([0.1**2, 0.0]), np.diag([0.0, 0.1**2])
    certain = share(KeepOuts(pose=HERE, zones=near))
    uncertain_along = share(KeepOuts(pose=HERE, zones=near, covariance=along))
    assert uncertain_along < certain
    assert share(KeepOuts(pose=HERE, zones=near, covariance=across)) > uncertain_along
    # The covariance relative to this very zone counts, where it is known.
    relative = KeepOuts(
        pose=HERE, zones=near, covariance=along, covariances={"z": np.zeros((2, 2))}
    )
    assert share(relative) == certain


def test_beside_a_zone_too_uncertain_a_position_permits_little_speed_and_says_so() -> None:
    beside = KeepOuts(
        pose=HERE, zones=(zone(FRONT_M + 0.8, FRONT_M + 2.0),), covariance=np.diag([0.2**2, 0.0])
    )
    permitted, reason = permitted_share(beside, AHEAD, HUSKY, frame_age_s=0.05)
    assert 0.0 < permitted <= DEFAULT_SAFETY.keep_out.uncertain_mps
    assert "uncertain by 0.4 m" in reason
    # Away from the zone the speed is the same, and so it is on the way out of the clearance.
    assert 0.0 < share(beside, BACK) <= DEFAULT_SAFETY.keep_out.uncertain_mps / 0.3
    # Nor does the fastest turn, of which the least usual share is still too fast, end in a stop.
    fastest = Twist(v_mps=-HUSKY.max_speed_mps, w_radps=HUSKY.max_yaw_rate_radps)
    nearer = dataclasses.replace(beside, zones=(zone(FRONT_M + 0.6, FRONT_M + 2.0),))
    assert 0.0 < share(nearer, fastest) < min(DEFAULT_SAFETY.keep_out.shares)
    far = dataclasses.replace(beside, zones=(zone(FRONT_M + 2.0, FRONT_M + 4.0),))
    assert share(far) == 1.0


def test_too_uncertain_a_position_keeps_out_of_the_grown_zone() -> None:
    at_its_edge = KeepOuts(
        pose=HERE, zones=(zone(FRONT_M + 0.43, FRONT_M + 2.0),), covariance=np.diag([0.2**2, 0.0])
    )
    permitted, reason = permitted_share(at_its_edge, AHEAD, HUSKY, frame_age_s=0.05)
    assert permitted == 0.0
    assert "uncertain by 0.4 m" in reason
    assert share(at_its_edge, BACK) > 0.0


def test_what_is_sent_on_the_way_to_another_velocity_is_checked_too() -> None:
    """A robot that drives at full speed and is asked to turn in place goes on ahead meanwhile, on
    an arc that the turn itself does not sweep."""
    beside = Zone(
        id="z",
        name="shelf",
        polygon=tuple(
            (FRONT_M + x, HUSKY.width_m / 2 + y)
            for x, y in ((0.02, 0.03), (1.5, 0.03), (1.5, 1.0), (0.02, 1.0))
        ),
    )
    turn = Twist(v_mps=0.0, w_radps=0.3)

    def sent(zones: tuple[Zone, ...]) -> Twist:
        return decided(KeepOuts(pose=HERE, zones=zones), turn).twist

    free, kept = sent(()), sent((beside,))
    assert free.w_radps > 0.0 and free.v_mps > 0.5
    assert (
        permitted_share(KeepOuts(pose=HERE, zones=(beside,)), free, HUSKY, frame_age_s=0.0)[0] < 1
    )
    assert kept.w_radps == 0.0 and kept.v_mps == free.v_mps, "it brakes straight on"


def test_a_robot_that_stands_sets_off_on_the_arc_that_was_checked_or_says_why_not() -> None:
    """Its yaw rate takes longer to reach than its speed, so it would begin a wider arc."""
    arc = Twist(v_mps=0.2, w_radps=0.8)

    def beside(gap_m: float) -> KeepOuts:
        return KeepOuts(pose=HERE, cells=np.array([[FRONT_M + 0.02, gap_m - HUSKY.width_m / 2]]))

    def decided_beside(gap_m: float) -> GateDecision:
        return decided(beside(gap_m), arc, sent=STANDSTILL)

    for gap_m in np.arange(-0.1, 0.2, 0.01).tolist():
        decision = decided_beside(gap_m)
        assert decision.twist != STANDSTILL or decision.reasons
        if decision.twist != STANDSTILL:
            assert permitted_share(beside(gap_m), decision.twist, HUSKY, frame_age_s=0.0)[0] == 1.0
    assert decided_beside(-1.0).twist.w_radps > 0.0


def test_it_brakes_along_the_arc_that_it_drives() -> None:
    driven = Twist(v_mps=0.9, w_radps=0.4)
    braking = decided(KeepOuts(pose=HERE), STANDSTILL, sent=driven).twist
    assert 0.7 < braking.v_mps < 0.8
    assert braking.w_radps / braking.v_mps == pytest.approx(driven.w_radps / driven.v_mps)
