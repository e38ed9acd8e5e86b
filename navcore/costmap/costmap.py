"""The map as the planners see it: what is occupied, where the robot's centre therefore may not be,
and both kept up to date.

Following the map costs what has changed on it. An edit of the beware list or of the zones makes
everything anew from the layers of bits, which takes some milliseconds on the largest maps: it acts
within one tick on all that was ever seen.
"""

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
from navcore.mission.zone import Zone, cells_of

Part = Callable[[CellMask], BoolGrid]


class Costmap:
    """The occupied and the blocked cells under one order: an immutable snapshot, unpacked only as
    far as it is looked at."""

    def __init__(
        self,
        *,
        spec: GridSpec,
        layers: Mapping[int, CellMask],
        margins_m: Mapping[int, float],
        zones: CellMask,
        wide_zones: tuple[tuple[float, CellMask], ...],
        free: CellMask,
        version: int,
    ) -> None:
        """`layers`: class id → cells, `NOTHING` for the geometric ones; `free`: where the robot's
        centre may be."""
        self.spec, self.version = spec, version
        self._layers, self._margins_m, self._zones, self._wide_zones = (
            layers,
            margins_m,
            zones,
            wide_zones,
        )
        self._free = free
        self._grid: OccupancyGrid | None = None
        self._blocked: BoolGrid | None = None

    @staticmethod
    def of(grid: OccupancyGrid, blocked: BoolGrid, *, version: int) -> Costmap:
        """Of bool grids."""
        return Costmap(
            spec=grid.spec,
            layers={
                class_id: CellMask.of(layer)
                for class_id, layer in [(NOTHING, grid.geometric), *grid.beware.items()]
            },
            margins_m=grid.margins_m,
            zones=CellMask.of(grid.zones),
            wide_zones=tuple((margin_m, CellMask.of(mask)) for margin_m, mask in grid.wide_zones),
            free=CellMask.of(~blocked),
            version=version,
        )

    @property
    def grid(self) -> OccupancyGrid:
        """Occupied cells by layer, of the whole map."""
        if self._grid is None:
            self._grid = self._made(self.spec, lambda mask: mask.bools)
        return self._grid

    @property
    def blocked(self) -> BoolGrid:
        """(rows, cols) where the robot's centre may not be."""
        if self._blocked is None:
            blocked = ~self._free.bools
            blocked.flags.writeable = False
            self._blocked = blocked
        return self._blocked

    @property
    def free(self) -> CellMask:
        """Where the robot's centre may be."""
        return self._free

    @property
    def masks(self) -> Mapping[Hashable, CellMask]:
        """Every layer as it is packed, by class id, `"zones"`, `("wide", …)` and `"free"`: to see
        what has changed."""
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
        """The part of the grid in rows top … bottom−1 and columns left … right−1, which lie on it."""
        return self._made(
            self.spec.part(top, left, bottom, right),
            lambda mask: mask.window(top, left, bottom, right),
        )

    def around(self, pose: Pose2, reach_m: float) -> OccupancyGrid:
        """The part of the grid within a square of `reach_m` about a pose, widened by the largest
        margin; may be empty."""
        widest = max(
            [0.0, *self._margins_m.values(), *(margin_m for margin_m, _ in self._wide_zones)]
        )
        return self.part(*box_around(self.spec, pose, reach_m + widest))

    def _made(self, spec: GridSpec, part: Part) -> OccupancyGrid:
        return OccupancyGrid(
            spec=spec,
            geometric=part(self._layers[NOTHING]),
            beware={
                class_id: part(mask)
                for class_id, mask in self._layers.items()
                if class_id != NOTHING
            },
            margins_m=dict(self._margins_m),
            zones=part(self._zones),
            wide_zones=tuple((margin_m, part(mask)) for margin_m, mask in self._wide_zones),
        )


def layer_grid(cloud: PointMap, beware: BewareList, zones: Iterable[Zone]) -> OccupancyGrid:
    """The map's layers under a beware list and zones, unpacked; everything ever seen counts,
    whenever the list was edited."""
    cloud.use(beware)
    drawn, wide = cells_of(zones, cloud.spec)
    return OccupancyGrid(
        spec=cloud.spec,
        geometric=cloud.layers.bools(NOTHING),
        beware={entry.class_id: cloud.layers.bools(entry.class_id) for entry in beware.enabled},
        margins_m={entry.class_id: entry.margin_m for entry in beware.enabled},
        zones=drawn,
        wide_zones=wide,
    )


def box_around(spec: GridSpec, pose: Pose2, reach_m: float) -> Box:
    """(top, left, bottom, right) cells of the grid within a square about a pose; may be empty."""
    row, col = spec.cell(pose.x_m, pose.y_m)
    reach = math.ceil(reach_m / spec.resolution_m)
    top, left = min(max(row - reach, 0), spec.rows), min(max(col - reach, 0), spec.cols)
    return (
        top,
        left,
        max(min(row + reach + 1, spec.rows), top),
        max(min(col + reach + 1, spec.cols), left),
    )


def _held(
    plane: BitPlane, rows: npt.NDArray[np.int64], cols: npt.NDArray[np.int64]
) -> npt.NDArray[np.bool_]:
    """(N,) which of some cells are set."""
    words = plane[rows + PAD, (cols + PAD) >> 6]
    return np.asarray((words >> (cols & 63).astype(np.uint64)) & np.uint64(1)).astype(np.bool_)
