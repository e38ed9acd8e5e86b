"""Motion of a differential drive along arcs of constant curvature."""

from __future__ import annotations

import math

import numpy as np

from navcore.compiled import compiled
from navcore.geometry.arrays import Floats

STRAIGHT_RADPS = 1e-6
"""Below this yaw rate an arc is integrated as a straight line."""


@compiled
def arc_position(v_mps: float, w_radps: float, time_s: float) -> tuple[float, float]:
    """Return (x, y) in metres after a constant twist, in the frame of the start; compiled."""
    turned = w_radps * time_s
    if abs(w_radps) < STRAIGHT_RADPS:
        return v_mps * time_s, 0.0
    return v_mps * math.sin(turned) / w_radps, v_mps * (1 - math.cos(turned)) / w_radps


def chord_lengths(lengths_m: Floats, turns_rad: Floats) -> Floats:
    """Return the chords in metres of arcs by their lengths and turns; a chord leaves at half the
    turn."""
    return np.asarray(lengths_m * np.sinc(turns_rad / 2 / math.pi))
