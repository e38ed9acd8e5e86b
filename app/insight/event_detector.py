"""The events of a drive, detected by comparing each state of the operator, and the newest tick,
with the one before, and their texts in the log."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from app.insight.event_log import EventLog
from app.runtime.control.operator_state import MOVING, OperatorState
from navcore.geometry.transform import Pose2
from navcore.grid.grid import BoolGrid, Cell, OccupancyGrid
from navcore.grid.growth import growth_into
from navcore.mission.beware_changes import changes_between
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Goal, Mission, Phase
from navcore.mission.zone import Zone
from navcore.navigator import TickResult
from navcore.planning.path import NoPath, Path
from navcore.planning.route import Route
from navcore.safety.gate import Cause, StopReason, emergency_stop
from web.interface.wire import Position

MIN_DEVIATION_M = 0.3
"""Largest distance between two paths, or two goals, from which they are different ones, metres: a
correction of the map moves goals by less, as a rule."""
DRIVEN_TO_LOOK_M = 2.0
"""Length by which the way round may become shorter while the robot drives to a gap, metres."""
REPLAN_PERIOD_S = 1.0
"""Shortest time between two comparisons of paths, seconds: in unknown terrain they change with
every frame."""
QUIET_S = 1.0
"""Time after which a stop reason that has gone is over, seconds."""
REACH_CELLS = 60
"""Largest distance, in cells, at which the cause of a blocked cell is searched."""

_PHASES = {
    Phase.DRIVING: "The mission drives.",
    Phase.PAUSED: "The mission is paused.",
    Phase.LEAVING: "The robot is told to leave the beware area.",
    Phase.IDLE: "The mission has ended.",
}
"""Text of each phase of the mission."""


class EventDetector:
    """Compares each state with the one before and logs the differences. One thread calls it."""

    def __init__(self, journal: EventLog, intent: OperatorState) -> None:
        self._event_log = journal
        self._intent = intent
        self._decision: TickResult | None = None
        self._compared_s = -np.inf
        self._goal: Goal | None = None
        self._reasons: tuple[StopReason, ...] = ()
        self._held: tuple[str, float, float | None] | None = None  # cause, since, clear since

    def on_change(self, now_s: float, intent: OperatorState, pose: Position) -> None:
        """Log what a change of the operator's state has changed; called for each of them, so that
        what is taken back at once is told, too."""
        before, self._intent = self._intent, intent
        if before.stopped_by != intent.stopped_by:
            # The gate may have seen nothing of a stop that is reset at once.
            stops = [emergency_stop(by) for by in (intent.stopped_by,) if by is not None]
            others = [reason for reason in self._reasons if reason.cause != Cause.EMERGENCY_STOP]
            self._hold(now_s, (*stops, *others), pose)
        if before.site_id != intent.site_id:  # a name may be given again
            # Nothing of the other site was edited.
            self._event_log.note(now_s, "map", f"The robot is at the site “{intent.site}”.", pose)
            return
        self._mission(now_s, before.mission, intent.mission, pose)
        self._zones(now_s, before.zones, intent.zones)
        if before.beware is not intent.beware:
            self._beware(now_s, before.beware, intent.beware)
        if before.unknown_price != intent.unknown_price:
            self._event_log.note(now_s, "replanned", _price_text(intent.unknown_price))

    def on_tick(self, now_s: float, decision: TickResult | None, pose: Position) -> None:
        """Log the changes of the newest tick."""
        intent = self._intent
        # What changes while the mission is paused is told when it goes on.
        paused = intent.mission.phase is Phase.PAUSED
        if decision is not None and decision is not self._decision and not paused:
            self._path(now_s, decision, intent)
        self._settle(now_s, pose)

    def on_gate(self, now_s: float, reasons: tuple[StopReason, ...], pose: Position) -> None:
        """Log the reason for which the gate holds the robot; called whenever it changes."""
        self._reasons = reasons
        self._hold(now_s, reasons, pose)

    def _hold(self, now_s: float, reasons: tuple[StopReason, ...], pose: Position) -> None:
        self._settle(now_s, pose)
        if not reasons:
            if self._held is not None and self._held[2] is None:
                self._held = (self._held[0], self._held[1], now_s)
            return
        cause = str(reasons[0].cause)
        if self._held is not None and self._held[0] == cause:
            self._held = (cause, self._held[1], None)
            return
        self._held = (cause, now_s, None)
        self._event_log.note(now_s, "stopped", reasons[0].text, pose)

    def _settle(self, now_s: float, pose: Position) -> None:
        if self._held is None:
            return
        cause, since_s, clear_s = self._held
        if clear_s is None or now_s - clear_s < QUIET_S:
            return
        self._held = None
        lasted = f"{cause.replace('_', ' ')} lasted {clear_s - since_s:.1f} s"
        text = f"Nothing holds the robot any more; {lasted}."
        self._event_log.note(now_s, "released", text, pose)

    def _mission(self, now_s: float, before: Mission, after: Mission, pose: Position) -> None:
        known = {goal.id for goal in before.reached}
        for goal in after.reached:
            if goal.id not in known:
                text = f"The goal {goal.title} is reached."
                self._event_log.note(now_s, "goal", text, (goal.x_m, goal.y_m))
        if after.phase is not before.phase:
            cancelled = after.cancelled and not before.cancelled
            self._event_log.note(
                now_s,
                "mission",
                "The mission is cancelled." if cancelled else _PHASES[after.phase],
                pose,
            )

    def _zones(self, now_s: float, before: tuple[Zone, ...], after: tuple[Zone, ...]) -> None:
        if before is after:
            return
        old, new = {zone.id: zone for zone in before}, {zone.id: zone for zone in after}
        for zone in (*after, *(zone for zone in before if zone.id not in new)):
            text = _what_happened(zone.name, old.get(zone.id), new.get(zone.id))
            if text:
                x_m, y_m = np.mean(zone.polygon, axis=0)
                self._event_log.note(now_s, "zone", text, (float(x_m), float(y_m)))

    def _beware(self, now_s: float, before: BewareList, after: BewareList) -> None:
        for change in changes_between(before, after):
            self._event_log.note(now_s, "beware", f"Beware list: {change}.")

    def _path(self, now_s: float, decision: TickResult, intent: OperatorState) -> None:
        before, goal = self._decision, intent.mission.goal
        # The way out of a beware area may end anywhere.
        leaves = goal is self._goal is None
        changed_goal = before is None or not (leaves or _end_alike(before.route, decision.route))
        found = (
            None
            if before is None or before.route is None
            else isinstance(before.route.outcome, Path)
        )
        opened = decision.route is not None and isinstance(decision.route.outcome, Path) != found
        if not changed_goal and not opened and now_s - self._compared_s < REPLAN_PERIOD_S:
            return
        self._compared_s, self._decision = now_s, decision
        same_goal, self._goal = _is_same(goal, self._goal), goal
        if decision.route is None or intent.mission.phase not in MOVING:
            return
        was_m = before.route.round_m if same_goal and before and before.route else None
        if was_m is not None or decision.route.is_look:
            said = _about_a_look(was_m, decision.route, decision.frame.pose)
        else:
            said = _why_replanned(before, decision, intent, changed_goal=changed_goal)
        if said is not None:
            self._event_log.note(now_s, "replanned", *said)


# Whole sentences: a reader's language matches them with their templates, the longest one first.
def _what_happened(name: str, before: Zone | None, after: Zone | None) -> str | None:
    """Return how a zone has changed, in words; None when it has not."""
    if before is None:
        is_on = after is not None and after.enabled
        return f"Zone “{name}” was drawn." if is_on else f"Zone “{name}” was drawn, switched off."
    if after is None:
        return f"Zone “{name}” was deleted."
    if before.enabled != after.enabled:
        is_on = after.enabled
        return f"Zone “{name}” was switched on." if is_on else f"Zone “{name}” was switched off."
    return f"Zone “{name}” was changed." if before != after else None


def _price_text(price: float | None) -> str:
    if price is None:
        return "Unseen floor costs again what the configuration says."
    return f"A metre of unseen floor now costs as much as {price:g} m of seen floor."


def _end(route: Route | None) -> Position | None:
    """Return the end point of a path; None without one."""
    return (
        (float(route.points[-1, 0]), float(route.points[-1, 1]))
        if route is not None and len(route.points)
        else None
    )


def _end_alike(route: Route | None, other: Route | None) -> bool:
    """Return whether two paths end at the same place, or neither is there."""
    end, its_end = _end(route), _end(other)
    if end is None or its_end is None:
        return end is its_end
    return math.dist(end, its_end) < MIN_DEVIATION_M


def _is_same(goal: Goal | None, other: Goal | None) -> bool:
    """Return whether two goals are the same one, though a correction of the map may have moved
    it."""
    if goal is None or other is None:
        return goal is other
    apart_m = math.dist((goal.x_m, goal.y_m), (other.x_m, other.y_m))
    return goal.id == other.id and apart_m < MIN_DEVIATION_M


def _why_replanned(
    before: TickResult | None, after: TickResult, intent: OperatorState, *, changed_goal: bool
) -> tuple[str, Position | None] | None:
    """Return the text and the position for the newest path; None when it is the same path as
    before."""
    route, here = after.route, (after.frame.pose.x_m, after.frame.pose.y_m)
    assert route is not None
    old = before.route if before is not None else None
    if isinstance(route.outcome, NoPath):
        known = (
            old is not None
            and isinstance(old.outcome, NoPath)
            and old.outcome.reason == route.outcome.reason
        )
        return None if known else (f"There is no path: {route.outcome.reason}.", here)
    length_m = route.outcome.length * after.occupancy.spec.resolution_m
    if old is None or (changed_goal and isinstance(old.outcome, Path)):
        return (
            f"Planned a path of {length_m:.1f} m to {_title_of(route, intent.mission)}.",
            here,
        )
    if isinstance(old.outcome, NoPath):
        return f"A path has opened, {length_m:.1f} m long.", here
    deviation_m, at = _largest_deviation(route.points, old.points)
    if deviation_m < MIN_DEVIATION_M:
        return None
    assert before is not None
    blocked = _first_blocked(_cells_now(old.outcome.cells, before, after), after)
    if blocked is None:
        return f"A shorter path has opened: {length_m:.1f} m from here.", at
    what, title = _closed_by(after.occupancy.grid, blocked, intent)
    text = (
        f"{what} closes the path at this position; the new one is {length_m:.1f} m long."
        if title is None
        else f"“{title}” closes the path at this position; the new one is {length_m:.1f} m long."
    )
    return text, after.occupancy.spec.centre(*blocked)


def _about_a_look(
    was_m: float | None, route: Route, pose: Pose2
) -> tuple[str, Position | None] | None:
    """Return the text and the position when the robot begins to look at a gap before it takes the
    way round, or ends that; None while it does. `was_m` is the length of the way round in metres if
    it has looked for the same goal before, None otherwise."""
    here = pose.x_m, pose.y_m
    if was_m is None:
        text = (
            "A much shorter way leads through a gap that looks too narrow for the safety margin. "
            "The robot looks at it from near before it takes the way round, "
            f"which is {route.round_m:.1f} m long."
        )
        return text, here
    length_m = route.length_m
    if route.is_look or length_m is None:
        return None
    if length_m > was_m - DRIVEN_TO_LOOK_M:
        return f"The gap is too narrow; the way round is {length_m:.1f} m long.", here
    return f"A shorter path has opened: {length_m:.1f} m from here.", here


def _title_of(route: Route, mission: Mission) -> str:
    """Return the title of the goal that a path ends at, else the position of its end."""
    x_m, y_m = (float(value) for value in route.points[-1])
    goal = mission.goal
    if goal is not None and math.dist((goal.x_m, goal.y_m), (x_m, y_m)) < MIN_DEVIATION_M:
        return goal.title
    return f"({x_m:.1f}, {y_m:.1f})"


def _largest_deviation(
    path: npt.NDArray[np.float64], old: npt.NDArray[np.float64]
) -> tuple[float, Position]:
    """Return the largest distance in metres of a path from another, and its position."""
    deviations_m, _ = cKDTree(old).query(path)
    at = int(np.argmax(deviations_m))
    return float(deviations_m[at]), (float(path[at, 0]), float(path[at, 1]))


def _cells_now(
    cells: npt.NDArray[np.int64], before: TickResult, after: TickResult
) -> npt.NDArray[np.int64]:
    """Return (N, 2) cells of an earlier tick on the grid of a later one, which may have grown; none
    where it was replaced by another."""
    growth = growth_into(before.occupancy.spec, after.occupancy.spec)
    return cells[:0] if growth is None else cells + growth.shift


def _first_blocked(cells: npt.NDArray[np.int64], decision: TickResult) -> Cell | None:
    """Return the first blocked cell of a path ahead of the robot; None when all are free."""
    if len(cells) == 0:
        return None
    here = decision.occupancy.spec.cell(decision.frame.pose.x_m, decision.frame.pose.y_m)
    ahead = cells[int(np.argmin(((cells - here) ** 2).sum(axis=1))) :]
    closed = np.flatnonzero(decision.occupancy.blocked[ahead[:, 0], ahead[:, 1]])
    return None if not len(closed) else (int(ahead[closed[0], 0]), int(ahead[closed[0], 1]))


def _closed_by(grid: OccupancyGrid, cell: Cell, intent: OperatorState) -> tuple[str, str | None]:
    """Return in words what is nearest to a blocked cell, and its title if it is of a class of the
    beware list."""
    titles = {entry.class_id: entry.title for entry in intent.beware.classes}
    layers: list[tuple[str, str | None, BoolGrid]] = [
        ("An obstacle", None, grid.geometric),
        ("A zone", None, grid.zones),
        *(("A zone", None, mask) for _, mask in grid.wide_zones),
    ]
    layers += [
        ("Something to beware of", titles.get(class_id), layer)
        for class_id, layer in grid.beware.items()
    ]
    best: tuple[str, str | None] = ("Something", None)
    least = np.inf
    top, left = max(cell[0] - REACH_CELLS, 0), max(cell[1] - REACH_CELLS, 0)
    around = np.s_[top : cell[0] + REACH_CELLS + 1, left : cell[1] + REACH_CELLS + 1]
    for what, title, layer in layers:
        near = np.argwhere(layer[around]) + np.array([top, left])
        squared = float(((near - cell) ** 2).sum(axis=1).min()) if len(near) else np.inf
        if squared < least:
            best, least = (what, title), squared
    return best
