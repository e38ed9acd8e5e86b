"""Points that a colour rule has found, under another rule: the colours are those of their pixels,
and what a pattern or a line is, the frames of the last minutes show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navcore.config.mapping import ClearingRules, FadingRules
from navcore.geometry.arrays import Bools
from navcore.mapping.points.erasing import voxels
from navcore.mapping.points.near_look import has_near_look
from navcore.mapping.points.point_links import Records
from navcore.mission.beware_list import ColourRule
from navcore.perception.colour_segmenter import matches_colour
from navcore.robot.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PastView:
    """What frames of the last minutes show under new rules."""

    frames: Sequence[Frame]
    """The frames, placed in the map."""
    points: Records
    """(N,) points that they show."""


def is_taken(
    points: Records,
    rule: ColourRule,
    before: ColourRule | None,
    past: PastView,
    clearing: ClearingRules,
    fading: FadingRules,
) -> Bools:
    """Return (N,) whether a rule takes points of its class that the rule `before` took, None for an
    unknown one.

    The height above the ground that decided then is not stored: only a limit that has become lower
    is applied, to the height above the plane on which the robot stood. Nor is it stored what lay
    around a point: of a pattern or a line, a point goes that some past frame has a near look at and
    none shows.
    """
    if not len(points):
        return np.zeros(0, dtype=np.bool_)
    rgb = np.column_stack([points["r"], points["g"], points["b"]])
    taken = matches_colour(rgb[None], rule)[0]
    if before is not None and rule.max_height_m < before.max_height_m:
        taken &= points["z"] <= rule.max_height_m
    if rule.pattern is not None or rule.line is not None:
        unsure = np.flatnonzero(taken & ~np.isin(voxels(points), voxels(past.points)))
        for frame in past.frames:
            seen = has_near_look(points[unsure], frame, clearing, fading)
            taken[unsure[seen]] = False
            unsure = unsure[~seen]
    return np.asarray(taken)
