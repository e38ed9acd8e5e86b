"""Latency of ticks on the simulated clock: none, fixed, or as measured in the console."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from app.runtime.control.steering import OVERDUE
from navcore.errors import BadConfiguration
from navcore.robot.frame import Frame

CONSOLE_TICKS = Path(__file__).with_name("console_ticks.json")
"""Times of the ticks of a driving console, in their order, with machine, network and command;
`bewarenav bench latency --ticks FILE.json` records such a file."""
MAX_MS = 10_000.0
"""Longest latency that can be chosen, milliseconds."""
STREAM = 0x1A7E
"""Second word of the seed of the draws, so that they differ from all others of an episode."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """Time that ticks take on the simulated clock, from the arrival of the image to the command;
    segmentation is a part of the tick."""

    name: str
    """`none`, `live`, or the fixed time, e.g. `120 ms`."""
    ticks_ms: tuple[float, ...] = (0.0,)
    """Times of consecutive ticks in milliseconds; the last is followed by the first."""

    def delays_s(self, seed: int) -> Iterator[float]:
        """Yield the time of each tick in seconds: those of the record from a drawn one on, so that
        slow ticks follow one another as they did."""
        first = int(np.random.default_rng((seed, STREAM)).integers(len(self.ticks_ms)))
        for number in itertools.count(first):
            yield self.ticks_ms[number % len(self.ticks_ms)] / 1e3


NO_LATENCY = Latency(name="none")


@cache
def live_latency() -> Latency:
    """Return the times that ticks took in the console, with the shipped network, on two cores."""
    record = json.loads(CONSOLE_TICKS.read_text(encoding="utf-8"))
    return Latency(name="live", ticks_ms=tuple(record["ticks_ms"]))


def latency_of(text: str) -> Latency:
    """Parse `live`, `none` or a number of milliseconds; raises `BadConfiguration`."""
    if text == "live":
        return live_latency()
    if text == "none":
        return NO_LATENCY
    try:
        fixed_ms = float(text)
    except ValueError:
        fixed_ms = math.nan
    if not 0.0 <= fixed_ms <= MAX_MS:
        raise BadConfiguration(
            f"--latency {text!r}: expected live, none, or 0 to {MAX_MS:g} milliseconds"
        )
    return Latency(name=f"{fixed_ms:g} ms", ticks_ms=(fixed_ms,))


class TickSchedule:
    """One tick at a time, as in the console: of the frames that arrive during a tick only the last
    gets one."""

    def __init__(self, duration_s: Callable[[], float]) -> None:
        """`duration_s` gives the duration of a tick that begins now, seconds."""
        self._duration_s = duration_s
        self._begun: Frame | None = None
        self._pending: Frame | None = None
        self._begun_s = self._ends_s = self._last_s = 0.0

    def skip(self, frame: Frame) -> None:
        """Note that a frame needs no tick."""
        self._begun = frame

    def advance(self, newest: Frame | None, now_s: float) -> Frame | None:
        """Begin a tick of the newest frame if it is new and none is in progress; return the frame
        whose tick ends now, None when none does."""
        if self._pending is None and newest is not self._begun:
            self._begun = self._pending = newest
            self._begun_s, self._ends_s = now_s, now_s + self._duration_s()
        if self._pending is None or now_s < self._ends_s:
            return None
        ended, self._pending = self._pending, None
        self._last_s = now_s - self._begun_s
        return ended

    def is_overdue(self, now_s: float) -> bool:
        """Return whether the tick in progress takes much longer than the one before: the robot is
        no longer steered meanwhile."""
        return self._pending is not None and now_s - self._begun_s >= OVERDUE * self._last_s
