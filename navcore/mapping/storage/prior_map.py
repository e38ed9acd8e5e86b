"""Prior map: the occupied cells of a stored map on the navigator's grid."""

from __future__ import annotations

import numpy as np

from navcore.errors import BadGeometry
from navcore.formats.nav2_map import Nav2Map, State
from navcore.geometry.arrays import Indices
from navcore.grid.grid import BoolGrid, GridSpec

SLIVER = 1e-6
"""Share of a cell below which an overlap is rounding: two equal grids that meet exactly must not
overlap."""


def prior_layer(prior: Nav2Map, spec: GridSpec) -> BoolGrid:
    """Return the read-only (rows, cols) cells of `spec` that an occupied pixel of the map touches.

    The map may have another resolution and origin. Pixels beyond the grid are left out, and cells
    beyond the map are not occupied. Raises `BadGeometry` if map and grid do not overlap.
    """
    source = prior.spec
    rows = _overlaps(
        spec.origin_y_m,
        spec.rows,
        spec.resolution_m,
        source.origin_y_m,
        source.rows,
        source.resolution_m,
    )
    cols = _overlaps(
        spec.origin_x_m,
        spec.cols,
        spec.resolution_m,
        source.origin_x_m,
        source.cols,
        source.resolution_m,
    )
    if not ((rows[0] < rows[1]).any() and (cols[0] < cols[1]).any()):
        raise BadGeometry(
            f"the prior map covers {source.extent()}, the grid {spec.extent()}: "
            "they do not overlap; check the map's origin"
        )
    layer = _any_of(_any_of(prior.cells(State.OCCUPIED), *rows).T, *cols).T
    layer = np.ascontiguousarray(layer)
    layer.flags.writeable = False
    return layer


def _overlaps(
    origin_m: float, count: int, side_m: float, source_m: float, sources: int, source_side_m: float
) -> tuple[Indices, Indices]:
    """Return for each of `count` cells along one axis the first source cell that it overlaps, and
    the one after the last."""
    edges = (origin_m - source_m + np.arange(count + 1) * side_m) / source_side_m
    sliver = SLIVER * max(1.0, side_m / source_side_m)
    first, last = np.floor(edges[:-1] + sliver), np.ceil(edges[1:] - sliver)
    return np.clip(first, 0, sources).astype(np.int64), np.clip(last, 0, sources).astype(np.int64)


def _any_of(mask: BoolGrid, first: Indices, last: Indices) -> BoolGrid:
    """Return (len(first), cols): line k is the union of lines first[k] … last[k]−1 of the mask."""
    lines = np.zeros((len(first), mask.shape[1]), dtype=np.bool_)
    some = first < last
    if some.any():
        # `reduceat` only takes ends below the number of lines, so one line is added.
        padded = np.vstack([mask, np.zeros((1, mask.shape[1]), dtype=np.bool_)])
        lines[some] = np.logical_or.reduceat(
            padded, np.column_stack([first[some], last[some]]).ravel(), axis=0
        )[::2]
    return lines
