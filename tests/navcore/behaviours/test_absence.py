"""A robot beside the lane of a person crosses by how long they stayed out of sight before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navcore.behaviours.absence import Absence
from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.behaviours.lane_retreat import LaneRetreat
from navcore.behaviours.recovery import Recovery, RecoveryAction
from navcore.behaviours.supervisor import Behaviour
from navcore.behaviours.waiting import WaitingTimer
from navcore.config.navigator import NavigatorConfig
from navcore.control.motion import ControllerState, Motion
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.perception.people.track import Track
from navcore.robot.profile import HUSKY

WAITS = Motion(twist=STANDSTILL, outcome=ControllerState.WAIT_FOR_PEOPLE)
DRIVES = Motion(twist=Twist(v_mps=0.5, w_radps=0.0), outcome=ControllerState.FOLLOW)
BESIDE = Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)
PERIOD_S = 0.1


def person(y_m: float, *, unseen_s: float = 0.0, walked: bool = True) -> Track:
    """A person in a lane along y, 2 m before the robot."""
    return Track(
        id=1,
        x_m=2.0,
        y_m=y_m,
        vx_mps=0.0,
        vy_mps=0.8 if walked else 0.0,
        radius_m=0.3,
        age_s=9.0,
        last_seen_ns=0,
        unseen_s=unseen_s,
        walking_speed_mps=0.8 if walked else 0.0,
    )


class Watch:
    """A robot that watches a lane."""

    def __init__(self) -> None:
        self.absence, self.t_s = Absence(), 0.0

    def go(
        self,
        seconds: float,
        *people: Track,
        motion: Motion = WAITS,
        pose: Pose2 = BESIDE,
    ) -> Absence:
        for _ in range(round(seconds / PERIOD_S)):
            self.t_s += PERIOD_S
            self.absence = self.absence.after(motion, people, pose, round(self.t_s * 1e9))
        return self.absence

    def passes(self, *gone_s: float, left: bool = True) -> Absence:
        """Let a person be in view before and after being gone for these times on one side."""
        side = person(1.5 if left else -1.5)
        self.go(2.0, side)
        for seconds in gone_s:
            self.go(seconds)
            self.go(2.0, side)
        return self.absence


def test_after_an_absence_the_robot_crosses_as_soon_as_the_person_has_gone() -> None:
    watch = Watch()
    watch.passes()
    assert not watch.go(1.0).crosses, "they have not been gone before"
    assert Watch().passes(10.0).stays_s() == pytest.approx(8.0, abs=0.2)
    again = Watch()
    assert again.passes(10.0, 12.0).stays_s() == pytest.approx(8.0, abs=0.2)
    gone = again.go(0.2)
    assert gone.crosses and not gone.expects_return()
    assert again.go(7.0, motion=DRIVES).crosses, "it drives on until they may be back"
    assert not again.go(2.0, motion=DRIVES).crosses


def test_a_robot_on_its_way_does_not_stop_when_they_may_be_on_their_way_back() -> None:
    watch = Watch()
    watch.passes(6.0, 6.0)
    lost = person(1.5, unseen_s=1.0)
    assert watch.go(0.5, lost).crosses
    assert watch.go(7.0, lost, motion=DRIVES, pose=Pose2(x_m=4.0, y_m=0.0, yaw_rad=0.0)).crosses
    assert not watch.go(0.1, lost).crosses, "it waits again, and does not know when they are back"
    assert not watch.go(0.1, motion=DRIVES).crosses


def test_a_robot_that_still_waits_when_little_time_is_left_waits_until_they_are_back() -> None:
    watch = Watch()
    watch.passes(10.0, 12.0)
    watch.go(4.5, motion=DRIVES)  # it did something else
    gone = watch.go(0.5)
    assert not gone.crosses and gone.expects_return()
    assert watch.go(8.0).expects_return()
    assert not watch.go(5.0).expects_return(), "they do not come back"
    back = watch.go(0.5, person(1.5))
    assert not back.crosses and not back.expects_return()


def test_absences_that_are_too_short_to_cross_are_waited_for() -> None:
    watch = Watch()
    watch.passes(4.0, 4.0)
    gone = watch.go(1.0)
    assert not gone.crosses and gone.expects_return()


def test_each_side_has_its_own_absences() -> None:
    watch = Watch()
    watch.passes(4.0, 4.0, left=True)
    watch.go(5.0)
    watch.passes(12.0, 12.0, left=False)
    assert watch.go(1.0).crosses
    watch.passes(left=True)
    assert not watch.go(1.0).crosses


def test_who_never_walked_or_was_elsewhere_for_long_does_not_count() -> None:
    watch = Watch()
    watch.passes(60.0, 60.0)
    assert not watch.go(1.0).crosses and not watch.absence.expects_return()
    standing = Watch()
    for _ in range(3):
        standing.go(2.0, person(1.5, walked=False))
        standing.go(8.0)
    assert standing.absence == Absence(now_ns=standing.absence.now_ns)


def test_elsewhere_nothing_is_expected() -> None:
    watch = Watch()
    watch.passes(10.0, 10.0)
    away = watch.go(1.0, pose=Pose2(x_m=0.0, y_m=3.5, yaw_rad=0.0))
    assert not away.crosses and away.lasted == ()


def test_a_robot_that_crosses_goes_on_however_far_it_has_come() -> None:
    watch = Watch()
    watch.go(0.5, person(1.5), motion=DRIVES)  # seen from afar first, and come up to then
    waiting = Pose2(x_m=2.9, y_m=0.0, yaw_rad=0.0)
    side = person(1.5)
    for _ in range(2):
        watch.go(2.0, side, pose=waiting)
        watch.go(10.0, pose=waiting)
    watch.go(2.0, side, pose=waiting)
    assert watch.go(0.5, pose=waiting).crosses
    assert watch.go(2.0, motion=DRIVES, pose=Pose2(x_m=5.0, y_m=0.0, yaw_rad=0.0)).crosses
    assert watch.go(2.0, motion=DRIVES, pose=Pose2(x_m=6.5, y_m=0.0, yaw_rad=0.0)).crosses


def test_only_those_who_left_on_that_side_are_away() -> None:
    watch = Watch()
    watch.passes(10.0, 10.0)
    other = replace(person(-1.5), id=2)
    watch.go(0.5, person(1.0), other)
    assert watch.go(0.5).who == {1}


def test_a_robot_in_the_lane_does_not_wait_there_for_a_return() -> None:
    watch = Watch()
    watch.passes(4.0, 4.0)
    gone = watch.go(1.0)
    assert gone.expects_return()
    for y_m, waits in ((0.0, False), (2.0, True)):
        lane = LaneKeepOut(walked=((0, 1, 0.5, y_m), (0, 1, -0.5, y_m)))
        behaviour = Behaviour(absence=gone, lanes=lane)
        expectations = behaviour.expectations(BESIDE, HUSKY, NavigatorConfig())
        assert expectations.expects_return == waits


def test_after_a_wait_for_lost_people_the_robot_is_cautious_unless_it_crosses() -> None:
    def is_cautious(absence: Absence, driven_s: float = 0.5) -> bool:
        waiting = WaitingTimer(at=BESIDE, driven_s=driven_s, now_ns=absence.now_ns)
        behaviour = Behaviour(absence=absence, waiting=waiting)
        return behaviour.expectations(BESIDE, HUSKY, NavigatorConfig()).is_cautious

    watch = Watch()
    watch.go(2.0, person(1.5))
    gone = watch.go(8.0)
    assert is_cautious(gone) and not is_cautious(gone, driven_s=3.0)
    again = Watch()
    again.passes(10.0, 10.0)
    crossing = again.go(2.0)
    assert crossing.crosses and not is_cautious(crossing)


def test_a_person_who_comes_into_view_ends_the_crossing() -> None:
    watch = Watch()
    watch.passes(10.0, 10.0)
    assert watch.go(2.0).crosses
    assert not watch.go(0.1, person(1.5), motion=DRIVES).crosses
    assert watch.go(0.1, person(1.5, unseen_s=0.2), motion=DRIVES).stays_s() > 0.0


def test_a_robot_that_crosses_no_longer_backs_off_from_the_lane() -> None:
    trail = np.column_stack([np.linspace(0.0, 2.0, 21), np.zeros(21)])
    leaves = Behaviour(lane_retreat=LaneRetreat(active=True), trail=trail)
    assert leaves.retreat is trail
    crosses = replace(leaves, absence=Absence(crosses=True))
    assert crosses.retreat is None
    blocked = replace(crosses, recovery=Recovery(action=RecoveryAction.BACK_UP))
    assert blocked.retreat is trail


def test_a_robot_that_backs_off_crosses_as_soon_as_the_person_has_gone() -> None:
    backs = Motion(twist=Twist(v_mps=-0.2, w_radps=0.0), outcome=ControllerState.BACK)
    watch = Watch()
    watch.passes(10.0)
    assert watch.go(0.2, motion=backs).crosses
