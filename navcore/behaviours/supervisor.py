"""Supervision of the controller: recovery, waiting for people, keep-outs of the robot's own."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from navcore.behaviours.absence import Absence
from navcore.behaviours.lane_keep_out import LaneKeepOut
from navcore.behaviours.lane_retreat import LaneRetreat
from navcore.behaviours.recovery import Recovery, RecoveryAction, closed_way, trail_with
from navcore.behaviours.waiting import WaitingTimer, elapsed_s
from navcore.config.behaviours import RecoveryConfig
from navcore.config.navigator import NavigatorConfig
from navcore.config.people import PeopleConfig
from navcore.control.motion import ControllerState, Motion
from navcore.control.people.people_state import PeopleExpectations, may_walk
from navcore.geometry.arrays import Points
from navcore.geometry.transform import STANDSTILL, Pose2
from navcore.mission.order import NavigationRequest
from navcore.mission.zone import Zone
from navcore.perception.people.track import Track
from navcore.planning.path import NoPath, Reason
from navcore.planning.route import NO_POINTS, Route
from navcore.robot.frame import Frame
from navcore.robot.profile import RobotProfile

MOST_DOUBLINGS = 6
"""How often the time is doubled for which the robot stands where all passages are blocked."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Behaviour:
    """The state of all behaviours: a value with one transition, `after`, for each tick."""

    recovery: Recovery = dataclasses.field(default_factory=Recovery)
    """Recovery of a robot that is blocked."""
    waiting: WaitingTimer = dataclasses.field(default_factory=WaitingTimer)
    """How long the robot has waited for people."""
    lanes: LaneKeepOut = dataclasses.field(default_factory=LaneKeepOut)
    """Lanes of people who walk to and fro."""
    absence: Absence = dataclasses.field(default_factory=Absence)
    """How long people who walk to and fro stay out of sight."""
    lane_retreat: LaneRetreat = dataclasses.field(default_factory=LaneRetreat)
    """Retreat from such a lane."""
    closed: tuple[Zone, ...] = ()
    """Passages that turned out to be blocked on the way to the present goal, or out of an area."""
    dead_ends: int = 0
    """How often all passages to it turned out to be blocked."""
    trail: Points = dataclasses.field(default_factory=lambda: NO_POINTS)
    """(N, 2) driven path in the map frame, newest first."""
    target: tuple[object, ...] = ()
    """Goal, heading and whether to leave an area, as of the newest tick."""

    @property
    def keep_outs(self) -> tuple[Zone, ...]:
        """Zones that the robot avoids of its own accord."""
        return (*self.closed, *self.lanes.zones)

    @property
    def leaves_lane(self) -> bool:
        """Whether the robot backs off from a lane, and does not cross it."""
        return self.lane_retreat.active and not self.absence.crosses

    @property
    def retreat(self) -> Points | None:
        """(N, 2) driven path to back off along, map frame; None unless the recovery backs off or
        the robot leaves a lane."""
        backs = self.leaves_lane or self.recovery.action is RecoveryAction.BACK_UP
        return self.trail if backs else None

    def expectations(
        self, pose: Pose2, profile: RobotProfile, config: NavigatorConfig
    ) -> PeopleExpectations:
        """Return what the local planner has to know of people beside a robot at a pose."""
        absence, rules = self.absence, config.behaviours.absence
        return PeopleExpectations(
            walked=self.lanes.walked_positions,
            away=absence.who,
            away_s=absence.stays_s(rules) if absence.crosses else 0.0,
            expects_return=absence.expects_return(rules)
            and not self._is_in_lane(pose, profile, config),
            leaves_lane=self.leaves_lane,
            is_cautious=self.waiting.has_just_ended(config.people) and not absence.crosses,
            ignore_predictions=self.waiting.is_over(config.people),
            passes_close=self.recovery.waited_at is not None and not config.people.non_cooperative,
        )

    def _is_in_lane(self, pose: Pose2, profile: RobotProfile, config: NavigatorConfig) -> bool:
        """Return whether a robot at a pose is so near to where people walked that it had better not
        wait there until they are back."""
        near_m = config.behaviours.lanes.person_radius_m + config.people.personal_m
        walked = pose.from_parent(self.lanes.walked_positions)
        return any(profile.gap_m(x, y) <= near_m for x, y in walked.tolist())

    @property
    def has_failed(self) -> bool:
        """Whether the recovery has found no way on, and does not stand for that."""
        has_none = self.recovery.action in (RecoveryAction.CLOSE, RecoveryAction.GIVE_UP)
        return has_none and self.recovery.stands_s == 0.0

    @property
    def spins(self) -> bool:
        """Whether the recovery turns the robot once in place."""
        return self.recovery.action is RecoveryAction.SPIN

    def towards(self, request: NavigationRequest) -> Behaviour:
        """Start afresh for another goal: what was blocked before need not be."""
        target = (request.goal, request.goal_yaw_rad, request.leave)
        if target == self.target:
            return self
        return dataclasses.replace(self, target=target, closed=(), dead_ends=0, recovery=Recovery())

    def on_another_way(self) -> Behaviour:
        """Start the recovery afresh: the route leads elsewhere from here."""
        return dataclasses.replace(self, recovery=Recovery())

    def after_reset(self) -> Behaviour:
        """Start afresh on the way to the same goal: the robot was moved by other means, and what
        was found blocked from its former place need not be there."""
        return Behaviour(target=self.target)

    def corrected(self, motion: Pose2, *, jumps: bool) -> Behaviour:
        """Follow a correction of the robot's place on the map, T_new_old: the driven path stays
        where odometry has it beside the robot. Start afresh after one that `jumps`."""
        rest = self.after_reset() if jumps else self
        return dataclasses.replace(rest, trail=motion.to_parent(self.trail))

    def after(
        self,
        motion: Motion,
        *,
        frame: Frame,
        route: Route | None,
        people: tuple[Track, ...],
        profile: RobotProfile,
        config: NavigatorConfig,
        held: bool = False,
    ) -> tuple[Behaviour, Motion]:
        """Return the state after one more tick and the motion to carry out.

        `motion` is the controller's, `held` whether the safety gate keeps the robot from it. It is
        replaced by standing while the robot waits for the path to clear, or when every recovery has
        failed.
        """
        now = self._with_people(motion, frame, route, people, profile, config)
        now = dataclasses.replace(now, trail=trail_with(now.trail, frame.pose, config.recovery))
        at_viewpoint = (
            route is not None and not route.reaches_goal and motion.outcome is ControllerState.IDLE
        )
        if route is None or len(route.points) == 0 or at_viewpoint:
            return now._without_path(frame, route, config.recovery), motion
        step_s = elapsed_s(self.waiting.now_ns, frame.stamp_ns, config.behaviours.waiting)
        recovery = now._recovered(motion, frame, people, profile, config, held=held, step_s=step_s)
        closed = now.closed
        closes = recovery.action is RecoveryAction.CLOSE
        if (
            closes
            and now.recovery.action is not RecoveryAction.CLOSE
            and now.recovery.at is not None
        ):
            # Ahead of where the robot stands now: it has moved a little since it was blocked, and
            # must not stand inside of what it closes.
            way = closed_way(route.track, frame.pose, profile, config.recovery)
            closed = closed if way is None else (*closed, way)
        if recovery.action is RecoveryAction.GIVE_UP:
            closed = ()  # should one of the passages be open again, the robot goes on
        now = dataclasses.replace(now, recovery=recovery, closed=closed)
        return now, now._directed(motion)

    def _with_people(
        self,
        motion: Motion,
        frame: Frame,
        route: Route | None,
        people: tuple[Track, ...],
        profile: RobotProfile,
        config: NavigatorConfig,
    ) -> Behaviour:
        pose, stamp_ns = frame.pose, frame.stamp_ns
        lanes = self.lanes.after(
            motion,
            people,
            pose,
            stamp_ns,
            route_m=None if route is None else route.length_m,
            profile=profile,
            people_config=config.people,
            config=config.behaviours,
        )
        in_view_s = config.behaviours.absence.in_view_s
        waiting = self.waiting.after(
            motion,
            pose,
            stamp_ns,
            config.behaviours.waiting,
            is_lost=any(
                person.walking_speed_mps > 0.0 and person.unseen_s >= in_view_s for person in people
            ),
        )
        lane_retreat = self.lane_retreat.after(
            motion,
            pose,
            stamp_ns,
            walked=lanes.walked_positions,
            trail=self.trail,
            waited_s=waiting.waited_s,
            profile=profile,
            people_config=config.people,
            config=config.behaviours,
        )
        return dataclasses.replace(
            self,
            waiting=waiting,
            lanes=lanes,
            lane_retreat=lane_retreat,
            absence=self.absence.after(motion, people, pose, stamp_ns, config.behaviours.absence),
        )

    def _recovered(
        self,
        motion: Motion,
        frame: Frame,
        people: tuple[Track, ...],
        profile: RobotProfile,
        config: NavigatorConfig,
        *,
        held: bool,
        step_s: float,
    ) -> Recovery:
        """Return the recovery after one more tick, `step_s` seconds after the one before.

        A person who is beside a blocked robot, and may walk on, is waited for. To cross their lane
        the robot begins a manoeuvre again each time they are away, which is no failure.
        """
        rules, pose = config.recovery, frame.pose
        if not config.people.non_cooperative and _is_beside(people, pose, profile, config.people):
            waits = self.recovery.beside_people(motion, pose, step_s, rules, held=held)
            if waits is not None:
                return waits
        if self.lane_retreat.active:
            motion = dataclasses.replace(motion, began=None)
        return self.recovery.after(motion, pose, frame.stamp_ns, rules, held=held)

    def _without_path(self, frame: Frame, route: Route | None, rules: RecoveryConfig) -> Behaviour:
        if self.closed:
            # Only a passage that was closed may be in the way: rather give up at this pose than
            # report that no path exists.
            given_up = Recovery(
                action=RecoveryAction.GIVE_UP,
                tried=RecoveryAction.CLOSE,
                at=frame.pose,
                since_ns=frame.stamp_ns,
            )
            dead_ends = self.dead_ends
            if route is not None and route.outcome == NoPath(reason=Reason.UNREACHABLE):
                # Each time it stands longer, or it would drive from one blocked passage to the
                # other for ever.
                stands_s = rules.again_s * 2.0 ** min(dead_ends, MOST_DOUBLINGS)
                given_up = dataclasses.replace(given_up, stands_s=stands_s)
                dead_ends += 1
            return dataclasses.replace(self, closed=(), dead_ends=dead_ends, recovery=given_up)
        return dataclasses.replace(self, recovery=Recovery())

    def _directed(self, motion: Motion) -> Motion:
        if self.recovery.action is RecoveryAction.GIVE_UP:
            given_up = ControllerState.GIVEN_UP
            return Motion(twist=STANDSTILL, outcome=given_up, unseen=motion.unseen)
        if self.recovery.action is RecoveryAction.WAIT:
            blocked = ControllerState.BLOCKED
            return Motion(twist=STANDSTILL, outcome=blocked, unseen=motion.unseen)
        return motion


def _is_beside(
    people: tuple[Track, ...], pose: Pose2, profile: RobotProfile, rules: PeopleConfig
) -> bool:
    """Return whether a person who walks, or has only stopped, is near a robot at a pose."""
    walkers = [person for person in people if may_walk(person, rules)]
    at = pose.from_parent(np.array([(person.x_m, person.y_m) for person in walkers]).reshape(-1, 2))
    return any(
        profile.gap_m(x, y) - person.radius_m <= rules.near_m
        for person, (x, y) in zip(walkers, at.tolist(), strict=True)
    )
