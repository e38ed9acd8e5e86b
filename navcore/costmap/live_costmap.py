"""Live costmap: follows the map, the beware list and the zones incrementally.

An update costs what has changed on the map. An edit of the beware list or of the zones rebuilds
everything from the layers of bits, which takes some milliseconds on the largest maps: it acts
within one tick on everything ever seen.

Beware cells of which the safety gate keeps the robot farther than the inflation of their class does
are inflated by what the gate keeps (`widen`): where the gate would stop, no path leads.
"""

from __future__ import annotations

import numpy as np

from navcore.costmap.beyond import closed_from_beyond
from navcore.costmap.costmap import Costmap, are_set
from navcore.geometry.arrays import Floats, Indices, Points, sorted_distinct
from navcore.grid.bitplane import PAD, BitPlane, empty_plane
from navcore.grid.cell_mask import CellMask
from navcore.grid.free_space import FREE, FreeSpace
from navcore.grid.grid import inflation_radius
from navcore.grid.growth import Growth
from navcore.grid.inflation import InflatedGrid
from navcore.mapping.layers import Changes
from navcore.mapping.point_map import PointMap
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.mission.zone import Zone, zone_masks

_NO_CELLS: Indices = np.empty(0, dtype=np.int64)


class LiveCostmap:
    """Costmap of a growing map, and the free space of the robot's centre: all cells outside of
    every layer inflated by half the robot's width, the safety margin and the layer's own margin."""

    def __init__(
        self, point_map: PointMap, *, vehicle_width_m: float, safety_margin_m: float
    ) -> None:
        self._map = point_map
        self._width_m, self._margin_m = vehicle_width_m, safety_margin_m
        self._inflated = InflatedGrid(point_map.spec.rows, point_map.spec.cols)
        self._order: tuple[BewareList, tuple[Zone, ...]] | None = None
        self._groups: dict[int, list[BitPlane]] = {}
        self._radius_of: dict[int, int] = {}
        self._layers: dict[int, CellMask] = {}
        self._zone_masks: (
            tuple[tuple[Zone, ...], CellMask, tuple[tuple[float, CellMask], ...]] | None
        ) = None
        self._beyond: BitPlane | None = None
        self._wider: dict[int, Indices] = {}
        self._wider_planes: dict[int, BitPlane] = {}
        self._now: Costmap | None = None

    @property
    def space(self) -> FreeSpace:
        """Cells that the robot's centre may be in; live, for the path planner."""
        return self._inflated.space

    def grow(self, growth: Growth) -> None:
        """Continue on the larger grid to which the map has grown; `space` is a new object, and
        `follow` has to be called before it is used."""
        self._inflated.grow(growth)
        self._order = self._zone_masks = None
        self._wider, self._wider_planes = {}, {}

    def restart(self) -> None:
        """Begin again on the grid of a map that was replaced; `space` is a new object, and `follow`
        has to be called before it is used."""
        self._inflated = InflatedGrid(self._map.spec.rows, self._map.spec.cols)
        self._order = self._zone_masks = None
        self._wider, self._wider_planes = {}, {}

    def follow(self, beware: BewareList, zones: tuple[Zone, ...]) -> Costmap:
        """Return the costmap of the present map for a beware list and zones; the same object as
        long as nothing has changed."""
        self._map.use(beware)
        changes = _joined(self._map.layers.take_changes(), self._map.terrain.take_changes())
        if changes is None or self._order != (beware, zones) or self._now is None:
            self._order = (beware, zones)
            self._rebuild(beware, zones)
        elif len(changes.cells):
            self._apply(changes)
        else:
            return self._now
        self._now = self._snapshot(beware)
        return self._now

    def widen(self, cells: Points, clearance_m: Floats, beware: BewareList) -> Costmap:
        """Return the costmap in which the side of the robot keeps (N,) clearances in metres from
        (N, 2) centres of beware cells, map frame, where these are more than the inflation gives; it
        replaces what was widened before. `follow` has to be called before, with the same list."""
        spec, usual = self._map.spec, self._radius(0.0)
        # The same small term as in `inflation_radius`.
        radii = np.ceil((self._width_m / 2 + clearance_m) / spec.resolution_m - 1e-9)
        wide = radii > usual
        x, y = ((cells - (spec.origin_x_m, spec.origin_y_m)) // spec.resolution_m).astype(int).T
        numbers = y * spec.cols + x
        wider = {
            int(radius): np.sort(numbers[radii == radius]) for radius in np.unique(radii[wide])
        }
        changed = {
            radius: numbers
            for radius in {*wider, *self._wider}
            if len(
                numbers := np.setxor1d(
                    wider.get(radius, _NO_CELLS), self._wider.get(radius, _NO_CELLS)
                )
            )
        }
        if not changed and self._now is not None:
            return self._now
        self._wider = wider
        self._wider_planes = {radius: self._plane_of(numbers) for radius, numbers in wider.items()}
        self._regroup()
        for radius, numbers in changed.items():
            self._inflate(radius, numbers)
        self._now = self._snapshot(beware)
        return self._now

    def _plane_of(self, numbers: Indices) -> BitPlane:
        """Return the plane of cells by their (N,) numbers, row by row."""
        plane = empty_plane(self._map.spec.rows, self._map.spec.cols)
        rows, cols = np.divmod(numbers, self._map.spec.cols)
        bits = np.uint64(1) << (cols & 63).astype(np.uint64)
        np.bitwise_or.at(plane, (rows + PAD, (cols + PAD) >> 6), bits)
        return plane

    def _rebuild(self, beware: BewareList, zones: tuple[Zone, ...]) -> None:
        if self._zone_masks is None or self._zone_masks[0] != zones:
            plain, wide = zone_masks(zones, self._map.spec)
            packed = tuple((margin_m, CellMask.of(mask)) for margin_m, mask in wide)
            self._zone_masks = (zones, CellMask.of(plain), packed)
            self._beyond = closed_from_beyond(zones, self._map.spec, self._radius)
        _, self._zones, self._wide = self._zone_masks
        margins = {NOTHING: 0.0, **{entry.class_id: entry.margin_m for entry in beware.enabled}}
        self._radius_of = {
            class_id: self._radius(margin_m) for class_id, margin_m in margins.items()
        }
        self._layers = {class_id: self._copied(class_id) for class_id in margins}
        self._regroup()
        unions = {}
        for radius, planes in self._groups.items():
            unions[radius] = np.zeros_like(self.space.sentinel)
            for plane in planes:
                unions[radius] |= plane
        self._inflated.replace(unions)

    def _regroup(self) -> None:
        """Group the live planes that are inflated by the same radius."""
        self._groups = {self._radius(0.0): [self._zones.plane]}
        for margin_m, mask in self._wide:
            self._groups.setdefault(self._radius(margin_m), []).append(mask.plane)
        if self._beyond is not None:
            self._groups.setdefault(0, []).append(self._beyond)
        for class_id, radius in self._radius_of.items():
            plane = self._map.layers.plane(class_id)
            self._groups.setdefault(radius, [])
            if plane is not None:
                self._groups[radius].append(plane)
        for radius, plane in self._wider_planes.items():
            self._groups.setdefault(radius, []).append(plane)
        self._groups[self._radius(0.0)].append(self._map.terrain.untraversable)

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
            self._inflate(int(radius), sorted_distinct(changes.cells[radii == radius]))

    def _inflate(self, radius: int, numbers: Indices) -> None:
        """Inflate changed cells, by their (N,) numbers, as the planes of a radius have them."""
        rows, cols = np.divmod(numbers, self._map.spec.cols)
        occupied = np.zeros(len(rows), dtype=np.bool_)
        for plane in self._groups.get(radius, []):
            occupied |= are_set(plane, rows, cols)
        cells = np.column_stack([rows, cols])
        self._inflated.set_cells(radius, cells[occupied], True)
        self._inflated.set_cells(radius, cells[~occupied], False)

    def _snapshot(self, beware: BewareList) -> Costmap:
        spec, version = self._map.spec, 0 if self._now is None else self._now.version + 1
        return Costmap(
            spec=spec,
            layers=dict(self._layers),
            margins_m={entry.class_id: entry.margin_m for entry in beware.enabled},
            zones=self._zones,
            wide_zones=self._wide,
            uncertain=tuple(
                (
                    (radius - self._radius(0.0)) * spec.resolution_m,
                    CellMask.copied(plane, spec.rows, spec.cols),
                )
                for radius, plane in self._wider_planes.items()
            ),
            free=CellMask.copied(self.space.across[FREE], spec.rows, spec.cols),
            version=version,
        )

    def _copied(self, class_id: int) -> CellMask:
        plane, spec = self._map.layers.plane(class_id), self._map.spec
        if plane is None:
            return CellMask.empty(spec.rows, spec.cols)
        if class_id == NOTHING:
            # Ground that the robot cannot drive on is an obstacle like any other.
            return CellMask(plane | self._map.terrain.untraversable, spec.rows, spec.cols)
        return CellMask.copied(plane, spec.rows, spec.cols)

    def _radius(self, margin_m: float) -> int:
        return inflation_radius(
            vehicle_width_m=self._width_m,
            safety_margin_m=self._margin_m + margin_m,
            resolution_m=self._map.spec.resolution_m,
        )


def _joined(layers: Changes | None, terrain: Indices | None) -> Changes | None:
    """Return the changed cells of the layers, and those of the terrain as geometric ones; None if
    all cells of either count as changed."""
    if layers is None or terrain is None:
        return None
    if not len(terrain):
        return layers
    return Changes(
        class_ids=np.concatenate(
            [layers.class_ids, np.full(len(terrain), NOTHING, dtype=np.uint8)]
        ),
        cells=np.concatenate([layers.cells, terrain]),
    )
