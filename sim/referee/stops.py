"""Log of the stops of the robot: when, how long and why. Stops that recur are one entry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

SAME_STOP_S = 10.0
"""Time without a stop of a reason after which its next stop is another entry, seconds."""
EVERYTHING = slice(None)
"""Part of a log that is all of it."""


@dataclass(slots=True, kw_only=True)
class _Stop:
    """Stops for one reason, each soon after the last."""

    reason: str
    since_s: float
    until_s: float
    held_s: float
    count: int = 1


class StopLog:
    """Stops with a reason; the last may still be going on."""

    def __init__(self) -> None:
        self._ended: list[_Stop] = []
        self._reason: str | None = None
        self._since_s = 0.0

    def note(self, reason: str | None, t_s: float) -> None:
        """Record that the robot is held for this reason at `t_s`; None when it is free to move."""
        if reason == self._reason:
            return
        self._ended = self._until(t_s)
        self._reason, self._since_s = reason, t_s

    def intervals(self, t_s: float, part: slice = EVERYTHING) -> list[dict[str, Any]]:
        """Return a part of the stops as of `t_s` in the order of their beginnings.

        Each has its beginning `t_s`, its `reason`, the `count` of stops that it stands for, the
        time `duration_s` that the robot was held in them, all together, and the end `until_s` of
        the last.
        """
        return [
            {
                "t_s": round(stop.since_s, 3),
                "duration_s": round(stop.held_s, 3),
                "reason": stop.reason,
                "count": stop.count,
                "until_s": round(stop.until_s, 3),
            }
            for stop in self._until(t_s)[part]
        ]

    def _until(self, t_s: float) -> list[_Stop]:
        """Return the ended stops and the present one, which ends at `t_s` for now."""
        if self._reason is None:
            return list(self._ended)
        held_s = t_s - self._since_s
        same = next((one for one in reversed(self._ended) if one.reason == self._reason), None)
        if same is None or self._since_s - same.until_s > SAME_STOP_S:
            new = _Stop(reason=self._reason, since_s=self._since_s, until_s=t_s, held_s=held_s)
            return [*self._ended, new]
        longer = _Stop(
            reason=same.reason,
            since_s=same.since_s,
            until_s=t_s,
            held_s=same.held_s + held_s,
            count=same.count + 1,
        )
        return [longer if one is same else one for one in self._ended]
