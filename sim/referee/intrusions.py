"""Intrusions of the footprint into forbidden areas: how often, how long and with which area."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

from sim.models.solids import Polygon
from sim.referee.clearance import Outlines, distance_m

TOUCH_M = 0.005
"""Distance at which the footprint is on an object: the engine lets nothing overlap."""
Parts = Sequence[Polygon]
"""Outlines of the parts of one object in the map frame."""


@dataclass(slots=True, kw_only=True)
class Intrusion:
    """One interval in which the footprint is over an area."""

    t_s: float
    """Time at which the intrusion began."""
    what: str
    """Name of the area."""
    duration_s: float = 0.0
    """Duration of the intrusion."""
    gap_by_odometry_m: float = math.inf
    """Least distance of the footprint by odometry from the area meanwhile; 0 when odometry had it
    over the area, too."""


class IntrusionMonitor:
    """Named areas and the intrusions into them."""

    def __init__(self, named: Sequence[tuple[str, Parts]], *, objects: int = 0) -> None:
        """`objects`: how many of the first areas are objects, which count when touched; the others
        are drawn on the floor, and count when the footprint is over them."""
        self._objects = objects
        self._outlines = Outlines.of([])
        self._names: tuple[str, ...] = ()
        self._parts: tuple[Parts, ...] = ()
        self._excused = np.zeros(0, dtype=np.bool_)
        self.intrusions: list[Intrusion] = []
        """Intrusions in order of time."""
        self._now: list[Intrusion | None] = []
        self.seconds = 0.0
        """Total time over any area."""
        self.m2s = 0.0
        """Area of the footprint over any area, integrated over time, m²·s."""
        self.replace(named, body=None)

    @property
    def polygons(self) -> list[Polygon]:
        """Polygons of all areas."""
        return [polygon for parts in self._parts for polygon in parts]

    def replace(self, named: Sequence[tuple[str, Parts]], *, body: Polygon | None) -> None:
        """Replace the areas. An area that overlaps the `body` is excused until it has been left
        once."""
        before = {
            _key(parts): (now, excused)
            for parts, now, excused in zip(
                self._parts, self._now, self._excused.tolist(), strict=True
            )
        }
        self._names = tuple(name for name, _ in named)
        self._parts = tuple(parts for _, parts in named)
        self._outlines = Outlines.of(self._parts)
        inside = np.zeros(len(named), dtype=np.bool_)
        if body is not None:
            inside = self._inside(body)
        states = [
            before.get(_key(parts), (None, bool(over)))
            for parts, over in zip(self._parts, inside, strict=True)
        ]
        self._now = [now for now, _ in states]
        self._excused = np.array([excused for _, excused in states], dtype=np.bool_)

    def excuse(self, body: Polygon) -> None:
        """Excuse the areas that overlap the `body` until they have been left once."""
        if self._names:
            self._excused |= self._inside(body)

    def judge(
        self,
        body: Polygon,
        believed: Polygon,
        *,
        t_s: float,
        period_s: float,
        displaced: Mapping[int, Parts],
        pushed: Collection[int] = (),
    ) -> None:
        """Judge one step: the true footprint, and the footprint by odometry.

        `displaced`: number of a moved object → its present parts; it is judged there and at its
        original position. `pushed`: numbers of the objects that the body pushes, whose shape in the
        engine is larger than their outlines.
        """
        if not self._names:
            return
        inside = self._inside(body)
        for number, parts in displaced.items():
            inside[number] |= any(distance_m(body, part) <= TOUCH_M for part in parts)
        inside[list(pushed)] = True
        self._excused &= inside
        on: npt.NDArray[np.bool_] = inside & ~self._excused
        self._now = [
            now if over else None for now, over in zip(self._now, on.tolist(), strict=True)
        ]
        if on.any():
            self.seconds += period_s
            self.m2s += period_s * self._covered_m2(body, np.flatnonzero(on), displaced)
            for number in map(int, np.flatnonzero(on)):
                self._note(number, believed, t_s=t_s, period_s=period_s)

    def log(self, part: slice) -> list[dict[str, Any]]:
        """Return t_s, what, duration_s and gap_by_odometry_m of each intrusion of a part of all,
        by time."""
        return [
            {
                "t_s": round(intrusion.t_s, 3),
                "what": intrusion.what,
                "duration_s": round(intrusion.duration_s, 3),
                "gap_by_odometry_m": round(intrusion.gap_by_odometry_m, 4),
            }
            for intrusion in self.intrusions[part]
        ]

    def _inside(self, body: Polygon) -> npt.NDArray[np.bool_]:
        """Return the mask of the areas that the footprint is on, at their original positions."""
        inside, _ = self._outlines.proximity(body, 0.0, 0.0)
        if self._objects:
            touched, _ = self._outlines.proximity(body, TOUCH_M, 0.0)
            inside[: self._objects] |= touched[: self._objects]
        return inside

    def _note(self, number: int, believed: Polygon, *, t_s: float, period_s: float) -> None:
        intrusion = self._now[number]
        if intrusion is None:
            intrusion = self._now[number] = Intrusion(t_s=t_s, what=self._names[number])
            self.intrusions.append(intrusion)
        intrusion.duration_s += period_s
        gap_m = min(distance_m(believed, part) for part in self._parts[number])
        intrusion.gap_by_odometry_m = min(intrusion.gap_by_odometry_m, gap_m)

    def _covered_m2(
        self, body: Polygon, numbers: npt.NDArray[np.intp], displaced: Mapping[int, Parts]
    ) -> float:
        parts = [
            part
            for number in numbers
            for part in (*self._parts[number], *displaced.get(int(number), ()))
        ]
        return float(
            shapely.area(
                shapely.intersection(shapely.Polygon(body), shapely.union_all(_polygons(parts)))
            )
        )


def _polygons(parts: Parts) -> list[shapely.Polygon]:
    return [shapely.Polygon(part) for part in parts]


def _key(parts: Parts) -> bytes:
    return b"".join(part.tobytes() for part in parts)
