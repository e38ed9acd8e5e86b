"""Measurements of a drive over time, one row per second."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Mapping

COLUMNS = ("t_s", "speed_mps", "distance_m", "explored_m2", "explored_m3", "tick_ms")
"""Names of the columns; the first is the time in seconds."""
PERIOD_S = 1.0
"""Time between two rows, seconds."""
MAX_ROWS = 3600


class TimeSeries:
    """A bounded table of measurements, written by one thread and read by any.

    A full table drops its oldest row or, with `thinning`, every second row, and then takes half as
    many rows per time as before.
    """

    def __init__(self, *, max_rows: int = MAX_ROWS, thinning: bool = False) -> None:
        self._rows: deque[tuple[float, ...]] = deque(maxlen=max_rows)
        self._max_rows, self._thinning, self._period_s = max_rows, thinning, PERIOD_S
        self._lock = threading.Lock()

    def is_due(self, t_s: float) -> bool:
        """Return whether the next row may be added."""
        return not self._rows or not 0 <= t_s - self._rows[-1][0] < self._period_s

    def add(self, t_s: float, measurements: Mapping[str, float]) -> None:
        """Add a row with a value for each column but the time."""
        with self._lock:
            self._rows.append((t_s, *(measurements[name] for name in COLUMNS[1:])))
            if self._thinning and len(self._rows) >= self._max_rows:
                self._rows = deque(list(self._rows)[::2], maxlen=self._max_rows)
                self._period_s *= 2

    def after(self, since_s: float = -math.inf) -> dict[str, list[float | None]]:
        """Return the rows after a time, column by column; None for a value that is not finite."""
        with self._lock:
            rows = [row for row in self._rows if row[0] > since_s]
        return {
            name: [round(row[column], 3) if math.isfinite(row[column]) else None for row in rows]
            for column, name in enumerate(COLUMNS)
        }
