"""Points that a colour rule has found, under another rule: their colours are those of their
pixels."""

from __future__ import annotations

import numpy as np

from navcore.geometry.arrays import Bools
from navcore.mapping.points.point_links import Records
from navcore.mission.beware_list import ColourRule
from navcore.perception.colour_segmenter import matches_colour


def is_taken(points: Records, rule: ColourRule, before: ColourRule | None) -> Bools:
    """Return (N,) whether a rule takes points that the rule `before` took, None for an unknown one.

    The height above the ground that decided then is not stored: only a limit that has become lower
    is applied, to the height above the plane on which the robot stood.
    """
    if not len(points):
        return np.zeros(0, dtype=np.bool_)
    rgb = np.column_stack([points["r"], points["g"], points["b"]])
    taken = matches_colour(rgb[None], rule)[0]
    if before is not None and rule.max_height_m < before.max_height_m:
        taken &= points["z"] <= rule.max_height_m
    return np.asarray(taken)
