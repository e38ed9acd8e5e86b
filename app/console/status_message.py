"""The sentence that says what the robot does, or why it stands."""

from __future__ import annotations

from app.runtime.control.operator_state import OperatorState
from navcore.control.motion import ControllerState
from navcore.mission.mission import Phase
from navcore.navigator import TickResult
from navcore.safety.gate import StopReason


def stands_in_zone(decision: TickResult | None) -> bool:
    """Return whether the robot stands in a closed area, or has found no way out of a margin."""
    if decision is None:
        return False
    outcome = decision.motion.outcome
    return outcome is ControllerState.IN_ZONE or (
        decision.in_margin and outcome is ControllerState.GIVEN_UP
    )


def status_message(
    intent: OperatorState,
    decision: TickResult | None,
    reasons: tuple[StopReason, ...],
    *,
    moving: bool,
    by_hand: bool = False,
) -> str:
    """Return what holds the robot, else what it does, in one sentence. `by_hand`: whether an
    operator drives it now."""
    mission = intent.mission
    if reasons:
        return reasons[0].text
    if moving and by_hand:
        return "Driven by hand."
    if intent.searching:
        return "Turning round to look for its place in the map."
    if mission.phase is Phase.LEAVING:
        return "Leaving the beware area by the shortest path."
    if stands_in_zone(decision):
        return "Standing in a beware area; have it leave, or change the area."
    if mission.phase is Phase.DRIVING and decision is not None and decision.in_growth:
        return (
            "The position has become uncertain beside a zone: driving away from the zone before "
            "going on to the goal."
        )
    if mission.phase is Phase.DRIVING and decision is not None:
        goal = mission.queue[0]
        what = decision.motion.outcome if moving else "about to move"
        return f"Driving to {goal.title}: {what}."
    if mission.queue:
        goals = "goals wait" if len(mission.queue) > 1 else "goal waits"
        before = ", kept from before" if mission.restored else ""
        return f"Standing; {len(mission.queue)} {goals} for start{before}."
    if mission.cancelled:
        return "Standing; the mission was cancelled."
    return "Standing; all goals reached." if mission.reached else "Standing; pick a goal to begin."


def storage_warning(
    map_error: str | None, zones_error: str | None, session_error: str | None
) -> str | None:
    """Return what cannot be stored of that which is not stored at an operator's request; None where
    all is."""
    if map_error is not None:
        return f"the map cannot be stored, it would be lost with the console: {map_error}"
    if zones_error is not None:
        return f"zones that have changed by themselves cannot be stored: {zones_error}"
    if session_error is not None:
        return f"goals and place of the robot cannot be stored: {session_error}"
    return None
