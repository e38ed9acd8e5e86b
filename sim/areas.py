"""Counts when, how long and how far the footprint is over areas that it must stay off."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import shapely

from sim.clearance import Outlines, distance_m
from sim.shapes import Polygon

TOUCH_M = 0.005
"""Nearer than this to a thing that was shoved away is on it: the engine lets nothing overlap."""
Parts = Sequence[Polygon]
"""Outlines in the map frame of the parts of one thing."""


class Areas:
    """Some named areas, and what happened on them."""

    def __init__(self, named: Sequence[tuple[str, Parts]]) -> None:
        self._outlines = Outlines.of([])
        self._names: tuple[str, ...] = ()
        self._parts: tuple[Parts, ...] = ()
        self._on = self._excused = np.zeros(0, dtype=np.bool_)
        self.intrusions = 0
        """Times that the footprint came over one of them."""
        self.seconds = 0.0
        """How long it was over any."""
        self.m2s = 0.0
        """Area of the footprint that was over any, integrated over time."""
        self.by_name: Counter[str] = Counter()
        """Intrusions by the name of the area."""
        self.replace(named, body=None)

    @property
    def polygons(self) -> list[Polygon]:
        """All of them."""
        return [polygon for parts in self._parts for polygon in parts]

    def replace(self, named: Sequence[tuple[str, Parts]], *, body: Polygon | None) -> None:
        """Judge by these from now on. One that comes over the `body` is excused until it has been left once."""
        before = {
            _key(parts): state for parts, *state in zip(self._parts, self._on.tolist(), self._excused.tolist(), strict=True)
        }
        self._names = tuple(name for name, _ in named)
        self._parts = tuple(parts for _, parts in named)
        self._outlines = Outlines.of(self._parts)
        inside = np.zeros(len(named), dtype=np.bool_)
        if body is not None:
            inside, _ = self._outlines.near(body, 0.0, 0.0)
        states = [before.get(_key(parts), [False, bool(now)]) for parts, now in zip(self._parts, inside, strict=True)]
        self._on = np.array([on for on, _ in states], dtype=np.bool_)
        self._excused = np.array([excused for _, excused in states], dtype=np.bool_)

    def judge(self, body: Polygon, period_s: float, shoved: Mapping[int, Parts]) -> None:
        """Look at one step. `shoved`: number of a thing that has moved → where it is now; judged there and where it was."""
        if not self._names:
            return
        inside, _ = self._outlines.near(body, 0.0, 0.0)
        for number, parts in shoved.items():
            inside[number] |= any(distance_m(body, part) <= TOUCH_M for part in parts)
        self._excused &= inside
        on: npt.NDArray[np.bool_] = inside & ~self._excused
        for entered in np.flatnonzero(on & ~self._on):
            self.intrusions += 1
            self.by_name[self._names[entered]] += 1
        if on.any():
            self.seconds += period_s
            self.m2s += period_s * self._covered_m2(body, np.flatnonzero(on), shoved)
        self._on = on

    def _covered_m2(self, body: Polygon, numbers: npt.NDArray[np.intp], shoved: Mapping[int, Parts]) -> float:
        parts = [part for number in numbers for part in (*self._parts[number], *shoved.get(int(number), ()))]
        return float(shapely.area(shapely.intersection(shapely.Polygon(body), shapely.union_all(_polygons(parts)))))


def _polygons(parts: Parts) -> list[shapely.Polygon]:
    return [shapely.Polygon(part) for part in parts]


def _key(parts: Parts) -> bytes:
    return b"".join(part.tobytes() for part in parts)
