"""Cylinders that move by a timetable and never yield: the same motion in every period."""

from __future__ import annotations

import math

import numpy as np

from navcore.geometry.transform import Pose2
from sim.models.solids import Polygon, cylinder
from sim.scenario.schema import Mover


class TimedMover:
    """One mover; `step` advances it."""

    def __init__(self, mover: Mover, period_s: float) -> None:
        self._times, self._x, self._y = np.array(mover.keys, dtype=np.float64).T
        self._lasts_s, self._period_s, self._steps = mover.period_s, period_s, 0
        self.diameter_m, self.height_m, self.colour = (
            2 * mover.radius_m,
            mover.height_m,
            mover.colour,
        )
        self.pose = self._at(0.0)
        """T_map_mover; it does not rotate."""

    def step(self) -> None:
        """Advance by one physics step."""
        self._steps += 1
        self.pose = self._at(math.fmod(self._steps * self._period_s, self._lasts_s))

    def outline(self) -> Polygon:
        """Return the (N, 2) outline in the frame of the mover."""
        return cylinder(self.diameter_m, self.height_m, (0.0, 0.0), self.colour).outline()

    def _at(self, t_s: float) -> Pose2:
        x, y = (float(np.interp(t_s, self._times, values)) for values in (self._x, self._y))
        return Pose2(x_m=x, y_m=y, yaw_rad=0.0)
