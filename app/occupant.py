"""What makes a cell unfit to stand on, in words."""

from __future__ import annotations

from navcore.grid import Cell, OccupancyGrid


def occupant(grid: OccupancyGrid, cell: Cell) -> str:
    """Of a cell that is blocked."""
    if grid.zones[cell] or any(mask[cell] for _, mask in grid.wide_zones):
        return "inside a beware zone"
    if any(layer[cell] for layer in grid.beware.values()):
        return "on something of the beware list"
    return "inside an obstacle" if grid.geometric[cell] else "too close to an obstacle or a zone"
