"""A holder of the operator's state without a robot."""

from __future__ import annotations

from collections.abc import Callable

from app.runtime.operator_state import OperatorState
from navcore.mission.beware_list import default_beware_list
from navcore.mission.mission import Mission


class PlainHolder:
    """Satisfies `app.runtime.operator_state.StateHolder`."""

    def __init__(self, intent: OperatorState | None = None) -> None:
        self.intent = intent or OperatorState(mission=Mission(), beware=default_beware_list())

    def change(self, edit: Callable[[OperatorState], OperatorState]) -> OperatorState:
        """Replace the state."""
        self.intent = edit(self.intent)
        return self.intent
