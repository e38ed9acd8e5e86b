"""Costmap: the occupied cells by layer and the cells that the robot's centre must avoid, as an
immutable snapshot of the map, the beware list and the zones."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping

import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import PAD, BitPlane
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, Box, GridSpec, OccupancyGrid
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.mission.zone import Zone, zone_masks

Unpack = Callable[[CellMask], BoolGrid]
"""Function that unpacks all cells of a layer, or a part of them."""


class Costmap:
    """Immutable snapshot of the occupied and the blocked cells; unpacked only as far as it is
    read."""

    def __init__(
        self,
        *,
        spec: GridSpec,
        layers: Mapping[int, CellMask],
        margins_m: Mapping[int, float],
        zones: CellMask,
        wide_zones: tuple[tuple[float, CellMask], ...],
        uncertain: tuple[tuple[float, CellMask], ...] = (),
        free: CellMask,
        version: int,
    ) -> None:
        """`layers`: class id → cells, `NOTHING` for the geometric ones; `free`: cells that the
        robot's centre may be in."""
        self.spec, self.version = spec, version
        self._layers, self._margins_m = layers, margins_m
        self._zones, self._wide_zones, self._uncertain = zones, wide_zones, uncertain
        self._free = free
        self._grid: OccupancyGrid | None = None
        self._blocked: BoolGrid | None = None

    @staticmethod
    def of(grid: OccupancyGrid, blocked: BoolGrid, *, version: int) -> Costmap:
        """Return the costmap of an occupancy grid and (rows, cols) blocked cells."""
        return Costmap(
            spec=grid.spec,
            layers={
                class_id: CellMask.of(layer)
                for class_id, layer in [(NOTHING, grid.geometric), *grid.beware.items()]
            },
            margins_m=grid.margins_m,
            zones=CellMask.of(grid.zones),
            wide_zones=tuple((margin_m, CellMask.of(mask)) for margin_m, mask in grid.wide_zones),
            uncertain=tuple((margin_m, CellMask.of(mask)) for margin_m, mask in grid.uncertain),
            free=CellMask.of(~blocked),
            version=version,
        )

    @property
    def grid(self) -> OccupancyGrid:
        """Occupied cells of the whole map by layer."""
        if self._grid is None:
            self._grid = self._unpacked(self.spec, lambda mask: mask.bools, self._layers)
        return self._grid

    @property
    def blocked(self) -> BoolGrid:
        """(rows, cols) cells that the robot's centre must avoid."""
        if self._blocked is None:
            blocked = ~self._free.bools
            blocked.flags.writeable = False
            self._blocked = blocked
        return self._blocked

    @property
    def free(self) -> CellMask:
        """Cells that the robot's centre may be in."""
        return self._free

    @property
    def masks(self) -> Mapping[Hashable, CellMask]:
        """Every layer of packed cells by class id, `"zones"`, `("wide", …)` and `"free"`, to detect
        changes."""
        found: dict[Hashable, CellMask] = {"zones": self._zones, "free": self._free}
        found.update((class_id, mask) for class_id, mask in self._layers.items())
        found.update(
            (("wide", index, margin_m), mask)
            for index, (margin_m, mask) in enumerate(self._wide_zones)
        )
        return found

    @property
    def layers(self) -> list[tuple[int | None, float, CellMask]]:
        """Class id, margin in metres and cells of every layer, `NOTHING` for the geometric one;
        zones have no class."""
        found: list[tuple[int | None, float, CellMask]] = [(None, 0.0, self._zones)]
        found += [
            (class_id, self._margins_m.get(class_id, 0.0), mask)
            for class_id, mask in self._layers.items()
        ]
        return found + [(None, margin_m, mask) for margin_m, mask in self._wide_zones]

    def part(self, top: int, left: int, bottom: int, right: int) -> OccupancyGrid:
        """Return rows top … bottom−1 and columns left … right−1, which must be within the
        grid."""
        return self._unpacked(
            self.spec.part(top, left, bottom, right),
            lambda mask: mask.window(top, left, bottom, right),
            self._layers,
        )

    def around(self, pose: Pose2, reach_m: float) -> OccupancyGrid:
        """Return the part of the grid within a square of `reach_m` around a pose, widened by the
        largest margin; it may be empty. Classes that were never seen are left out."""
        box = box_around(self.spec, pose, reach_m + self.widest_margin_m)
        seen = {class_id: mask for class_id, mask in self._layers.items() if not mask.is_empty}
        return self._unpacked(self.spec.part(*box), lambda mask: mask.window(*box), seen)

    @property
    def widest_margin_m(self) -> float:
        """Largest margin in metres of a layer, a zone or an uncertain cell."""
        own = (margin_m for margin_m, _ in (*self._wide_zones, *self._uncertain))
        return max([0.0, *self._margins_m.values(), *own])

    def _unpacked(
        self, spec: GridSpec, unpack: Unpack, layers: Mapping[int, CellMask]
    ) -> OccupancyGrid:
        return OccupancyGrid(
            spec=spec,
            geometric=unpack(self._layers[NOTHING]),
            beware={
                class_id: unpack(mask) for class_id, mask in layers.items() if class_id != NOTHING
            },
            margins_m=dict(self._margins_m),
            zones=unpack(self._zones),
            wide_zones=tuple((margin_m, unpack(mask)) for margin_m, mask in self._wide_zones),
            uncertain=tuple((margin_m, unpack(mask)) for margin_m, mask in self._uncertain),
        )


def layer_grid(point_map: PointMap, beware: BewareList, zones: Iterable[Zone]) -> OccupancyGrid:
    """Return the unpacked layers of a map for a beware list and zones; all points count, whenever
    the list was edited."""
    point_map.use(beware)
    plain, wide = zone_masks(zones, point_map.spec)
    return OccupancyGrid(
        spec=point_map.spec,
        geometric=point_map.layers.bools(NOTHING) | point_map.terrain.bools,
        beware={entry.class_id: point_map.layers.bools(entry.class_id) for entry in beware.enabled},
        margins_m={entry.class_id: entry.margin_m for entry in beware.enabled},
        zones=plain,
        wide_zones=wide,
    )


def box_around(spec: GridSpec, pose: Pose2, reach_m: float) -> Box:
    """Return the part of the grid within a square around a pose; it may be empty."""
    row, col = spec.cell(pose.x_m, pose.y_m)
    reach = math.ceil(reach_m / spec.resolution_m)
    top, left = min(max(row - reach, 0), spec.rows), min(max(col - reach, 0), spec.cols)
    return (
        top,
        left,
        max(min(row + reach + 1, spec.rows), top),
        max(min(col + reach + 1, spec.cols), left),
    )


def are_set(
    plane: BitPlane, rows: npt.NDArray[np.int64], cols: npt.NDArray[np.int64]
) -> npt.NDArray[np.bool_]:
    """Return (N,) whether cells are set in a plane."""
    words = plane[rows + PAD, (cols + PAD) >> 6]
    return np.asarray((words >> (cols & 63).astype(np.uint64)) & np.uint64(1)).astype(np.bool_)
