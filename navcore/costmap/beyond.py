"""Zones beyond the border of the grid: the cells of the grid that they close all the same."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from navcore.grid.bitplane import BitPlane, empty_plane, pack, unpack
from navcore.grid.grid import BoolGrid, Box, GridSpec
from navcore.grid.inflation import inflated
from navcore.mission.zone import Zone, zone_masks


def closed_from_beyond(
    zones: Iterable[Zone], spec: GridSpec, radius_of: Callable[[float], int]
) -> BitPlane | None:
    """Return the plane of the cells to which a cell of a zone outside of the grid is as near as the
    radius of its margin; None for no cell.

    `radius_of` gives the radius of inflation in cells for a margin in metres.
    """
    zones = tuple(zone for zone in zones if zone.closed and not _is_within(zone, spec))
    # The cells on both sides of the border, as far as the largest radius, in four strips.
    reach = max((radius_of(zone.margin_m) for zone in zones), default=0)
    if reach == 0:
        return None
    found: BoolGrid | None = None
    for strip in _strips(spec, reach):
        closed = _closed_in(strip, zones, spec, radius_of)
        if closed is None:
            continue
        if found is None:
            found = np.zeros((spec.rows, spec.cols), dtype=np.bool_)
        top, left, bottom, right = strip
        inner = max(top, 0), max(left, 0), min(bottom, spec.rows), min(right, spec.cols)
        found[inner[0] : inner[2], inner[1] : inner[3]] |= closed[
            inner[0] - top : inner[2] - top, inner[1] - left : inner[3] - left
        ]
    if found is None or not found.any():
        return None
    plane = empty_plane(spec.rows, spec.cols)
    pack(found, plane)
    return plane


def _is_within(zone: Zone, spec: GridSpec) -> bool:
    left, bottom, right, top = zone.bounds
    return not zone.forbids_outside and all(
        0 < row < spec.rows - 1 and 0 < col < spec.cols - 1
        for row, col in (spec.cell(left, bottom), spec.cell(right, top))
    )


def _strips(spec: GridSpec, reach: int) -> tuple[Box, ...]:
    top, left, bottom, right = -reach, -reach, spec.rows + reach, spec.cols + reach
    return (
        (top, left, min(reach, bottom), right),
        (max(spec.rows - reach, top), left, bottom, right),
        (top, left, bottom, min(reach, right)),
        (top, max(spec.cols - reach, left), bottom, right),
    )


def _closed_in(
    strip: Box, zones: tuple[Zone, ...], spec: GridSpec, radius_of: Callable[[float], int]
) -> BoolGrid | None:
    """The (rows, cols) cells of a strip that zones outside of the grid close; None for none."""
    top, left, bottom, right = strip
    plain, wide = zone_masks(zones, spec.part(*strip))
    by_radius: dict[int, BitPlane] = {}
    for margin_m, mask in ((0.0, plain), *wide):
        outside = mask.copy()
        outside[max(-top, 0) : spec.rows - top, max(-left, 0) : spec.cols - left] = False
        if outside.any():
            plane = empty_plane(bottom - top, right - left)
            pack(outside, plane)
            radius = radius_of(margin_m)
            by_radius[radius] = by_radius[radius] | plane if radius in by_radius else plane
    if not by_radius:
        return None
    return unpack(inflated(by_radius, bottom - top, right - left), bottom - top, right - left)
