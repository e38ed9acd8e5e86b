"""Dates on which zones expire that hold though the calendar clock of the robot is set."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

MAX_DATES = 5000
"""Largest number of dates that are known by the steady clock; those that are due first go."""
SET_S = 10.0
"""Difference from which a date is that of another calendar, seconds."""


def steady_s() -> float:
    """Return the time of a clock that is never set and goes on while the computer sleeps, seconds;
    where the system has none, of one that stops then."""
    if sys.platform == "linux":
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()


class ExpiryDates:
    """The calendar clock, and the dates that were counted from some moment of this session: these
    are kept by a clock that is never set. One for all sites of a console."""

    def __init__(
        self,
        calendar_s: Callable[[], float] = time.time,
        steady_s: Callable[[], float] = steady_s,
    ) -> None:
        """`calendar_s`: calendar clock, seconds since 1970. `steady_s`: clock that is never set."""
        self.calendar_s, self._steady_s = calendar_s, steady_s
        self._due_s = dict[float, float]()  # date → its time by the steady clock

    def after(self, left_s: float) -> float:
        """Return the date of an expiry after some time, which is known by the steady clock."""
        return self._known(self.calendar_s() + left_s, left_s)

    def left_s(self, at_s: float) -> float:
        """Return the time until a date, seconds."""
        due_s = self._due_s.get(at_s)
        return at_s - self.calendar_s() if due_s is None else due_s - self._steady_s()

    def by_calendar(self, at_s: float) -> float:
        """Return a date as the calendar clock, which was perhaps set, has it now; only that holds
        over a restart."""
        left_s = self.left_s(at_s)
        now_at_s = self.calendar_s() + left_s
        if abs(now_at_s - at_s) <= SET_S:
            return at_s
        return self._known(float(round(now_at_s)), left_s)  # the same if it is asked for again

    def _known(self, at_s: float, left_s: float) -> float:
        self._due_s[at_s] = self._steady_s() + left_s
        if len(self._due_s) > MAX_DATES:
            del self._due_s[min(self._due_s, key=self._due_s.__getitem__)]
        return at_s
