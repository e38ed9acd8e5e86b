"""Durations of a tick and its stages."""

from __future__ import annotations

import dataclasses
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import numpy as np

from navcore.stages import Stages

STAGES = tuple(field.name for field in dataclasses.fields(Stages))
"""The stages of a tick, in the order of the data flow."""
TICK = "tick"
"""Key of the whole tick."""
_KEPT = 20_000


class StageTimer:
    """Keeps the newest durations of the tick and of each stage."""

    def __init__(self, clock_s: Callable[[], float] = time.perf_counter) -> None:
        """`clock_s` gives seconds; that of the thread leaves out the other work of the machine."""
        self._clock_s = clock_s
        self.ms: dict[str, deque[float]] = {stage: deque(maxlen=_KEPT) for stage in (TICK, *STAGES)}
        """Durations in milliseconds, oldest first, by stage."""

    @property
    def tick_ms(self) -> float:
        """Duration of the newest tick in milliseconds; 0 before the first."""
        ticks = self.ms[TICK]
        return ticks[-1] if ticks else 0.0

    def wrap(self, stages: Stages) -> Stages:
        """Return the same stages, timed."""
        timed = {stage: self.timed(stage, getattr(stages, stage)) for stage in STAGES}
        return dataclasses.replace(stages, **timed)

    def timed(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the same function, its duration noted under a stage even when it raises."""

        @wraps(function)
        def timed(*arguments: Any, **named: Any) -> Any:
            with self.measure(stage):
                return function(*arguments, **named)

        return timed

    @contextmanager
    def measure(self, stage: str, *, before_ms: float = 0.0) -> Iterator[None]:
        """Note the duration of a block under a stage, even when it raises, and `before_ms` with it
        for what was done elsewhere."""
        start_s = self._clock_s()
        try:
            yield
        finally:
            self.ms[stage].append(before_ms + (self._clock_s() - start_s) * 1e3)

    def summary(self, stage: str) -> dict[str, float]:
        """p50, p99 and max of a stage in milliseconds; zeros when it never ran."""
        durations = np.array(list(self.ms[stage]) or [0.0])
        p50, p99 = np.percentile(durations, [50, 99])
        return {"p50": float(p50), "p99": float(p99), "max": float(durations.max())}
