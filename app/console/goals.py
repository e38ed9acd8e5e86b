"""The operator's goals: queued, changed, ordered, repeated; and kept under a name as missions."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

from app.console.saved_missions import SavedMissions
from navcore.errors import BadGeometry
from navcore.grid.grid import GridSpec
from navcore.mission.mission import Goal, Mission
from web.drafts import SavedMission


class Goals:
    """Satisfies `web.port.GoalList`. Safe from any thread: `change` makes each edit one step."""

    def __init__(
        self,
        *,
        spec: GridSpec,
        shelf: SavedMissions,
        present: Callable[[], Mission],
        change: Callable[[Callable[[Mission], Mission]], Mission],
        check: Callable[[float, float], None],
    ) -> None:
        """`present` is the mission now, `change` replaces it, `check` refuses a place where the
        robot could not stand."""
        self._spec, self._shelf, self._present, self._change, self._check = (
            spec,
            shelf,
            present,
            change,
            check,
        )

    def add(self, x_m: float, y_m: float, *, yaw_rad: float | None = None, name: str = "") -> Goal:
        """Queue a goal; refused where the robot could not stand as far as the map is known."""
        self._standable(x_m, y_m)
        return self._change(
            lambda mission: mission.add(x_m, y_m, self._spec, yaw_rad=yaw_rad, name=name)
        ).queue[-1]

    def change(self, goal_id: int, changes: Mapping[str, object]) -> Goal:
        """Move, turn or rename a waiting goal."""

        def changed(mission: Mission) -> Goal:
            return dataclasses.replace(mission.waiting(goal_id), **changes)  # type: ignore[arg-type]

        if "x_m" in changes or "y_m" in changes:
            # Looked at before the mission is locked: the command thread must not wait for it.
            goal = changed(self._present())
            self._standable(goal.x_m, goal.y_m)
        return self._change(lambda mission: mission.change(changed(mission), self._spec)).waiting(
            goal_id
        )

    def order(self, ids: Sequence[int]) -> None:
        """Drive to the waiting goals in this order."""
        self._change(lambda mission: mission.reorder(ids))

    def loop(self, loop: bool) -> None:
        """Whether goals that are reached wait again."""
        self._change(lambda mission: mission.repeat(loop))

    def remove(self, goal_id: int) -> None:
        """Take a goal out of the queue."""
        self._change(lambda mission: mission.remove(goal_id))

    def missions(self) -> Mapping[str, SavedMission]:
        """Goals kept under a name."""
        return self._shelf.all()

    def save(self, name: str) -> None:
        """Keep the waiting goals."""
        self._shelf.save(name, self._present())

    def load(self, name: str) -> None:
        """Put kept goals in the place of those that wait."""
        saved = self._shelf.named(name)
        self._change(lambda mission: mission.refill(saved.goals, self._spec, loop=saved.loop))

    def forget(self, name: str) -> None:
        """Forget kept goals."""
        self._shelf.delete(name)

    def _standable(self, x_m: float, y_m: float) -> None:
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            raise BadGeometry("the goal is not finite; give metres of the map frame")
        self._check(x_m, y_m)
