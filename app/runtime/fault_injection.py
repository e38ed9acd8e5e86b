"""Injection of software faults by the scenario's schedule: a hanging planner, a failing
segmentation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import numpy as np

from navcore.perception.labels import Labels
from navcore.stages import Stages
from sim.sensors.faults import Fault

POLL_S = 0.02
"""Period at which a hanging stage checks whether its fault has ended, seconds."""


class InjectedFailure(RuntimeError):  # noqa: N818 - named after what happens
    """Raised instead of the result of a stage that has to fail."""


class FaultInjector:
    """Makes stages of a tick fail, hang or return garbage while a scheduled fault is active."""

    def __init__(self, faults: Callable[[], Sequence[Fault]], now_s: Callable[[], float]) -> None:
        """`faults` and `now_s` are called in each tick: the schedule may grow."""
        self._faults, self._now_s = faults, now_s
        self._wait: Callable[[float], None] | None = None

    def wrap(self, stages: Stages) -> Stages:
        """Return the same stages, subject to the faults."""
        return dataclasses.replace(
            stages,
            plan=self._faulty(stages.plan, "planner"),
            segment=self._faulty(stages.segment, "segmentation"),
        )

    def take_time(self, wait: Callable[[float], None]) -> None:
        """Let a hanging or slow stage wait by `wait(seconds)`; without this it takes no time."""
        self._wait = wait

    def delay_s(self) -> float:
        """Duration of a tick that starts now, for simulations whose time passes in steps."""
        now_s = self._now_s()
        faults = [fault for fault in self._faults() if fault.is_active(now_s)]
        hanging = [fault.until_s - now_s for fault in faults if fault.kind == "hang"]
        slow = [
            fault.delay_s
            for fault in faults
            if fault.kind == "slow" and fault.sensor in ("planner", "segmentation")
        ]
        return max([*hanging, sum(slow)])

    def _faulty(self, stage: Callable[..., Any], sensor: str) -> Callable[..., Any]:
        @wraps(stage)
        def faulty(*arguments: Any, **named: Any) -> Any:
            fault = self._present(sensor)
            if fault is None:
                return stage(*arguments, **named)
            self._delay(fault)
            if fault.kind == "off":
                raise InjectedFailure(f"the {sensor} has failed, as the schedule of faults says")
            result = stage(*arguments, **named)
            return _garbage(result) if fault.kind == "garbage" else result

        return faulty

    def _present(self, sensor: str) -> Fault | None:
        now_s = self._now_s()
        active = (fault for fault in self._faults() if fault.is_active(now_s))
        return next((fault for fault in active if fault.sensor == sensor), None)

    def _delay(self, fault: Fault) -> None:
        if self._wait is None:
            return
        until_s = {"hang": fault.until_s, "slow": self._now_s() + fault.delay_s}.get(
            fault.kind, 0.0
        )
        while self._now_s() < until_s:
            self._wait(POLL_S)


def _garbage(labels: Labels) -> Labels:
    return dataclasses.replace(
        labels, confidence=np.full_like(labels.confidence, np.nan), hypotheses=()
    )
