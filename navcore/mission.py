"""The operator's goals, in order, and whether the robot may drive to them. A value with its transitions."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from enum import StrEnum

from navcore.errors import BadGeometry, NotKnown, Refused
from navcore.grid import GridSpec

MAX_GOALS = 1000


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

    @property
    def goal(self) -> Goal | None:
        """Where the robot may drive now; None unless it is driving."""
        return self.queue[0] if self.phase is Phase.DRIVING else None

    def add(self, x_m: float, y_m: float, spec: GridSpec) -> Mission:
        """Queue one more goal; raises `BadGeometry` outside the map."""
        if not spec.contains(x_m, y_m):
            raise BadGeometry(f"goal ({x_m:g}, {y_m:g}) lies outside the map, {spec.extent()}")
        if len(self.queue) >= MAX_GOALS:
            raise Refused(f"the queue is full, at most {MAX_GOALS} goals wait")
        goal = Goal(id=self.next_id, x_m=x_m, y_m=y_m)
        return dataclasses.replace(self, queue=(*self.queue, goal), next_id=self.next_id + 1)

    def remove(self, goal_id: int) -> Mission:
        """Take a waiting goal, or the present one, out of the queue."""
        queue = tuple(goal for goal in self.queue if goal.id != goal_id)
        if len(queue) == len(self.queue):
            raise NotKnown(f"no waiting goal has the id {goal_id}")
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
        return dataclasses.replace(
            self, queue=tuple(rest), reached=(*self.reached, done), phase=self.phase if rest else Phase.IDLE
        )
