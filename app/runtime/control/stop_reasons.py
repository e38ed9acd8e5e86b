"""Why the planners, rather than the safety gate, hold the robot, in the operator's words."""

from __future__ import annotations

from app.runtime.control.operator_state import MOVING, OperatorState, PlaceSearch
from app.runtime.control.tick_state import TickState
from navcore.behaviours.assisted_teleop import stays_out
from navcore.control.motion import ControllerState
from navcore.costmap.cell_description import describe_cell
from navcore.geometry.transform import STANDSTILL, Pose2, Twist
from navcore.grid.bitplane import LONGEST_SIDE, MOST_CELLS
from navcore.grid.grid import GridSpec
from navcore.localisation.estimate import LocalisationState
from navcore.mission.mission import Phase
from navcore.mission.zone import Zone
from navcore.navigator import TickResult
from navcore.planning.path import NoPath, Reason
from navcore.robot.profile import RobotProfile
from navcore.safety.gate import Cause, StopReason

CONTROLLER_STOPS = {
    ControllerState.IN_ZONE: StopReason(
        cause=Cause.IN_ZONE,
        text="The robot stands in a beware area: have it leave, or change the area.",
    ),
    ControllerState.BLOCKED: StopReason(
        cause=Cause.BOXED_IN, text="Every motion would come too close to an obstacle."
    ),
    ControllerState.GIVEN_UP: StopReason(
        cause=Cause.BOXED_IN,
        text="The robot gives up: waiting, backing off and turning round opened no path. "
        "Clear its path, or choose another goal.",
    ),
    ControllerState.WAIT_FOR_PEOPLE: StopReason(
        cause=Cause.YIELDING,
        text="A person is in the robot's path; it waits until they have passed.",
    ),
}
"""Reasons for which the local planner holds the robot."""
BEWARE_BY_HAND = StopReason(
    cause=Cause.BEWARE_AHEAD,
    text="There is a beware area in this direction; drive in another one.",
)
"""The reason of a robot that is driven by hand towards a zone or an object of the beware list."""
UNSEEN_FLOOR = StopReason(
    cause=Cause.BOXED_IN,
    text="The camera has not seen the floor by which the robot could get on, and it drives over no "
    "floor unseen. Drive it a little by hand, so that the camera sees it.",
)
"""The reason of a robot that is blocked by nothing else."""
POSE_STOPS = {
    LocalisationState.LOST: StopReason(
        cause=Cause.POSE_UNKNOWN,
        text="The robot does not know where it is: what the camera sees does not fit the map. Have "
        "it look round, drive it by hand, or show its place on the map.",
    ),
    LocalisationState.CHECKING: StopReason(
        cause=Cause.POSE_UNKNOWN,
        text="The robot is comparing what it sees with the map to tell whether its place is right.",
    ),
    LocalisationState.AMBIGUOUS: StopReason(
        cause=Cause.POSE_UNKNOWN,
        text="The robot is unsure of its place. Drive it some metres by hand, or show its place on "
        "the map.",
    ),
}
"""Reasons for which a robot that does not know its pose stands."""
SEARCH_FAILED = StopReason(
    cause=Cause.POSE_UNKNOWN,
    text="The robot could not turn round to look for its place. Free it, or drive it by hand to "
    "where it can turn, then have it look round again.",
)
"""The reason of a robot whose search for its place has failed."""


def hand_stops(
    twist: Twist,
    pose: Pose2,
    zones: tuple[Zone, ...],
    tick_state: TickState,
    profile: RobotProfile,
    spec: GridSpec,
) -> list[StopReason]:
    """Return why a robot at a pose, T_map_base, may not be driven by hand with a twist: it would
    enter a zone, or a mapped object of the beware list. `spec`: grid of the map.

    The present zones hold before the first tick, too, and when ticks fail.
    """
    decision = tick_state.decision
    seen = None if decision is None else decision.occupancy
    is_clear = stays_out(twist, pose, profile, zones=zones, spec=spec, seen=seen)
    return [] if is_clear else [BEWARE_BY_HAND]


def planner_stops(
    intent: OperatorState, tick_state: TickState, *, malformed: bool
) -> list[StopReason]:
    """Return why the planners, rather than the gate, hold the robot; `malformed`: whether the gate
    refuses the newest frame already."""
    mission, decision = intent.mission, tick_state.decision
    found = []
    if tick_state.bad_frame is not None and not malformed:
        text = f"The camera image is refused: {tick_state.bad_frame}."
        found.append(StopReason(cause=Cause.BAD_FRAME, text=text))
    if tick_state.failure is not None:
        text = f"The navigation failed: {tick_state.failure}."
        found.append(StopReason(cause=Cause.PLANNER_FAILED, text=text))
    # A robot that looks for its place turns, whatever its mission does.
    if mission.phase is Phase.PAUSED and not intent.searching:
        text = "The mission is paused; resume it to drive on."
        if mission.restored:
            text = (
                "The mission from before is back, paused; check that the robot is where the map "
                "shows it, then resume."
            )
        found.append(StopReason(cause=Cause.PAUSED, text=text))
    is_known = decision is not None and decision.place.is_known
    if intent.search is PlaceSearch.FAILED and not is_known:
        found.append(SEARCH_FAILED)
    if mission.phase is Phase.IDLE or intent.searching or decision is None:
        return found
    if decision.place.state in POSE_STOPS:  # its mission is paused, and cannot be resumed
        found.append(POSE_STOPS[decision.place.state])
    if mission.phase not in MOVING:
        return found
    if tick_state.waits_for_correction:
        text = "The robot stands for a moment so that its place on the map can be corrected."
        found.append(StopReason(cause=Cause.POSE_UNKNOWN, text=text))
    outcome = None if decision.route is None else decision.route.outcome
    if isinstance(outcome, NoPath) and decision.motion.twist == STANDSTILL:
        why = _why_no_path(intent, decision, outcome)
        text = (
            f"There is no path out of the area: {why}."
            if mission.goal is None
            else f"There is no path to the goal {mission.goal.title}: {why}."
        )
        found.append(StopReason(cause=Cause.NO_PATH, text=text))
    outcome_now = decision.motion.outcome
    if decision.in_margin and outcome_now is ControllerState.GIVEN_UP:
        outcome_now = ControllerState.IN_ZONE  # to leave the margin is what is left to try
    if outcome_now in CONTROLLER_STOPS:
        unseen = decision.motion.unseen and outcome_now is not ControllerState.IN_ZONE
        found.append(UNSEEN_FLOOR if unseen else CONTROLLER_STOPS[outcome_now])
    return found


def _why_no_path(intent: OperatorState, decision: TickResult, outcome: NoPath) -> str:
    """Return why there is no path, with what blocks the goal."""
    goal, grid = intent.mission.goal, decision.occupancy.grid
    if outcome.reason is Reason.OUTSIDE:
        return (
            f"robot or goal is outside the map, {grid.spec.extent()}, which may have at most "
            f"{MOST_CELLS} cells and {LONGEST_SIDE} a side"
        )
    if outcome.reason is not Reason.GOAL_BLOCKED or goal is None:
        return str(outcome.reason)
    return (
        f"{outcome.reason}, the goal is {describe_cell(grid, grid.spec.cell(goal.x_m, goal.y_m))}"
    )
