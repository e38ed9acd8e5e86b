"""Things that move by a timetable and yield to nobody: the same again in every period."""

from __future__ import annotations

import math

import numpy as np

from navcore.geometry.transform import Pose2
from sim.models.solids import Polygon, cylinder
from sim.scenario.schema import Mover


class Moving:
    """One of them; `step` moves it."""

    def __init__(self, mover: Mover, period_s: float) -> None:
        self._times, self._x, self._y = np.array(mover.keys, dtype=np.float64).T
        self._lasts_s, self._period_s, self._steps = mover.period_s, period_s, 0
        self.diameter_m, self.height_m, self.colour = (
            2 * mover.radius_m,
            mover.height_m,
            mover.colour,
        )
        self.pose = self._at(0.0)
        """T_map_mover; it does not turn."""

    def step(self) -> None:
        """Go on by one physics step."""
        self._steps += 1
        self.pose = self._at(math.fmod(self._steps * self._period_s, self._lasts_s))

    def outline(self) -> Polygon:
        """(N, 2) around it, in its own frame."""
        return cylinder(self.diameter_m, self.height_m, (0.0, 0.0), self.colour).outline()

    def _at(self, t_s: float) -> Pose2:
        x, y = (float(np.interp(t_s, self._times, values)) for values in (self._x, self._y))
        return Pose2(x_m=x, y_m=y, yaw_rad=0.0)
