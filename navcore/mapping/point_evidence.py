"""The evidence of an image for and against the points that it shows.

The confidence of uncertain points follows every image (`confidence.py`), flat points of colour
rules fade (`fading.py`), and a point through which the camera sees is outdated (`clearing.py`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from navcore.config.mapping import MappingConfig
from navcore.geometry.arrays import Bools, Indices, sorted_distinct
from navcore.geometry.transform import invert
from navcore.grid.grid import Box
from navcore.mapping.placed_points import PlacedPoints
from navcore.mapping.points.clearing import find_outdated
from navcore.mapping.points.confidence import update_confidence
from navcore.mapping.points.fading import faded, left_alone, line_limits
from navcore.mapping.views.observation import Observation
from navcore.mission.beware_list import BewareList, ColourRule
from navcore.perception.labels import Labels
from navcore.robot.frame import Frame


class PointEvidence:
    """Counts what images show of the points, and removes those that they disprove."""

    def __init__(self, placed: PlacedPoints, rules: MappingConfig) -> None:
        self._placed, self._rules = placed, rules
        self._patterns: Mapping[int, ColourRule] = {}  # rules with a pattern, by class id
        self._lines = line_limits(BewareList(classes=()))

    def use(self, beware: BewareList) -> None:
        """Let the patterns of a list fade as wholes and its lines by their brightness."""
        self._lines = line_limits(beware)
        self._patterns = {
            entry.class_id: entry.colour
            for entry in beware.classes
            if entry.colour is not None and entry.colour.pattern is not None
        }

    def count(
        self, frame: Frame, labels: Labels, recognised: Bools, held: Indices, box: Box
    ) -> Indices:
        """Count the look of a frame at the (N,) points in a box of cells, and return the indices of
        those that are left.

        `recognised`: (256,) whether a network or an example can show a class, by its id.
        """
        if self._update_confidence(frame, labels, recognised, held):
            held = self._placed.indices_in(box)  # others have their indices now
        if self._fade(frame, labels, held):
            held = self._placed.indices_in(box)
        return held

    def outdated(self, frame: Frame, seen: Observation, pose_id: int, held: Indices) -> Indices:
        """Return the indices of those of (N,) points that the frame sees through, measures again
        from its pose ID, or shows to be ground."""
        return find_outdated(
            self._placed.table.records,
            held,
            frame.depth_m,
            seen.ground_m,
            invert(frame.T_map_camera),
            frame.intrinsics.pinhole,
            self._rules.clearing,
            seen.max_range_m,
            pose_id,
        )

    def _update_confidence(
        self, frame: Frame, labels: Labels, recognised: Bools, held: Indices
    ) -> bool:
        """Update the confidence of the uncertain ones of (N,) points, and forget the disproved
        ones; return whether there were any of these."""
        if not self._placed.has_uncertain:
            return False
        table = self._placed.table
        forgotten, cells = update_confidence(
            table,
            held,
            frame,
            labels,
            recognised,
            self._rules.confidence,
            self._rules.clearing,
        )
        table.remove(forgotten)
        if len(cells):
            self._placed.refresh(sorted_distinct(cells))
            self._placed.version += 1
        return len(forgotten) > 0

    def _fade(self, frame: Frame, labels: Labels, held: Indices) -> bool:
        """Count the look at the certain flat ones of (N,) points, and forget those that have faded;
        return whether there were any of these."""
        if not self._placed.has_beware:
            return False
        table = self._placed.table
        gone = faded(
            table,
            held,
            frame,
            labels,
            self._lines,
            self._rules.fading,
            self._rules.clearing,
        )
        if len(gone):
            alone = left_alone(table, gone, self._patterns, self._rules.clearing.flat_m)
            gone = np.concatenate([gone, alone])
            cells = sorted_distinct(table.live["cell"][gone]).astype(np.int64)
            table.remove(gone)
            self._placed.refresh(cells[cells >= 0])
            self._placed.version += 1
        return len(gone) > 0
