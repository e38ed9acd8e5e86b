"""Mission: the operator's goals in order, and the phase of driving to them, as a value with its
transitions."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from navcore.errors import BadGeometry, NotKnown, Refused
from navcore.geometry.transform import wrap_angle
from navcore.grid.bitplane import LONGEST_SIDE, MOST_CELLS
from navcore.grid.grid import GridSpec
from navcore.grid.growth import is_possible, reaching
from navcore.mission.anchor import Anchor

FARTHEST_M = 10_000.0
"""Largest coordinate of a goal in metres."""
MAX_GOALS = 1000
"""Largest number of queued goals."""
MAX_REACHED = 20
"""Number of the last reached goals that are kept."""
_FULL = f"the queue is full; at most {MAX_GOALS} goals can wait"


class Phase(StrEnum):
    """State of a mission as the operator asked for it."""

    IDLE = "idle"
    """Not started, completed or cancelled."""
    DRIVING = "driving"
    """Driving to the first goal of the queue."""
    PAUSED = "paused"
    """Standing until the operator resumes."""
    LEAVING = "leaving"
    """Driving out of the beware area that the robot is in; the goals wait."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """Goal position, with or without a heading."""

    id: int
    """Id, unique within a mission."""
    x_m: float
    """x in metres of the map frame."""
    y_m: float
    """y in metres of the map frame."""
    yaw_rad: float | None = None
    """Heading in radians of the map frame at the goal; None for any."""
    name: str = ""
    """Name that the operator gave it; empty for none."""
    anchors: tuple[Anchor, ...] = field(default=(), compare=False, repr=False)
    """Poses that the goal belongs to, in the numbering of the map and of those before, the newest
    first; none before that is looked for."""

    @property
    def title(self) -> str:
        """Name in quotation marks or, without one, the position; the id is on no map."""
        return f"“{self.name}”" if self.name else f"({self.x_m:.1f}, {self.y_m:.1f})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """Goals in order and the state of driving to them: S → G1 → G2 → …"""

    phase: Phase = Phase.IDLE
    """State of the mission."""
    queue: tuple[Goal, ...] = ()
    """Goals to reach, the present one first."""
    reached: tuple[Goal, ...] = ()
    """Last reached goals of this mission, oldest first."""
    reached_count: int = 0
    """Number of reached goals of this mission."""
    cancelled: bool = False
    """Whether the last mission was cancelled instead of completed."""
    next_id: int = 1
    """Id of the next added goal."""
    loop: bool = False
    """Whether a reached goal is queued again behind the others."""
    restored: bool = False
    """Whether the goals are those that were stored when the console ended or another site was
    chosen, and the operator has not started them since, nor added one to those that wait."""
    goes_on: bool = False
    """Whether a paused mission goes on by itself, once the robot has backed off."""
    runs: int = 0
    """Number of times that a mission was started in this session."""

    @property
    def goal(self) -> Goal | None:
        """Goal that the robot may drive to now; None unless it is driving."""
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
        """Append a goal; raises `BadGeometry` for one to which the grid `spec` cannot grow, and
        `Refused` for a full queue."""
        if len(self.queue) >= MAX_GOALS:
            raise Refused(_FULL)
        goal = Goal(id=self.next_id, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, name=name)
        goal = checked(goal, spec, beside=self.queue)
        return dataclasses.replace(
            self,
            queue=(*self.queue, goal),
            next_id=self.next_id + 1,
            # A paused mission has begun: where the robot is has to be checked before it resumes.
            restored=self.restored and self.phase is not Phase.IDLE,
        )

    def change(self, goal: Goal, spec: GridSpec) -> Mission:
        """Replace the queued goal with the same id; raises `NotKnown` without one and `BadGeometry`
        for one to which the grid `spec` cannot grow."""
        self.queued(goal.id)
        goal = checked(goal, spec, beside=self.queue)
        return dataclasses.replace(
            self, queue=tuple(goal if old.id == goal.id else old for old in self.queue)
        )

    def reorder(self, ids: Sequence[int]) -> Mission:
        """Put the queued goals in this order of ids; raises `Refused` unless each occurs once."""
        if sorted(ids) != sorted(goal.id for goal in self.queue):
            raise Refused(
                "the order must name every queued goal once; reload the queue, it has changed"
            )
        return dataclasses.replace(self, queue=tuple(self.queued(goal_id) for goal_id in ids))

    def repeat(self, loop: bool) -> Mission:
        """Set whether reached goals are queued again."""
        return dataclasses.replace(self, loop=loop)

    def refill(self, goals: Sequence[Goal], *, loop: bool) -> Mission:
        """Replace the queued goals by others of `checked_together`, with new ids; raises `Refused`
        while driving."""
        if self.phase in (Phase.DRIVING, Phase.LEAVING):
            raise Refused(
                f"the mission is {self.phase}; pause or cancel it before another is loaded"
            )
        numbered = enumerate(goals, start=self.next_id)
        return dataclasses.replace(
            self,
            queue=tuple(dataclasses.replace(goal, id=number) for number, goal in numbered),
            next_id=self.next_id + len(goals),
            phase=Phase.IDLE,
            reached=(),
            reached_count=0,
            loop=loop,
            cancelled=False,
            restored=False,
            goes_on=False,
            runs=self.runs + 1,
        )

    def queued(self, goal_id: int) -> Goal:
        """Return the queued goal with an id; raises `NotKnown`."""
        for goal in self.queue:
            if goal.id == goal_id:
                return goal
        raise NotKnown(f"no queued goal has the id {goal_id}")

    def remove(self, goal_id: int) -> Mission:
        """Remove a goal from the queue; without the last one a mission that has begun is cancelled.
        Raises `NotKnown`."""
        gone = self.queued(goal_id)
        queue = tuple(goal for goal in self.queue if goal is not gone)
        if queue:
            return dataclasses.replace(self, queue=queue)
        return dataclasses.replace(
            self,
            queue=(),
            phase=self.phase if self.phase is Phase.LEAVING else Phase.IDLE,
            cancelled=self.cancelled or self.phase is not Phase.IDLE,
            restored=False,
            goes_on=False,
        )

    def start(self) -> Mission:
        """Start driving to the first goal; raises `Refused` without a goal or while paused."""
        if not self.queue:
            raise Refused("there is no goal to drive to; add one first")
        if self.phase in (Phase.PAUSED, Phase.LEAVING):
            raise Refused(f"the mission is {self.phase}; resume or cancel it")
        begun = dataclasses.replace(
            self, phase=Phase.DRIVING, cancelled=False, restored=False, goes_on=False
        )
        if self.phase is not Phase.IDLE:
            return begun
        return dataclasses.replace(begun, reached=(), reached_count=0, runs=self.runs + 1)

    def pause(self) -> Mission:
        """Stop and keep the goals; raises `Refused` unless driving, or about to go on."""
        if self.phase is Phase.LEAVING:
            return self.left()
        if self.phase is Phase.PAUSED and self.goes_on:
            return dataclasses.replace(self, goes_on=False)
        if self.phase is not Phase.DRIVING:
            raise Refused(f"only a driving mission can be paused, this one is {self.phase}")
        return dataclasses.replace(self, phase=Phase.PAUSED)

    def halt(self) -> Mission:
        """Pause if the robot drives, or is about to go on; refuses nothing."""
        stands = self.pause() if self.phase in (Phase.DRIVING, Phase.LEAVING) else self
        return dataclasses.replace(stands, goes_on=False)

    def interrupt(self) -> Mission:
        """Pause for a manoeuvre of the operator, after which the mission goes on by itself; raises
        `Refused` unless driving."""
        return dataclasses.replace(self.pause(), goes_on=True)

    def resume(self) -> Mission:
        """Continue after a pause; raises `Refused` unless paused."""
        if self.phase is not Phase.PAUSED:
            raise Refused(f"only a paused mission can be resumed, this one is {self.phase}")
        return dataclasses.replace(self, phase=Phase.DRIVING, restored=False, goes_on=False)

    def leave(self) -> Mission:
        """Start driving out of the beware area that the robot is in."""
        return dataclasses.replace(self, phase=Phase.LEAVING, goes_on=False)

    def stored(self) -> Mission:
        """Return the mission as it begins when it is loaded: it stands, and what was driving is
        paused."""
        has_begun = self.phase is not Phase.IDLE and bool(self.queue)
        return dataclasses.replace(
            self,
            phase=Phase.PAUSED if has_begun else Phase.IDLE,
            restored=bool(self.queue),
            goes_on=False,
        )

    def left(self) -> Mission:
        """Stop after leaving the area; the goals wait for the operator to resume."""
        return dataclasses.replace(self, phase=Phase.PAUSED if self.queue else Phase.IDLE)

    def cancel(self) -> Mission:
        """Stop and remove all queued goals."""
        return dataclasses.replace(
            self, phase=Phase.IDLE, queue=(), cancelled=True, restored=False, goes_on=False
        )

    def arrive(self) -> Mission:
        """Mark the present goal as reached and continue with the next, if there is one."""
        if not self.queue:
            raise Refused("there is no goal to arrive at")
        done, *rest = self.queue
        next_id = self.next_id
        if self.loop and rest:  # a single goal would be reached over and over without motion
            rest.append(dataclasses.replace(done, id=next_id))
            next_id += 1
        return dataclasses.replace(
            self,
            queue=tuple(rest),
            reached=(*self.reached, done)[-MAX_REACHED:],
            reached_count=self.reached_count + 1,
            phase=self.phase if rest else Phase.IDLE,
            next_id=next_id,
        )


def checked(goal: Goal, spec: GridSpec, *, beside: Sequence[Goal] = ()) -> Goal:
    """Return the goal with its heading in (−π, π].

    Raises `BadGeometry` for values that are not finite, and where a grid that contains `spec`, the
    goal and the goals `beside` it would be larger than the memory allows.
    """
    if not (math.isfinite(goal.x_m) and math.isfinite(goal.y_m)):
        raise BadGeometry("the goal is not finite; give metres of the map frame")
    if max(abs(goal.x_m), abs(goal.y_m)) > FARTHEST_M:
        raise BadGeometry(
            f"goal ({goal.x_m:g}, {goal.y_m:g}) is out of range, allowed {-FARTHEST_M:g} to "
            f"{FARTHEST_M:g} m"
        )
    others = [(other.x_m, other.y_m) for other in beside if other.id != goal.id]
    grown = reaching(spec, [(goal.x_m, goal.y_m), *others])
    if not is_possible(grown):
        raise BadGeometry(
            f"goal ({goal.x_m:g}, {goal.y_m:g}) is too far away: the map would grow to "
            f"{grown.rows} × {grown.cols} cells, possible are {MOST_CELLS} in all and "
            f"{LONGEST_SIDE} a side; the map is {spec.extent()}"
        )
    if goal.yaw_rad is None:
        return goal
    if not math.isfinite(goal.yaw_rad):
        raise BadGeometry("the goal's heading is not finite; give radians")
    return dataclasses.replace(goal, yaw_rad=wrap_angle(goal.yaw_rad))


def checked_together(goals: Sequence[Goal], spec: GridSpec) -> tuple[Goal, ...]:
    """Return the goals of a whole mission as `checked`, numbered from 1; raises `BadGeometry` for
    the first that is none, or too far from those before it, and `Refused` for too many."""
    if len(goals) > MAX_GOALS:
        raise Refused(_FULL)
    numbered = (dataclasses.replace(goal, id=id_) for id_, goal in enumerate(goals, start=1))
    alone = tuple(checked(goal, spec) for goal in numbered)
    if not is_possible(reaching(spec, [(goal.x_m, goal.y_m) for goal in alone])):
        for count, goal in enumerate(alone):
            checked(goal, spec, beside=alone[:count])
    return alone
