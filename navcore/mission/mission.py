"""The operator's goals, in order, and whether the robot may drive to them. A value with its
transitions."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from navcore.errors import BadGeometry, NotKnown, Refused
from navcore.geometry.transform import wrap_angle
from navcore.grid.grid import GridSpec

MAX_GOALS = 1000
"""That wait, and of those reached the newest."""


class Phase(StrEnum):
    """What the operator has asked for."""

    IDLE = "idle"
    """Not started, or everything done or cancelled."""
    DRIVING = "driving"
    """On the way to the first goal of the queue."""
    PAUSED = "paused"
    """Standing until the operator resumes."""
    LEAVING = "leaving"
    """On the way out of the beware area that the robot stands in; the goals wait."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A place to stand on."""

    id: int
    """Unique within a mission."""
    x_m: float
    """Map frame."""
    y_m: float
    """Map frame."""
    yaw_rad: float | None = None
    """Heading to stand in, map frame; None for any."""
    name: str = ""
    """What the operator calls it; empty without a name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """S → G1 → G2 → …"""

    phase: Phase = Phase.IDLE
    """What the operator has asked for."""
    queue: tuple[Goal, ...] = ()
    """Goals still to reach, the present one first."""
    reached: tuple[Goal, ...] = ()
    """Goals of this mission already reached, oldest first."""
    cancelled: bool = False
    """Whether the last mission was cancelled rather than driven to its end."""
    next_id: int = 1
    """Id of the goal that is added next."""
    loop: bool = False
    """Whether a goal that is reached waits again, behind the others."""

    @property
    def goal(self) -> Goal | None:
        """Where the robot may drive now; None unless it is driving."""
        return self.queue[0] if self.phase is Phase.DRIVING else None

    def add(
        self,
        x_m: float,
        y_m: float,
        spec: GridSpec,
        *,
        yaw_rad: float | None = None,
        name: str = "",
    ) -> Mission:
        """Queue one more goal; raises `BadGeometry` outside the map."""
        if len(self.queue) >= MAX_GOALS:
            raise Refused(f"the queue is full, at most {MAX_GOALS} goals wait")
        goal = checked(Goal(id=self.next_id, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, name=name), spec)
        return dataclasses.replace(self, queue=(*self.queue, goal), next_id=self.next_id + 1)

    def change(self, goal: Goal, spec: GridSpec) -> Mission:
        """Put a goal in the place of the waiting one with its id; raises `BadGeometry` outside the
        map."""
        self.waiting(goal.id)
        goal = checked(goal, spec)
        return dataclasses.replace(
            self, queue=tuple(goal if old.id == goal.id else old for old in self.queue)
        )

    def reorder(self, ids: Sequence[int]) -> Mission:
        """Let the waiting goals be driven to in this order; every one has to be named once."""
        if sorted(ids) != sorted(goal.id for goal in self.queue):
            raise Refused(
                "the order has to name every waiting goal once; the queue has changed meanwhile, look again"
            )
        return dataclasses.replace(self, queue=tuple(self.waiting(goal_id) for goal_id in ids))

    def repeat(self, loop: bool) -> Mission:
        """Whether goals that are reached wait again."""
        return dataclasses.replace(self, loop=loop)

    def refill(self, goals: Sequence[Goal], spec: GridSpec, *, loop: bool) -> Mission:
        """These goals, under new ids, in the place of those that wait; only while standing."""
        if self.phase in (Phase.DRIVING, Phase.LEAVING):
            raise Refused(
                f"the mission is {self.phase}; pause or cancel it before another is loaded"
            )
        empty = dataclasses.replace(
            self, queue=(), phase=Phase.IDLE, reached=(), loop=loop, cancelled=False
        )
        for goal in goals:
            empty = empty.add(goal.x_m, goal.y_m, spec, yaw_rad=goal.yaw_rad, name=goal.name)
        return empty

    def waiting(self, goal_id: int) -> Goal:
        """The waiting goal with an id; raises `NotKnown`."""
        for goal in self.queue:
            if goal.id == goal_id:
                return goal
        raise NotKnown(f"no waiting goal has the id {goal_id}")

    def remove(self, goal_id: int) -> Mission:
        """Take a waiting goal, or the present one, out of the queue."""
        gone = self.waiting(goal_id)
        queue = tuple(goal for goal in self.queue if goal is not gone)
        return dataclasses.replace(self, queue=queue, phase=self.phase if queue else Phase.IDLE)

    def start(self) -> Mission:
        """Begin to drive to the first goal of the queue."""
        if not self.queue:
            raise Refused("there is no goal to drive to; add one first")
        if self.phase in (Phase.PAUSED, Phase.LEAVING):
            raise Refused(f"the mission is {self.phase}; resume or cancel it")
        reached = () if self.phase is Phase.IDLE else self.reached
        return dataclasses.replace(self, phase=Phase.DRIVING, reached=reached, cancelled=False)

    def pause(self) -> Mission:
        """Stand still and keep the goals."""
        if self.phase is Phase.LEAVING:
            return self.left()
        if self.phase is not Phase.DRIVING:
            raise Refused(f"only a driving mission can be paused, this one is {self.phase}")
        return dataclasses.replace(self, phase=Phase.PAUSED)

    def resume(self) -> Mission:
        """Drive on after a pause."""
        if self.phase is not Phase.PAUSED:
            raise Refused(f"only a paused mission can be resumed, this one is {self.phase}")
        return dataclasses.replace(self, phase=Phase.DRIVING)

    def leave(self) -> Mission:
        """Drive out of the beware area that the robot stands in."""
        return dataclasses.replace(self, phase=Phase.LEAVING)

    def left(self) -> Mission:
        """The area is left: stand, and go on with the goals when the operator says so."""
        return dataclasses.replace(self, phase=Phase.PAUSED if self.queue else Phase.IDLE)

    def cancel(self) -> Mission:
        """Stand still and forget the goals that wait."""
        return dataclasses.replace(self, phase=Phase.IDLE, queue=(), cancelled=True)

    def arrive(self) -> Mission:
        """The present goal is reached: go on to the next, or be done."""
        if not self.queue:
            raise Refused("there is no goal to arrive at")
        done, *rest = self.queue
        next_id = self.next_id
        if self.loop and rest:  # a single goal would be reached again and again without a move
            rest.append(dataclasses.replace(done, id=next_id))
            next_id += 1
        return dataclasses.replace(
            self,
            queue=tuple(rest),
            reached=(*self.reached, done)[-MAX_GOALS:],
            phase=self.phase if rest else Phase.IDLE,
            next_id=next_id,
        )


def checked(goal: Goal, spec: GridSpec) -> Goal:
    """The goal with its heading in (-π, π]; raises `BadGeometry` outside the map and for a heading
    that is none."""
    if not spec.contains(goal.x_m, goal.y_m):
        raise BadGeometry(
            f"goal ({goal.x_m:g}, {goal.y_m:g}) lies outside the map, {spec.extent()}"
        )
    if goal.yaw_rad is None:
        return goal
    if not math.isfinite(goal.yaw_rad):
        raise BadGeometry("the goal's heading is not finite; give radians")
    return dataclasses.replace(goal, yaw_rad=wrap_angle(goal.yaw_rad))
