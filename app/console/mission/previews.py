"""What a draft of an operator would do to the path, on the newest map; nothing is applied."""

from __future__ import annotations

from collections.abc import Callable

from app.console.beware.beware_map import BewareMap
from app.console.mission.path_preview import (
    Planner,
    compare,
    compare_lists,
    grid_with,
    kept_zones,
    measured,
    pose_at,
)
from app.console.mission.path_settings import PathSettings
from app.console.mission.zone_editor import ZoneEditor
from app.runtime.control.robot_controller import RobotController
from app.runtime.record.recorder import Recorder
from navcore.costmap.costmap import Costmap
from navcore.errors import Refused
from navcore.grid.grid import OccupancyGrid
from navcore.mission.beware_list import BewareList
from navcore.mission.zone import Zone
from web.interface.beware import ListPreview
from web.interface.drafts import PathPreview, Preview, PreviewDraft
from web.interface.wire import Position


class Previews:
    """Plans beside the running robot, with its map, its zones and its costs."""

    def __init__(
        self, controller: RobotController, *, view: Recorder, beware_map: BewareMap
    ) -> None:
        """Plan on the map of `controller`; `view` knows which floor was seen."""
        self._controller, self._view, self._beware_map = controller, view, beware_map

    def draft(self, draft: PreviewDraft, zones: ZoneEditor, settings: PathSettings) -> Preview:
        """Plan with a draft of a zone or of a price, and without it. Raises `Refused` where there
        is no goal or no map."""
        queue = self._controller.intent.mission.queue
        target = draft.goal or ((queue[0].x_m, queue[0].y_m) if queue else None)
        if target is None:
            raise Refused("there is no goal to preview a path to; give one")
        decision = self._controller.tick_state.decision
        plan, ends = self._planner(draft.start, settings.unknown_price), [target]
        if decision is None:
            raise Refused("there is no map yet; the camera has not delivered an image")
        if draft.start is not None:
            ends = [draft.start, target]
        grid = grid_with(decision.occupancy.grid, ends)
        zone = None if draft.zone is None else zones.checked(draft.zone, zone_id="draft", version=1)
        in_force = None
        if draft.unknown_price is not None:
            in_force = plan(target)
            plan = self._planner(draft.start, draft.unknown_price)
        return compare(
            grid,
            kept_zones(zones.stored, decision.request.zones),
            plan(target),
            draft=zone,
            replaces=draft.replaces,
            in_force=in_force,
        )

    def beware_list(
        self,
        drafted: BewareList,
        in_force: BewareList,
        zones: tuple[Zone, ...],
        settings: PathSettings,
    ) -> ListPreview:
        """Compare another beware list with the one in force. Raises `Refused` where there is no
        map."""

        def occupancy() -> Costmap | None:
            decision = self._controller.tick_state.decision
            return None if decision is None else decision.occupancy

        present, other = self._beware_map.grids(occupancy, in_force, drafted)
        plan = self._planner(None, settings.unknown_price)
        decision = self._controller.tick_state.decision
        if decision is not None:
            zones = kept_zones(zones, decision.request.zones)
        return compare_lists(present, other, zones, plan, self._controller.intent.mission.queue)

    def _planner(
        self, start: Position | None, unknown_price: float
    ) -> Callable[[Position], Planner]:
        """Return what plans from a position, or from the robot's, to a goal on any grid, at a price
        of unseen floor."""
        decision, navigator = self._controller.tick_state.decision, self._controller.navigator
        tick = self._view.picture
        if decision is None or tick is None:
            raise Refused("there is no map yet; the camera has not delivered an image")
        pose = decision.frame.pose if start is None else pose_at(start)

        def to(goal: Position) -> Planner:
            def plan(grid: OccupancyGrid, zones: tuple[Zone, ...]) -> PathPreview:
                costmap = navigator.inflate_draft(grid)
                route = navigator.preview(costmap, pose, goal, unknown_price=unknown_price)
                return measured(
                    route, zones, navigator.travel_time_s, tick.seen_mask, tick.grid_spec
                )

            return plan

        return to
