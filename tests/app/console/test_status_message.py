"""The sentence about what the robot does."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import pytest

from app.console.status_message import status_message
from app.runtime.control.operator_state import OperatorState, PlaceSearch
from navcore.control.motion import ControllerState
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Goal, Mission, Phase
from navcore.safety.gate import StopReason

FOLLOWING = cast(
    Any,
    SimpleNamespace(
        motion=SimpleNamespace(outcome=ControllerState.FOLLOW), in_growth=False, in_margin=False
    ),
)


def operator(*goals: Goal, phase: Phase = Phase.DRIVING) -> OperatorState:
    mission = Mission(phase=phase, queue=goals)
    return OperatorState(mission=mission, beware=BewareList(classes=()))


@pytest.mark.parametrize(("name", "shown"), [("Nurse station", "Nurse station"), ("", "")])
def test_the_goal_is_named_as_on_the_map(name: str, shown: str) -> None:
    goal = Goal(id=8, x_m=3.0, y_m=0.0, name=name)
    text = status_message(operator(goal), FOLLOWING, (), moving=True)
    assert text.startswith(f"Driving to {goal.title}: ")
    assert shown in text and "goal 8" not in text


def test_what_holds_the_robot_comes_first() -> None:
    held = cast(StopReason, SimpleNamespace(text="A person is in the way."))
    goal = Goal(id=1, x_m=3.0, y_m=0.0)
    assert status_message(operator(goal), FOLLOWING, (held,), moving=False) == held.text


def test_a_robot_that_drives_out_of_the_growth_of_a_zone_says_so() -> None:
    growing = cast(Any, SimpleNamespace(motion=FOLLOWING.motion, in_growth=True, in_margin=False))
    goal = Goal(id=1, x_m=3.0, y_m=0.0)
    text = status_message(operator(goal), growing, (), moving=True)
    assert text.startswith("The position has become uncertain beside a zone")


def test_only_a_robot_that_a_hand_drives_is_driven_by_hand() -> None:
    reached = operator(phase=Phase.IDLE)
    driven = status_message(reached, FOLLOWING, (), moving=True, by_hand=True)
    assert driven == "Driven by hand."
    # It rolls out at its goal, or turns to look for its place.
    assert "hand" not in status_message(reached, FOLLOWING, (), moving=True)
    searching = dataclasses.replace(reached, search=PlaceSearch.TURNING)
    assert status_message(searching, FOLLOWING, (), moving=True).startswith("Turning round")


def test_goals_that_were_stored_are_said_to_be_of_no_session() -> None:
    # They are also those of a site that the robot comes back to, or of its copy.
    intent = operator(Goal(id=1, x_m=3.0, y_m=0.0), phase=Phase.IDLE)
    intent = dataclasses.replace(intent, mission=intent.mission.stored())
    text = status_message(intent, FOLLOWING, (), moving=False)
    assert text == "Standing; 1 goal waits for start, kept from before."
