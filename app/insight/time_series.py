"""The mission's figures over time, one row a second: what the console plots while it drives."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Mapping

COLUMNS = ("t_s", "speed_mps", "distance_m", "explored_m2", "explored_m3", "tick_ms")
PERIOD_S = 1.0
MAX_ROWS = 3600
"""The last hour is kept."""


class Series:
    """Written by one thread, read by any."""

    def __init__(self, *, most: int = MAX_ROWS) -> None:
        self._rows: deque[tuple[float, ...]] = deque(maxlen=most)
        self._lock = threading.Lock()

    def is_due(self, now_s: float) -> bool:
        """Whether the next row may be added."""
        return not self._rows or now_s - self._rows[-1][0] >= PERIOD_S

    def add(self, now_s: float, figures: Mapping[str, float]) -> None:
        """One more row; the oldest gives way when the table is full."""
        with self._lock:
            self._rows.append((now_s, *(figures[name] for name in COLUMNS[1:])))

    def after(self, since_s: float) -> dict[str, list[float | None]]:
        """The rows after a time, column by column; what is no figure is None."""
        with self._lock:
            rows = [row for row in self._rows if row[0] > since_s]
        return {
            name: [round(row[column], 3) if math.isfinite(row[column]) else None for row in rows]
            for column, name in enumerate(COLUMNS)
        }
