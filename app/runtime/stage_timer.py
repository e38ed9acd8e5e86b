"""How long the stages of a tick take, measured from outside the navigator."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from navcore.navigator import Navigator

STAGES = ("tick", "label", "remember", "occupancy", "route", "plan", "move", "track")


class Stopwatch:
    """Wraps the stages of one navigator and keeps their durations in milliseconds."""

    def __init__(self, navigator: Navigator) -> None:
        self.ms: dict[str, deque[float]] = {stage: deque(maxlen=20_000) for stage in STAGES}
        for stage in STAGES:
            setattr(navigator, stage, self._timed(stage, getattr(navigator, stage)))

    def summary(self, stage: str) -> dict[str, float]:
        """p50, p99 and max of a stage, ms; zeros when it never ran."""
        durations = np.array(list(self.ms[stage]) or [0.0])
        p50, p99 = np.percentile(durations, [50, 99])
        return {"p50": float(p50), "p99": float(p99), "max": float(durations.max())}

    def _timed(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def timed(*arguments: Any, **named: Any) -> Any:
            start = time.perf_counter()
            try:
                return function(*arguments, **named)
            finally:
                self.ms[stage].append((time.perf_counter() - start) * 1e3)

        return timed
