"""Log of the stops of the robot: when, how long and why."""

from __future__ import annotations

from typing import Any


class StopLog:
    """Intervals with a reason; the last may still be going on."""

    def __init__(self) -> None:
        self._ended: list[dict[str, Any]] = []
        self._reason: str | None = None
        self._since_s = 0.0

    def note(self, reason: str | None, t_s: float) -> None:
        """Record that the robot is held for this reason at `t_s`; None when it is free to move."""
        if reason == self._reason:
            return
        self._ended = self.intervals(t_s)
        self._reason, self._since_s = reason, t_s

    def intervals(self, t_s: float) -> list[dict[str, Any]]:
        """Return t_s, duration_s and reason of each stop, in order, as of `t_s`."""
        if self._reason is None:
            return list(self._ended)
        present = {
            "t_s": round(self._since_s, 3),
            "duration_s": round(t_s - self._since_s, 3),
            "reason": str(self._reason),
        }
        return [*self._ended, present]
