"""The map as the planners see it: what is occupied, where the robot's centre therefore may not be, and both kept up to date.

Following the map costs what has changed on it. An edit of the beware list or of the zones makes everything anew from the layers
of bits, which takes some milliseconds on the largest maps: it acts within one tick on all that was ever seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping

import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Pose2
from navcore.grid.bitplane import PAD, Plane
from navcore.grid.cell_mask import Mask
from navcore.grid.free_space import FREE, FreeSpace
from navcore.grid.grid import BoolGrid, Cell, GridSpec, OccupancyGrid, inflation_radius
from navcore.grid.inflation import InflatedGrid
from navcore.mapping.layers import Changes
from navcore.mapping.point_map import CloudMap
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.mission.zone import Zone

Part = Callable[[Mask], BoolGrid]


class Occupancy:
    """The occupied and the blocked cells under one order: an immutable snapshot, unpacked only as far as it is looked at."""

    def __init__(
        self,
        *,
        spec: GridSpec,
        layers: Mapping[int, Mask],
        margins_m: Mapping[int, float],
        zones: Mask,
        wide_zones: tuple[tuple[float, Mask], ...],
        free: Mask,
        version: int,
    ) -> None:
        """`layers`: class id → cells, `NOTHING` for the geometric ones; `free`: where the robot's centre may be."""
        self.spec, self.version = spec, version
        self._layers, self._margins_m, self._zones, self._wide_zones = layers, margins_m, zones, wide_zones
        self._free = free
        self._grid: OccupancyGrid | None = None
        self._blocked: BoolGrid | None = None

    @staticmethod
    def of(grid: OccupancyGrid, blocked: BoolGrid, *, version: int) -> Occupancy:
        """Of bool grids."""
        return Occupancy(
            spec=grid.spec,
            layers={class_id: Mask.of(layer) for class_id, layer in [(NOTHING, grid.geometric), *grid.beware.items()]},
            margins_m=grid.margins_m,
            zones=Mask.of(grid.zones),
            wide_zones=tuple((margin_m, Mask.of(mask)) for margin_m, mask in grid.wide_zones),
            free=Mask.of(~blocked),
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
    def free(self) -> Mask:
        """Where the robot's centre may be."""
        return self._free

    @property
    def masks(self) -> Mapping[Hashable, Mask]:
        """Every layer as it is packed, by class id, `"zones"`, `("wide", …)` and `"free"`: to see what has changed."""
        found: dict[Hashable, Mask] = {"zones": self._zones, "free": self._free}
        found.update((class_id, mask) for class_id, mask in self._layers.items())
        found.update((("wide", index, margin_m), mask) for index, (margin_m, mask) in enumerate(self._wide_zones))
        return found

    @property
    def layers(self) -> list[tuple[int | None, float, Mask]]:
        """Class id, margin in metres and cells of every layer, `NOTHING` for the geometric one; zones have no class."""
        found: list[tuple[int | None, float, Mask]] = [(None, 0.0, self._zones)]
        found += [(class_id, self._margins_m.get(class_id, 0.0), mask) for class_id, mask in self._layers.items()]
        return found + [(None, margin_m, mask) for margin_m, mask in self._wide_zones]

    def part(self, top: int, left: int, bottom: int, right: int) -> OccupancyGrid:
        """The part of the grid in rows top … bottom−1 and columns left … right−1, which lie on it."""
        return self._made(self.spec.part(top, left, bottom, right), lambda mask: mask.window(top, left, bottom, right))

    def around(self, pose: Pose2, reach_m: float) -> OccupancyGrid:
        """The part of the grid within a square of `reach_m` about a pose, widened by the largest margin; may be empty."""
        widest = max([0.0, *self._margins_m.values(), *(margin_m for margin_m, _ in self._wide_zones)])
        return self.part(*box_around(self.spec, pose, reach_m + widest))

    def _made(self, spec: GridSpec, part: Part) -> OccupancyGrid:
        return OccupancyGrid(
            spec=spec,
            geometric=part(self._layers[NOTHING]),
            beware={class_id: part(mask) for class_id, mask in self._layers.items() if class_id != NOTHING},
            margins_m=dict(self._margins_m),
            zones=part(self._zones),
            wide_zones=tuple((margin_m, part(mask)) for margin_m, mask in self._wide_zones),
        )


class LiveOccupancy:
    """Follows a map, and keeps the space that is free for the robot's centre: the union of all layers, each inflated by the
    robot's half width, the safety margin and the layer's own margin."""

    def __init__(self, cloud: CloudMap, *, vehicle_width_m: float, safety_margin_m: float) -> None:
        self._cloud = cloud
        self._width_m, self._margin_m = vehicle_width_m, safety_margin_m
        self._inflated = InflatedGrid(cloud.spec.rows, cloud.spec.cols)
        self._order: tuple[BewareList, tuple[Zone, ...]] | None = None
        self._groups: dict[int, list[Plane]] = {}
        self._radius_of: dict[int, int] = {}
        self._layers: dict[int, Mask] = {}
        self._now: Occupancy | None = None

    @property
    def space(self) -> FreeSpace:
        """Where the robot's centre may be; live, for the planner of paths."""
        return self._inflated.space

    def follow(self, beware: BewareList, zones: tuple[Zone, ...]) -> Occupancy:
        """The map as it is now under a beware list and zones; the same object as long as nothing has changed."""
        self._cloud.use(beware)
        changes = self._cloud.layers.take_changes()
        if changes is None or self._order != (beware, zones) or self._now is None:
            self._order = (beware, zones)
            self._make_anew(beware, zones)
        elif len(changes.cells):
            self._apply(changes)
        else:
            return self._now
        self._now = self._snapshot(beware)
        return self._now

    def _make_anew(self, beware: BewareList, zones: tuple[Zone, ...]) -> None:
        drawn, wide = self._cloud.layers.drawn(zones)
        self._zones, self._wide = Mask.of(drawn), tuple((margin_m, Mask.of(mask)) for margin_m, mask in wide)
        margins = {NOTHING: 0.0, **{entry.class_id: entry.margin_m for entry in beware.enabled}}
        self._radius_of = {class_id: self._radius(margin_m) for class_id, margin_m in margins.items()}
        self._layers = {class_id: self._copied(class_id) for class_id in margins}
        self._regroup()
        unions = {}
        for radius, planes in self._groups.items():
            unions[radius] = np.zeros_like(self.space.tripwire)
            for plane in planes:
                unions[radius] |= plane
        self._inflated.replace(unions)

    def _regroup(self) -> None:
        """The live planes that are inflated by the same radius."""
        self._groups = {self._radius(0.0): [self._zones.plane]}
        for margin_m, mask in self._wide:
            self._groups.setdefault(self._radius(margin_m), []).append(mask.plane)
        for class_id, radius in self._radius_of.items():
            plane = self._cloud.layers.plane(class_id)
            self._groups.setdefault(radius, [])
            if plane is not None:
                self._groups[radius].append(plane)

    def _apply(self, changes: Changes) -> None:
        self._regroup()
        for class_id in np.unique(changes.class_ids):
            if int(class_id) in self._radius_of:
                self._layers[int(class_id)] = self._copied(int(class_id))
        radius_of = np.full(256, -1, dtype=np.int64)
        for class_id, radius in self._radius_of.items():
            radius_of[class_id] = radius
        radii = radius_of[changes.class_ids]
        for radius in np.unique(radii[radii >= 0]):
            rows, cols = np.divmod(np.unique(changes.cells[radii == radius]), self._cloud.spec.cols)
            occupied = np.zeros(len(rows), dtype=np.bool_)
            for plane in self._groups[int(radius)]:
                occupied |= _held(plane, rows, cols)
            cells = np.column_stack([rows, cols])
            self._inflated.set_cells(int(radius), cells[occupied], True)
            self._inflated.set_cells(int(radius), cells[~occupied], False)

    def _snapshot(self, beware: BewareList) -> Occupancy:
        spec, version = self._cloud.spec, 0 if self._now is None else self._now.version + 1
        return Occupancy(
            spec=spec,
            layers=dict(self._layers),
            margins_m={entry.class_id: entry.margin_m for entry in beware.enabled},
            zones=self._zones,
            wide_zones=self._wide,
            free=Mask.copied(self.space.across[FREE], spec.rows, spec.cols),
            version=version,
        )

    def _copied(self, class_id: int) -> Mask:
        plane, spec = self._cloud.layers.plane(class_id), self._cloud.spec
        if plane is None:
            return Mask(np.zeros_like(self._inflated.space.tripwire), spec.rows, spec.cols)
        return Mask.copied(plane, spec.rows, spec.cols)

    def _radius(self, margin_m: float) -> int:
        return inflation_radius(
            vehicle_width_m=self._width_m,
            safety_margin_m=self._margin_m + margin_m,
            resolution_m=self._cloud.spec.resolution_m,
        )


def nearest_free(free: Mask, cell: Cell, within: float) -> Cell | None:
    """The free cell nearest to `cell`, itself if free or outside; None when all within that many cells are blocked."""
    if not (0 <= cell[0] < free.rows and 0 <= cell[1] < free.cols):
        return cell
    reach = math.floor(within)
    top, left = max(cell[0] - reach, 0), max(cell[1] - reach, 0)
    bottom, right = min(cell[0] + reach + 1, free.rows), min(cell[1] + reach + 1, free.cols)
    near = np.argwhere(free.window(top, left, bottom, right)) + np.array([top, left])
    squared = ((near - cell) ** 2).sum(axis=1)
    if len(near) == 0 or squared.min() > within**2:
        return None
    row, col = near[int(np.argmin(squared))]
    return int(row), int(col)


def box_around(spec: GridSpec, pose: Pose2, reach_m: float) -> tuple[int, int, int, int]:
    """(top, left, bottom, right) cells of the grid within a square about a pose; may be empty."""
    row, col = spec.cell(pose.x_m, pose.y_m)
    reach = math.ceil(reach_m / spec.resolution_m)
    top, left = min(max(row - reach, 0), spec.rows), min(max(col - reach, 0), spec.cols)
    return top, left, max(min(row + reach + 1, spec.rows), top), max(min(col + reach + 1, spec.cols), left)


def _held(plane: Plane, rows: npt.NDArray[np.int64], cols: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """(N,) which of some cells are set."""
    words = plane[rows + PAD, (cols + PAD) >> 6]
    return np.asarray((words >> (cols & 63).astype(np.uint64)) & np.uint64(1)).astype(np.bool_)
