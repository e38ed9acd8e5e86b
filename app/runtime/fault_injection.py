"""Faults of the software above the robot, by the same schedule as the sensors': a hung planner, a
segmentation that fails."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import numpy as np

from navcore.navigator import Navigator
from navcore.perception.labels import Labels
from sim.sensors.faults import Fault

POLL_S = 0.02


class InjectedFailure(RuntimeError):  # noqa: N818 - named after what happens
    """Raised in the place of a stage that is to fail."""


class FaultInjector:
    """Spoils the stages of one navigator while a fault of the schedule holds."""

    def __init__(
        self,
        navigator: Navigator,
        faults: Callable[[], Sequence[Fault]],
        now_s: Callable[[], float],
    ) -> None:
        """`faults` and `now_s` are asked in each tick: the schedule may grow, and times are of its
        clock."""
        self._faults, self._now_s = faults, now_s
        self._wait: Callable[[float], None] | None = None
        self._wrap(navigator, "route", "planner")
        self._wrap(navigator, "label", "segmentation")

    def take_time(self, wait: Callable[[float], None]) -> None:
        """Let what hangs or is slow take its time within the tick, by `wait(seconds)`; else it
        takes none there."""
        self._wait = wait

    def delay_s(self) -> float:
        """How long a tick that begins now would take, for those whose time passes in steps."""
        now_s = self._now_s()
        faults = [fault for fault in self._faults() if fault.holds(now_s)]
        hanging = [fault.until_s - now_s for fault in faults if fault.kind == "hang"]
        slow = [
            fault.delay_s
            for fault in faults
            if fault.kind == "slow" and fault.sensor in ("planner", "segmentation")
        ]
        return max([*hanging, sum(slow)])

    def _wrap(self, navigator: Navigator, stage: str, sensor: str) -> None:
        whole: Callable[..., Any] = getattr(navigator, stage)

        @wraps(whole)
        def faulty(*arguments: Any, **named: Any) -> Any:
            fault = self._present(sensor)
            if fault is None:
                return whole(*arguments, **named)
            self._delay(fault)
            if fault.kind == "off":
                raise InjectedFailure(
                    f"the {sensor} has failed, as the schedule of faults wants it"
                )
            made = whole(*arguments, **named)
            return _garbage(made) if fault.kind == "garbage" else made

        setattr(navigator, stage, faulty)

    def _present(self, sensor: str) -> Fault | None:
        now_s = self._now_s()
        return next(
            (fault for fault in self._faults() if fault.sensor == sensor and fault.holds(now_s)),
            None,
        )

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
