"""Boxed in: the robot waits, backs off the way it came, looks round, takes another way, or says
plainly that it gives up."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.behaviours.lane_retreat import LaneRetreat
from navcore.behaviours.recovery import Recovery, RecoveryAction, closed_way, trail_with
from navcore.behaviours.supervisor import Behaviour
from navcore.config.behaviours import RecoveryConfig
from navcore.config.control import LocalPlannerConfig
from navcore.config.navigator import NavigatorConfig
from navcore.config.people import PeopleConfig
from navcore.control.controller import Controller, ControlTask
from navcore.control.local_planner import LocalPlannerInput, compute_velocity
from navcore.control.motion import IDLE, ControllerState, Motion
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.grid import GridSpec
from navcore.mission.beware_list import BewareList
from navcore.mission.order import NavigationRequest
from navcore.navigator import Navigator
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.people.track import Track
from navcore.planning.path import NoPath, Path, Reason
from navcore.planning.route import Route
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.stages import Stages
from tests.navcore.scene import picture

RULES = RecoveryConfig()
NONE: Points = np.empty((0, 2))
PERIOD_S = 0.1
STUCK = Motion(twist=STANDSTILL, outcome=ControllerState.BLOCKED)


def wall(x: tuple[float, float], y: tuple[float, float]) -> Points:
    """Points every 5 cm along a straight."""
    count = math.ceil(math.dist((x[0], y[0]), (x[1], y[1])) / 0.05) + 1
    return np.column_stack([np.linspace(*x, count), np.linspace(*y, count)])


@dataclasses.dataclass
class Drive:
    """A robot that moves as it decides, in a world of points that may change."""

    pose: Pose2
    path: Points
    world: Callable[[float], Points]
    trail: Points = dataclasses.field(default_factory=lambda: NONE)
    recovery: Recovery = dataclasses.field(default_factory=Recovery)
    motion: Motion = IDLE
    seen: list[tuple[float, RecoveryAction, Motion, Pose2]] = dataclasses.field(
        default_factory=list
    )

    def run(self, until_s: float) -> None:
        """Ten ticks a second, as the navigator does them."""
        while (t_s := len(self.seen) * PERIOD_S) < until_s:
            action = self.recovery.action
            offset = self.world(t_s) - np.array([self.pose.x_m, self.pose.y_m])
            cos, sin = math.cos(self.pose.yaw_rad), math.sin(self.pose.yaw_rad)
            self.motion = motion = compute_velocity(
                LocalPlannerInput(
                    geometric=offset @ np.array([[cos, -sin], [sin, cos]]),
                    forbidden=NONE,
                    unseen=NONE,
                    cell_m=0.05,
                    path=self.path,
                    pose=self.pose,
                    previous=self.motion,
                    profile=HUSKY,
                    local=LocalPlannerConfig(),
                    retreat=self.trail if action is RecoveryAction.BACK_UP else None,
                    spin=action is RecoveryAction.SPIN,
                )
            )
            self.trail = trail_with(self.trail, self.pose)
            self.recovery = self.recovery.after(motion, self.pose, round(t_s * 1e9), RULES)
            if self.recovery.action in (RecoveryAction.WAIT, RecoveryAction.GIVE_UP):
                motion = STUCK
            self.seen.append((t_s, self.recovery.action, motion, self.pose))
            half = Pose2(x_m=0.0, y_m=0.0, yaw_rad=motion.twist.w_radps * PERIOD_S / 2)
            self.pose = (
                self.pose
                @ half
                @ Pose2(x_m=motion.twist.v_mps * PERIOD_S, y_m=0.0, yaw_rad=0.0)
                @ half
            )

    def action(self) -> list[RecoveryAction]:
        """Those that were tried, in their order."""
        found = [action for _, action, _, _ in self.seen]
        return [
            action
            for before, action in zip([None, *found], found, strict=False)
            if action != before and action != RecoveryAction.NONE
        ]


def pocket(front_m: float) -> Points:
    """A dead end as wide as the robot and a little more, open behind."""
    sides = [wall((-4.0, front_m), (y, y)) for y in (0.44, -0.44)]
    return np.vstack([*sides, wall((front_m, front_m), (-0.44, 0.44))])


AHEAD = wall((0.0, 6.0), (0.0, 0.0))
SHUT = np.vstack([pocket(0.57), wall((-0.62, -0.62), (-0.44, 0.44))])
"""No room anywhere."""
HERE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)


def test_an_obstacle_that_goes_away_is_waited_for_in_place() -> None:
    drive = Drive(HERE, AHEAD, lambda t_s: SHUT if t_s < 1.45 else NONE)
    drive.run(1.45)
    assert drive.pose == HERE
    assert drive.action() == [RecoveryAction.WAIT]
    drive.run(4.0)
    assert drive.action() == [RecoveryAction.WAIT]
    assert drive.pose.x_m > 0.5


def test_the_robot_backs_off_along_the_path_it_came_by() -> None:
    drive = Drive(
        Pose2(x_m=-3.0, y_m=0.0, yaw_rad=0.0),
        wall((-3.0, 6.0), (0.0, 0.0)),
        lambda t_s: pocket(0.8),
    )
    drive.run(40.0)
    assert RecoveryAction.BACK_UP in drive.action()
    backing = [
        (motion, pose) for _, action, motion, pose in drive.seen if action is RecoveryAction.BACK_UP
    ]
    assert all(motion.twist.v_mps <= 0 for motion, _ in backing)
    assert backing[0][1].x_m - backing[-1][1].x_m > 0.8
    assert (
        max(abs(pose.y_m) for _, pose in backing) < 0.05
    )  # where it had come, in the middle between the walls


def test_where_there_is_no_way_back_the_robot_turns_once_round_and_looks() -> None:
    wide = np.vstack(
        [wall((x, x), (-0.75, 0.75)) for x in (-0.75, 0.75)]
        + [wall((-0.75, 0.75), (y, y)) for y in (-0.75, 0.75)]
    )
    drive = Drive(Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), AHEAD, lambda t_s: wide)
    drive.run(60.0)
    tried = drive.action()
    assert [action for action in tried if action is not RecoveryAction.WAIT] == [
        RecoveryAction.BACK_UP,
        RecoveryAction.SPIN,
        RecoveryAction.CLOSE,
        RecoveryAction.GIVE_UP,
    ]
    yaws = np.array(
        [pose.yaw_rad for _, action, _, pose in drive.seen if action is RecoveryAction.SPIN]
    )
    assert np.abs(np.diff(np.unwrap(yaws))).sum() > 1.9 * math.pi
    _, action, motion, _ = drive.seen[-1]
    assert (action, motion.twist) == (RecoveryAction.GIVE_UP, STANDSTILL)


def test_a_robot_that_has_given_up_goes_on_when_its_way_is_free_again() -> None:
    drive = Drive(HERE, AHEAD, lambda t_s: SHUT if t_s < 30 else NONE)
    drive.run(30.0)
    assert drive.seen[-1][1] is RecoveryAction.GIVE_UP
    drive.run(36.0)
    assert drive.pose.x_m > 3.0
    assert drive.recovery == Recovery()  # far enough from there to start afresh the next time


@pytest.mark.parametrize("now", [ControllerState.BACK, ControllerState.MANOEUVRE])
@pytest.mark.parametrize("refused", [ControllerState.BLOCKED, None])
def test_a_robot_that_gave_up_blocked_tries_again_once_it_can_back_off_or_manoeuvre(
    refused: ControllerState | None, now: ControllerState
) -> None:
    """One that could do so when it gave up does not: it would go to and fro for ever."""
    given_up = Recovery(action=RecoveryAction.GIVE_UP, at=HERE, refused=refused or now)
    motion = Motion(twist=Twist(v_mps=-0.2, w_radps=0.0), outcome=now, began=HERE)
    after = given_up.after(motion, HERE, 10**9, RULES)
    goes_on = refused is ControllerState.BLOCKED
    assert (after == Recovery()) is goes_on
    assert (after.action is RecoveryAction.GIVE_UP) is not goes_on


SPEC = GridSpec.centred(size_m=(16.0, 16.0), resolution_m=0.1)
GOAL = (5.0, 0.0)
ORDER = NavigationRequest(goal=GOAL, beware=BewareList(classes=()), zones=())


def blocked_navigator() -> Navigator:
    """A navigator whose local planner never finds a motion, and whose map does not change."""

    def blocked(_controller: Controller, task: ControlTask) -> Motion:
        return STUCK if len(task.track) else IDLE

    return Navigator(
        spec=SPEC,
        profile=HUSKY,
        segmenter=ColourSegmenter(),
        config=NavigatorConfig(),
        stages=Stages(track=lambda *_: (), update_map=lambda *_: None, control=blocked),
    )


def stuck_for(
    navigator: Navigator, pose: Pose2, start_s: float, seconds: float
) -> tuple[Route, list[ControllerState]]:
    """Run a blocked navigator at a pose; return the last route and what it reports each tick."""
    outcomes, route = list[ControllerState](), None
    for k in range(round(seconds / PERIOD_S)):
        frame = picture(pose=pose, stamp_ns=round((start_s + k * PERIOD_S) * 1e9))
        result = navigator.tick(frame, ORDER)
        route = result.route
        outcomes.append(result.motion.outcome)
    assert route is not None
    return route, outcomes


def supervised(
    behaviour: Behaviour,
    motion: Motion,
    frame: Frame,
    route: Route,
    request: NavigationRequest,
    *,
    people: tuple[Track, ...] = (),
) -> tuple[Behaviour, Motion]:
    """One transition of the behaviours for a request."""
    return behaviour.towards(request).after(
        motion,
        frame=frame,
        route=route,
        people=people,
        profile=HUSKY,
        config=NavigatorConfig(),
    )


def test_a_blocked_passage_leads_to_another_and_without_one_the_robot_gives_up() -> None:
    gaps = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    gaps[:, 90] = True  # a wall at x = 1 m …
    for y_m in (0.0, 4.0):
        row, _ = SPEC.cell(1.0, y_m)
        gaps[row - 7 : row + 8, 90] = False  # … with two gaps of 1.5 m
    navigator = blocked_navigator()
    navigator.map.load_prior(gaps)
    first = Pose2(x_m=0.35, y_m=0.0, yaw_rad=0.0)
    route, _ = stuck_for(navigator, first, 0.0, 0.1)
    assert np.abs(route.points[:, 1]).max() < 0.5
    route, outcomes = stuck_for(navigator, first, 0.1, 8.0)
    assert isinstance(route.outcome, Path)
    assert route.points[:, 1].max() > 3.5  # by the other gap
    second = Pose2(x_m=0.35, y_m=4.0, yaw_rad=0.0)
    stuck_for(navigator, Pose2(x_m=-3.0, y_m=2.0, yaw_rad=0.0), 8.1, 0.1)
    route, outcomes = stuck_for(navigator, second, 8.2, 10.0)
    assert outcomes[-1] is ControllerState.GIVEN_UP
    assert not isinstance(route.outcome, NoPath)  # the goal is not called unreachable


def test_when_nothing_has_helped_the_ways_that_were_found_closed_are_ways_again() -> None:
    navigator = blocked_navigator()
    here = Pose2(x_m=-3.0, y_m=0.0, yaw_rad=0.0)
    first, _ = stuck_for(navigator, here, 0.0, 7.0)
    assert navigator.behaviour.closed
    last, outcomes = stuck_for(navigator, here, 7.0, 40.0)
    assert outcomes[-1] is ControllerState.GIVEN_UP
    assert not navigator.behaviour.closed
    np.testing.assert_array_equal(last.track[-1], first.track[-1])


def test_a_closed_way_lies_on_the_path_before_the_bumper_and_not_under_the_robot() -> None:
    way = closed_way(wall((-1.0, 5.0), (0.0, 0.0)), HERE, HUSKY)
    assert way is not None
    corners = np.array(way.polygon)
    assert np.hypot(*corners.T).min() > HUSKY.circumscribed_radius_m  # whichever way it has turned
    assert corners[:, 0].max() < 1.2
    assert abs(corners[:, 1].mean()) < 1e-9


def test_a_path_that_ends_beside_the_robot_is_no_passage_to_close() -> None:
    assert closed_way(wall((-1.0, 0.9), (0.0, 0.0)), HERE, HUSKY) is None


def test_the_trail_is_the_way_back_without_the_detours() -> None:
    trail = NONE
    there = [(0.05 * k, 0.0) for k in range(41)]
    for x, y in [*there, *there[:20:-1], *((1.05, 0.05 * k) for k in range(1, 21))]:
        trail = trail_with(trail, Pose2(x_m=x, y_m=y, yaw_rad=0.0))
    assert math.dist(trail[0], (1.05, 1.0)) < 0.1
    assert math.dist(trail[-1], (0.0, 0.0)) < 0.1
    assert trail[:, 0].max() < 1.2  # the metre beyond, there and back again, is forgotten
    assert float(np.hypot(*np.diff(trail, axis=0).T).max()) < 0.25


def test_the_way_is_closed_before_where_the_robot_stands_by_then_never_under_it() -> None:
    navigator = blocked_navigator()
    stuck_for(navigator, Pose2(x_m=-3.0, y_m=0.0, yaw_rad=0.0), 0.0, 2.5)
    crept = Pose2(
        x_m=-2.1, y_m=0.0, yaw_rad=0.0
    )  # still at the place where it was boxed in, but a good way on
    stuck_for(navigator, crept, 2.5, 5.0)
    (closed,) = navigator.behaviour.closed
    assert (
        min(math.hypot(x - crept.x_m, y - crept.y_m) for x, y in closed.polygon)
        > HUSKY.circumscribed_radius_m
    )


def given_up() -> tuple[Behaviour, Frame, Route]:
    """The behaviours of a robot that has given up, with its next frame and its route."""
    navigator, here = blocked_navigator(), Pose2(x_m=-3.0, y_m=0.0, yaw_rad=0.0)
    route, outcomes = stuck_for(navigator, here, 0.0, 47.0)
    assert outcomes[-1] is ControllerState.GIVEN_UP
    return navigator.behaviour, picture(pose=here, stamp_ns=48_000_000_000), route


TURNS = Motion(twist=Twist(v_mps=0.0, w_radps=0.5), outcome=ControllerState.TURN)


def test_a_robot_that_gave_up_goes_on_once_it_can_turn_and_starts_afresh_elsewhere() -> None:
    gave_up, frame, route = given_up()
    assert supervised(gave_up, TURNS, frame, route, ORDER)[1] == TURNS
    other = dataclasses.replace(ORDER, goal=(-3.0, 2.0))
    behaviour, motion = supervised(gave_up, STUCK, frame, route, other)
    assert motion.outcome is ControllerState.BLOCKED  # it waits, as at first
    assert behaviour.recovery.tried is RecoveryAction.NONE


WAITS = Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)


def person(x: float, *, stood_s: float = 0.0) -> Track:
    """A person who has come up along y = 0 and stands."""
    return Track(
        id=1,
        x_m=x,
        y_m=0.0,
        vx_mps=0.0,
        vy_mps=0.0,
        radius_m=0.25,
        age_s=20.0,
        last_seen_ns=0,
        walking_speed_mps=0.8,
        stood_s=stood_s,
    )


def recovering(
    seconds: float,
    motion: Motion,
    *,
    held: bool = False,
    x_m: float = -2.2,
    comes_each_s: float = math.inf,
    people: PeopleConfig | None = None,
) -> list[RecoveryAction]:
    """Recoveries, without repetitions, of a robot whose front is at x = −2.5 m while a person comes
    up to x_m, and comes back as often."""
    here = Pose2(x_m=-3.0, y_m=0.0, yaw_rad=0.0)
    route, _ = stuck_for(blocked_navigator(), here, 0.0, 0.1)
    config = NavigatorConfig(people=people or PeopleConfig())
    behaviour, actions = Behaviour().towards(ORDER), list[RecoveryAction]()
    for tick in range(round(seconds / PERIOD_S)):
        stood_s = tick * PERIOD_S % comes_each_s
        behaviour, _ = behaviour.after(
            motion,
            frame=picture(pose=here, stamp_ns=round(tick * PERIOD_S * 1e9)),
            route=route,
            people=(person(x_m, stood_s=stood_s),),
            profile=HUSKY,
            config=config,
            held=held,
        )
        if not actions or behaviour.recovery.action is not actions[-1]:
            actions.append(behaviour.recovery.action)
    return actions


ONWARD = Motion(twist=STANDSTILL, outcome=ControllerState.FOLLOW)


@pytest.mark.parametrize(("motion", "held"), [(STUCK, False), (ONWARD, True)])
def test_a_person_who_walks_on_soon_is_waited_for_and_nothing_to_recover_from(
    motion: Motion, *, held: bool
) -> None:
    waits_s = PeopleConfig().settled_s - 1.0
    assert recovering(waits_s, motion, held=held) == [RecoveryAction.NONE]
    near_m = PeopleConfig().near_m + person(0.0).radius_m
    assert recovering(waits_s, motion, held=held, x_m=-2.55 + near_m) == [RecoveryAction.NONE]
    # Controls: one who stands farther away, who has stayed, who gives way to nothing.
    assert len(recovering(waits_s, motion, held=held, x_m=-2.45 + near_m)) > 1
    assert len(recovering(PeopleConfig().settled_s + 3.0, motion, held=held)) > 1
    stubborn = PeopleConfig(non_cooperative=True)
    assert len(recovering(waits_s, motion, held=held, people=stubborn)) > 1


def test_people_who_come_back_again_and_again_keep_a_blocked_robot_for_so_long_and_no_longer() -> (
    None
):
    assert recovering(RULES.people_s - 1.0, STUCK, comes_each_s=4.0) == [RecoveryAction.NONE]
    longer = recovering(RULES.people_s + 10.0, STUCK, comes_each_s=4.0)
    assert longer[:3] == [RecoveryAction.NONE, RecoveryAction.WAIT, RecoveryAction.BACK_UP]


def test_what_was_given_up_is_tried_again_once_only_people_are_in_the_way() -> None:
    gave_up, frame, route = given_up()
    behaviour, motion = supervised(gave_up, WAITS, frame, route, ORDER)
    assert motion == WAITS
    assert behaviour.recovery == Recovery()
    # Who comes to clear the way does not open it by being there.
    _, motion = supervised(gave_up, STUCK, frame, route, ORDER, people=(person(-2.2),))
    assert motion.outcome is ControllerState.GIVEN_UP


def test_a_robot_that_crosses_a_lane_may_begin_its_manoeuvre_again_as_often_as_it_must() -> None:
    here = Pose2(x_m=-3.0, y_m=0.0, yaw_rad=0.0)
    for active in (False, True):
        behaviour = Behaviour(lane_retreat=LaneRetreat(active=active)).towards(ORDER)
        for tick in range(RULES.tries + 2):
            began = Pose2(x_m=-3.0 - 0.01 * tick, y_m=0.0, yaw_rad=0.0)
            motion = Motion(
                twist=Twist(v_mps=-0.2, w_radps=0.0),
                outcome=ControllerState.MANOEUVRE,
                began=began,
            )
            recovery = behaviour._recovered(
                motion,
                picture(pose=here, stamp_ns=tick * 100_000_000),
                (),
                HUSKY,
                NavigatorConfig(),
                held=False,
                step_s=PERIOD_S,
            )
            behaviour = dataclasses.replace(behaviour, recovery=recovery)
        assert (behaviour.recovery.backs >= RULES.tries) != active


def test_where_it_was_sent_to_look_and_sees_no_way_what_it_found_closed_is_a_way_again() -> None:
    navigator = blocked_navigator()
    here = Pose2(x_m=-3.0, y_m=0.0, yaw_rad=0.0)
    route, _ = stuck_for(navigator, here, 0.0, 7.0)
    assert navigator.behaviour.closed
    looked = dataclasses.replace(route, outcome=NoPath(reason=Reason.UNREACHABLE))
    frame = picture(pose=here, stamp_ns=8_000_000_000)
    behaviour, _ = supervised(navigator.behaviour, IDLE, frame, looked, ORDER)
    assert not behaviour.closed


def test_a_robot_told_to_leave_tries_again_behind_a_passage_that_it_has_closed_itself() -> None:
    leave = dataclasses.replace(ORDER, goal=None, leave=True)
    passage = closed_way(wall((-1.0, 5.0), (0.0, 0.0)), HERE, HUSKY)
    assert passage is not None
    behaviour = dataclasses.replace(Behaviour().towards(leave), closed=(passage,))
    unreachable = NoPath(reason=Reason.UNREACHABLE)
    none = Route(outcome=unreachable, points=NONE, waypoints=NONE, track=NONE)
    frame = picture(pose=HERE, stamp_ns=1_000_000_000)
    behaviour, _ = supervised(behaviour, IDLE, frame, none, leave)
    assert not behaviour.closed
    assert behaviour.recovery.action is RecoveryAction.GIVE_UP and behaviour.recovery.stands_s > 0


def test_a_robot_that_was_moved_starts_afresh_on_the_way_to_the_same_goal() -> None:
    passage = closed_way(wall((-1.0, 5.0), (0.0, 0.0)), HERE, HUSKY)
    assert passage is not None
    to_goal = Behaviour().towards(ORDER)
    lanes = LaneKeepOut(zones=(passage,))
    moved = dataclasses.replace(to_goal, closed=(passage,), lanes=lanes, dead_ends=1, trail=AHEAD)
    afresh = moved.after_reset()
    assert afresh.keep_outs == () and len(afresh.trail) == 0
    assert afresh.towards(ORDER) is afresh


def test_where_all_passages_are_blocked_the_robot_stands_longer_each_time() -> None:
    """Else it drives from one blocked passage to the other for ever."""
    navigator = blocked_navigator()
    route, _ = stuck_for(navigator, HERE, 0.0, 0.1)
    behaviour, at_s, stood_s = navigator.behaviour, 1.0, list[float]()
    ahead = Motion(twist=Twist(v_mps=0.5, w_radps=0.0), outcome=ControllerState.FOLLOW)
    none = dataclasses.replace(route, points=NONE, outcome=NoPath(reason=Reason.UNREACHABLE))
    passage = closed_way(wall((-1.0, 5.0), (0.0, 0.0)), HERE, HUSKY)
    assert passage is not None
    for _ in range(3):
        behaviour = dataclasses.replace(behaviour, closed=(passage,))
        frame = picture(pose=HERE, stamp_ns=round(at_s * 1e9))
        behaviour, _ = supervised(behaviour, IDLE, frame, none, ORDER)
        began_s = at_s
        for _ in range(600):
            at_s += 0.2
            frame = picture(pose=HERE, stamp_ns=round(at_s * 1e9))
            behaviour, motion = supervised(behaviour, ahead, frame, route, ORDER)
            if motion.outcome is not ControllerState.GIVEN_UP:
                break
        stood_s.append(at_s - began_s)
    assert stood_s == pytest.approx([RULES.again_s * factor for factor in (1, 2, 4)], abs=0.3)
    # A goal that is covered for a moment is no dead end.
    covered = dataclasses.replace(none, outcome=NoPath(reason=Reason.GOAL_BLOCKED))
    frame = picture(pose=HERE, stamp_ns=round((at_s + 1.0) * 1e9))
    behaviour, _ = supervised(
        dataclasses.replace(behaviour, closed=(passage,)), IDLE, frame, covered, ORDER
    )
    frame = picture(pose=HERE, stamp_ns=round((at_s + 1.2) * 1e9))
    behaviour, motion = supervised(behaviour, ahead, frame, route, ORDER)
    assert behaviour.dead_ends == 3 and motion.outcome is ControllerState.FOLLOW
    elsewhere = behaviour.towards(dataclasses.replace(ORDER, goal=(1.0, 1.0)))
    assert elsewhere.dead_ends == 0


def test_a_robot_that_the_gate_holds_backs_off_without_waiting_then_tries_what_is_stronger() -> (
    None
):
    onward, here = Motion(twist=STANDSTILL, outcome=ControllerState.FOLLOW), HERE
    recovery, tried, t_ns = Recovery(), list[RecoveryAction](), 0
    for held in (False, True, True, True, True, True, True, True, True):
        t_ns += 1_000_000_000
        recovery = recovery.after(onward, here, t_ns, RULES, held=held)
        if not tried or recovery.action is not tried[-1]:
            tried.append(recovery.action)
    assert [action for action in tried if action is not RecoveryAction.NONE] == [
        RecoveryAction.BACK_UP,
        RecoveryAction.SPIN,
        RecoveryAction.CLOSE,
        RecoveryAction.GIVE_UP,
    ]
    for _ in range(int(RULES.again_s) - 2):
        t_ns += 1_000_000_000
        recovery = recovery.after(onward, here, t_ns, RULES)
        assert recovery.action is RecoveryAction.GIVE_UP, "also while the gate is not asked"
    assert recovery.after(onward, here, t_ns + 2_000_000_000, RULES) == Recovery()
    # Control: without the gate's word a robot that follows its path is never blocked.
    assert Recovery().after(onward, here, t_ns, RULES).action is RecoveryAction.NONE


def test_the_margins_of_those_who_stand_give_way_only_after_a_wait_there() -> None:
    def passes_close(recovery: Recovery) -> bool:
        behaviour = Behaviour(recovery=recovery)
        return behaviour.expectations(HERE, HUSKY, NavigatorConfig()).passes_close

    def after(
        recovery: Recovery, motion: Motion, t_s: float, *, held: bool = False, x_m: float = 0.0
    ) -> Recovery:
        pose = Pose2(x_m=x_m, y_m=0.0, yaw_rad=0.0)
        return recovery.after(motion, pose, round(t_s * 1e9), RULES, held=held)

    follows = Motion(twist=Twist(v_mps=0.2, w_radps=0.0), outcome=ControllerState.FOLLOW)
    held = after(Recovery(), follows, 0.0, held=True)
    assert held.action is RecoveryAction.BACK_UP and not passes_close(held)
    waits = after(Recovery(), STUCK, 0.0)
    assert waits.action is RecoveryAction.WAIT and not passes_close(waits)
    backs = after(waits, STUCK, RULES.wait_s + 0.1)
    assert backs.action is RecoveryAction.BACK_UP and passes_close(backs)
    ended = after(backs, STUCK, RULES.wait_s + 0.2)
    assert passes_close(after(ended, follows, RULES.wait_s + 0.3, x_m=-RULES.back_m))
    away_m = RULES.back_m + 0.6
    assert not passes_close(after(ended, follows, RULES.wait_s + 0.3, x_m=away_m))
    # Before another one, where it is still near the position at which it was blocked first.
    waits = after(ended, STUCK, 10.0, x_m=away_m)
    assert waits.at == HERE and waits.action is RecoveryAction.WAIT
    backs = after(waits, STUCK, 10.1 + RULES.wait_s, x_m=away_m)
    assert passes_close(after(backs, STUCK, 10.2 + RULES.wait_s, x_m=away_m))
    among_movers = NavigatorConfig(people=PeopleConfig(non_cooperative=True))
    assert not Behaviour(recovery=backs).expectations(HERE, HUSKY, among_movers).passes_close
