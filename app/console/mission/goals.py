"""The operator's goals: queued, changed, ordered and repeated; saved under a name as missions."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import shapely

from app.console.mission.saved_missions import SavedMissions
from app.runtime.control.operator_state import OperatorState, StateHolder
from navcore.costmap.cell_description import IN_ZONE, blocked_goal, check_goal_free
from navcore.costmap.costmap import Costmap
from navcore.errors import BadGeometry
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.mission.mission import Goal, Mission, checked_together
from navcore.mission.zone import Zone, zone_masks
from navcore.mission.zone_growth import distance_m
from web.interface.drafts import GoalChanges, SavedMission
from web.interface.meant_site import require_meant_site
from web.interface.sites import at_another_site
from web.interface.snapshots import TickSnapshot


class MapView(Protocol):
    """A source of the newest map; `app.runtime.record.recorder.Recorder` is one."""

    @property
    def picture(self) -> TickSnapshot | None:
        """Values of the newest tick; None before the first."""


class Goals:
    """Satisfies the console's port `GoalList`. Safe from any thread: each edit is one step."""

    def __init__(
        self,
        holder: StateHolder,
        *,
        view: MapView,
        spec: Callable[[], GridSpec],
        inflate: Callable[[OccupancyGrid], Costmap],
        saved: SavedMissions,
        site_id: str = "",
    ) -> None:
        """`spec` returns the present grid of the map, which grows to the goals; `inflate` makes a
        costmap of a grid; `site_id` is that of the site of the goals."""
        self._site_id = site_id
        self._holder, self._view, self._spec, self._saved = holder, view, spec, saved
        self._inflate = inflate

    def add(self, x_m: float, y_m: float, *, yaw_rad: float | None = None, name: str = "") -> Goal:
        """Queue a goal; refused where the known map or a zone does not let the robot stand."""
        self._check_free(x_m, y_m)
        return self._change(
            lambda mission: mission.add(x_m, y_m, self._spec(), yaw_rad=yaw_rad, name=name)
        ).queue[-1]

    def change(self, goal_id: int, changes: GoalChanges) -> Goal:
        """Move, turn or rename a waiting goal."""

        def changed(mission: Mission) -> Goal:
            return dataclasses.replace(mission.queued(goal_id), **changes)

        if "x_m" in changes or "y_m" in changes:
            # Checked before the mission is locked: the command thread must not wait for it.
            goal = changed(self._holder.intent.mission)
            self._check_free(goal.x_m, goal.y_m)
        return self._change(lambda mission: mission.change(changed(mission), self._spec())).queued(
            goal_id
        )

    def order(self, ids: Sequence[int]) -> None:
        """Set the order of the waiting goals."""
        self._change(lambda mission: mission.reorder(ids))

    def loop(self, loop: bool) -> None:
        """Set whether reached goals are queued again."""
        self._change(lambda mission: mission.repeat(loop))

    def remove(self, goal_id: int) -> None:
        """Remove a goal from the queue."""
        self._change(lambda mission: mission.remove(goal_id))

    def missions(self) -> Mapping[str, SavedMission]:
        """Return the saved missions by name."""
        return self._saved.all()

    def save(self, name: str, *, replace: bool = True) -> None:
        """Save the waiting goals under a name."""
        state = self._holder.intent
        self._require_site(state)
        self._saved.save(name, state.mission, replace=replace)

    def load(self, name: str) -> None:
        """Replace the waiting goals by those of a saved mission."""
        saved = self._saved.named(name)
        # Checked before the mission is locked: the command thread must not wait for it.
        goals = checked_together(saved.goals, self._spec())
        self._change(lambda mission: mission.refill(goals, loop=saved.loop))

    def forget(self, name: str) -> None:
        """Delete a saved mission."""
        require_meant_site()
        self._saved.delete(name)

    def _change(self, edit: Callable[[Mission], Mission]) -> Mission:
        def changed(state: OperatorState) -> OperatorState:
            self._require_site(state)
            return dataclasses.replace(state, mission=edit(state.mission))

        return self._holder.change(changed).mission

    def _require_site(self, state: OperatorState) -> None:
        """Raise `OtherSite` unless a state is that of the site of the goals, for which the present
        request is meant."""
        if state.site_id != self._site_id:
            raise at_another_site()
        require_meant_site()

    def _check_free(self, x_m: float, y_m: float) -> None:
        goal = (x_m, y_m)
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            raise BadGeometry("the goal is not finite; give metres of the map frame")
        picture = self._view.picture
        if picture is not None:
            check_goal_free(
                picture.grid, picture.blocked, goal, robot=picture.pose, seen=picture.seen
            )
        # A zone that was drawn since that tick holds already.
        zones = self._holder.intent.zones
        if any(_is_inside(zone, goal) for zone in zones):
            if picture is not None:
                plain, wide = zone_masks(zones, picture.grid_spec)
                drawn = dataclasses.replace(picture.grid, zones=plain, wide_zones=wide)
                blocked = self._inflate(drawn).blocked
                check_goal_free(drawn, blocked, goal, robot=picture.pose, seen=picture.seen)
            raise blocked_goal(goal, IN_ZONE, nearest=None)


def _is_inside(zone: Zone, point: tuple[float, float]) -> bool:
    """Return whether a zone forbids to stand at a point of the map frame, its margin included."""
    return zone.closed and bool(distance_m(zone, shapely.points([point]))[0] <= zone.margin_m)
