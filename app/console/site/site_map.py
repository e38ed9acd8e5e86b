"""Maps of a site: the robot's own map that is kept, and the one that the operator has accepted."""

from __future__ import annotations

import base64
import dataclasses
import time
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from app.storage.site_store import SiteStore
from navcore.config.mapping import MappingConfig
from navcore.costmap.costmap import layer_grid
from navcore.errors import BadConfiguration
from navcore.formats.map_image import MAX_PIXELS, MAX_SIDE
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import BoolGrid, GridSpec, OccupancyGrid
from navcore.grid.growth import growth_into, growth_over
from navcore.mapping.changes import CellMap
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage import map_file
from navcore.mapping.storage.map_state import MapState
from navcore.mission.beware_changes import changes_between
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.toml_config import from_table, ranged

ACCEPTED = ("map", "accepted")
"""Kind and name of the stored document."""


def beware_of(site: SiteStore) -> BewareList:
    """Return the beware list of a site; before its first use it is the shipped one."""
    return site.beware() or default_beware_list()


def begin_list(site: SiteStore, of_world: BewareList) -> None:
    """Store the list of a world at a site that has none, as its first use begins: its map is made
    by that list, by which it is exported as well, also where the world is not known."""
    if site.beware() is None:
        site.save_beware(of_world, unix_s=time.time(), what="list of a new site")


def list_of_start(site: SiteStore, of_world: BewareList, given: BewareList | None) -> BewareList:
    """Return the list in force after a start: that of the site, before its first use that of the
    world, or a `given` one from elsewhere under the ids of that."""
    present = site.beware() or of_world
    adopted = present if given is None else present.adopted(given.classes)
    return present if adopted.classes == present.classes else adopted


def keep_list(site: SiteStore, of_world: BewareList, started: BewareList) -> None:
    """Store the list of a start, `started`, where it is new to the site."""
    begin_list(site, of_world)
    present = beware_of(site)
    if started.classes != present.classes:
        what = "; ".join(changes_between(present, started)[:3])
        site.save_beware(started, unix_s=time.time(), by="command line", what=what)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SiteMap:
    """Map of a site."""

    state: MapState
    """State of the map."""
    class_names: Mapping[int, str]
    """Class id → name in the beware lists with which the map was made."""


def map_of(site: SiteStore, empty: MapState) -> SiteMap:
    """Return the kept map of a site, or an empty one; before the first map is kept, the accepted
    one is its prior map.

    `empty`: state of an empty map on the first grid of the world. Raises `BadConfiguration` for a
    map that does not fit.
    """
    if site.map_file.exists():
        stored = map_file.load(site.map_file)
        map_file.check_classes(stored, beware_of(site))
        if growth_into(empty.spec, stored.state.spec) is None:
            raise BadConfiguration(
                f"the map of site {site.name!r} covers {stored.state.spec.extent()}, that of this "
                f"world begins with {empty.spec.extent()}; choose another site, or make one, with "
                "--site NAME"
            )
        return SiteMap(state=stored.state, class_names=stored.class_names)
    accepted = accepted_map(site)
    if accepted is not None:
        growth = growth_over(empty.spec, accepted.spec)
        empty = empty if growth is None else empty.grown(growth)
        prior = CellMask.of(accepted.on(empty.spec).occupied)
        empty = dataclasses.replace(empty, prior=prior)
    return SiteMap(state=empty, class_names={})


def cells_of(site: SiteStore, map_data: bytes | None, config: MappingConfig) -> CellMap | None:
    """Return the cells of the kept map of a site, of its file, without zones, else those of the
    accepted one; None without a map."""
    if map_data is None:
        return accepted_map(site)
    stored, beware = map_file.parsed(map_data, site.map_file.name), beware_of(site)
    map_file.check_classes(stored, beware)
    point_map = PointMap(stored.state.spec, config)
    point_map.restore(stored.state)
    return cells_on(layer_grid(point_map, beware, ()), point_map.explored.seen.bools)


def cells_on(grid: OccupancyGrid, seen: BoolGrid) -> CellMap:
    """Return the cells of a grid without its zones; `seen`: (rows, cols) observed cells."""
    occupied = grid.geometric.copy()
    for layer in grid.beware.values():
        occupied |= layer
    return CellMap(spec=grid.spec, occupied=occupied, known=seen)


def accepted_map(site: SiteStore) -> CellMap | None:
    """Return the map that the operator has accepted; None before."""
    kind, name = ACCEPTED
    record = site.documents(kind).get(name)
    return None if record is None else cell_map_of(record, f"site {site.name!r}: accepted map")


def save_accepted(site: SiteStore, accepted: CellMap) -> None:
    """Store the map that the operator has accepted."""
    site.save_document(*ACCEPTED, cell_map_record(accepted))


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class _Spec:
    """Grid of a stored map, with the limits of its values."""

    resolution_m: float = ranged(1e-3, 100.0)
    rows: int = ranged(1, MAX_SIDE)
    cols: int = ranged(1, MAX_SIDE)
    origin_x_m: float = ranged(-1e6, 1e6)
    origin_y_m: float = ranged(-1e6, 1e6)


def cell_map_record(cells: CellMap) -> dict[str, Any]:
    """Convert a map to JSON."""
    return {
        "spec": dataclasses.asdict(cells.spec),
        "occupied": _packed(cells.occupied),
        "known": _packed(cells.known),
    }


def cell_map_of(record: object, where: str) -> CellMap:
    """Convert a record to a map; raises `BadConfiguration` for one that is no map."""
    if not isinstance(record, dict) or set(record) != {"spec", "occupied", "known"}:
        raise BadConfiguration(f"{where}: expected spec, occupied and known")
    spec = GridSpec(**dataclasses.asdict(from_table(_Spec, record["spec"], f"{where}.spec")))
    if spec.rows * spec.cols > MAX_PIXELS:
        raise BadConfiguration(f"{where}.spec: {spec.rows} × {spec.cols} cells are too many")
    occupied, known = (
        _unpacked(record[name], spec, f"{where}.{name}") for name in ("occupied", "known")
    )
    return CellMap(spec=spec, occupied=occupied, known=known)


def _packed(cells: BoolGrid) -> str:
    return base64.b64encode(zlib.compress(np.packbits(cells).tobytes())).decode()


def _unpacked(text: object, spec: GridSpec, where: str) -> BoolGrid:
    size = -(-spec.rows * spec.cols // 8)
    try:
        if not isinstance(text, str):
            raise ValueError("not text")
        unpacking = zlib.decompressobj()
        data = unpacking.decompress(base64.b64decode(text, validate=True), size + 1)
    except (ValueError, zlib.error) as error:
        raise BadConfiguration(f"{where}: damaged: {error!s:.100}") from None
    if len(data) != size:
        raise BadConfiguration(f"{where}: expected {size} bytes for the grid")
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8), count=spec.rows * spec.cols)
    cells = bits.reshape(spec.rows, spec.cols).view(np.bool_)
    cells.flags.writeable = False
    return cells
