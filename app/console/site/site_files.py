"""Sites as files, without a robot: listed, exported, imported.

The command line uses it alone, a running console as part of `app.console.site.sites`.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace

import numpy as np

from app.console.mission.saved_missions import MISSIONS
from app.console.site.dock_and_tags import dock_of, stored_tags
from app.console.site.placing import poses_of_file
from app.console.site.site_archive import unpack
from app.console.site.site_map import ACCEPTED, cells_of, save_accepted
from app.storage.site_store import SiteStore
from app.storage.sites import SiteRow, SiteTable
from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration, NotKnown
from navcore.formats import alignment
from navcore.formats.keepout_mask import closed_cells, mask_spec
from navcore.formats.map_image import encode
from navcore.formats.nav2_map import Nav2Map, State, map_from_cells, yaml_text
from navcore.grid.grid import DEFAULT_RESOLUTION_M, GridSpec
from navcore.grid.growth import growth_over
from navcore.mapping.changes import CellMap
from navcore.mission.anchors import placed
from web.interface.sites import PointPair, Site


def describe(site: SiteStore, row: SiteRow, *, chosen: bool) -> Site:
    """Return a site as it is listed."""
    try:
        kept = site.map_file.stat()
    except OSError:
        kept = None
    kind, name = ACCEPTED
    return Site(
        id=row.id,
        name=row.name,
        chosen=chosen,
        world=row.world,
        zones=len(site.zones()),
        missions=len(site.documents(MISSIONS)),
        map_bytes=0 if kept is None else kept.st_size,
        map_unix_s=None if kept is None else kept.st_mtime,
        accepted=name in site.documents(kind),
        dock=dock_of(site),
        tags=stored_tags(site),
    )


def listed(sites: SiteTable, chosen_id: str) -> tuple[Site, ...]:
    """Return all sites by name."""
    return tuple(
        describe(sites.contents(row), row, chosen=row.id == chosen_id) for row in sites.all()
    )


def add(sites: SiteTable, name: str, archive: bytes) -> SiteStore:
    """Make a site of an archive, all or nothing."""
    contents = unpack(archive)
    with sites.making(name, contents.map_data) as site:
        contents.store(site)
        return site


def export_nav2(site: SiteStore, config: MappingConfig) -> bytes:
    """Return a zip of Nav2 files: the map without the zones, and the keep-out mask of the zones
    beside it. Raises `NotKnown` without a map, and where the site has been deleted."""
    map_data = site.map_data()
    cells, poses = cells_of(site, map_data, config), poses_of_file(map_data, site.map_file.name)
    if cells is None:
        raise NotKnown(f"site {site.name!r} keeps no map yet; drive there first, without --map")
    with site.reading():
        zones = tuple(placed(zone, poses) for zone in site.zones())
    spec = mask_spec(zones, cells.spec)  # zones may lie beyond the map
    closed = closed_cells(zones, spec)
    images = {
        "map": map_from_cells(occupied=cells.occupied, known=cells.known, spec=cells.spec),
        "keepout_mask": map_from_cells(occupied=closed, known=np.ones_like(closed), spec=spec),
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, nav2_map in images.items():
            packed.writestr(f"{name}.yaml", yaml_text(nav2_map.description, f"{name}.pgm"))
            packed.writestr(f"{name}.pgm", encode(nav2_map.image))
    return file.getvalue()


def add_nav2(
    sites: SiteTable,
    name: str,
    nav2_map: Nav2Map,
    *,
    pairs: tuple[PointPair, PointPair] | None,
    first_grid: GridSpec | None = None,
) -> SiteStore:
    """Make a site whose accepted map is a Nav2 map, see `web.interface.sites.Sites.add_nav2`.

    `first_grid`: grid with which a map of this world begins; where it is not known, the origin of
    the map frame, around which a world lies. Raises `BadConfiguration` where it cannot grow to the
    Nav2 map.
    """
    if pairs is not None:
        nav2_map = alignment.placed(nav2_map, alignment.align(*pairs))
    if first_grid is not None:
        growth_over(first_grid, nav2_map.spec)
    else:
        _require_near_origin(nav2_map.spec)
    cells = _cells_of(nav2_map)
    with sites.making(name) as site:
        save_accepted(site, cells)
        return site


def _require_near_origin(spec: GridSpec) -> None:
    """Raise `BadConfiguration` for a grid that no map covers, or none together with the origin. The
    cells of the map are not known: those of most worlds, or as large as those of the grid."""
    resolution_m = max(DEFAULT_RESOLUTION_M, spec.resolution_m)
    at_origin = GridSpec.centred(size_m=(1.0, 1.0), resolution_m=resolution_m)
    inside = replace(at_origin, origin_x_m=spec.origin_x_m, origin_y_m=spec.origin_y_m)
    if not _can_cover(inside, spec):
        raise BadConfiguration(f"the map covers {spec.extent()}, too large for one map")
    if not _can_cover(at_origin, spec):
        raise BadConfiguration(
            f"the map covers {spec.extent()}, too far from the origin of the map frame for one map "
            "of both; check its origin, or place it by two points"
        )


def _can_cover(first: GridSpec, spec: GridSpec) -> bool:
    """Return whether a map that begins with one grid can grow to another."""
    try:
        growth_over(first, spec)
    except BadConfiguration:
        return False
    return True


def _cells_of(nav2_map: Nav2Map) -> CellMap:
    return CellMap(
        spec=nav2_map.spec,
        occupied=nav2_map.cells(State.OCCUPIED),
        known=~nav2_map.cells(State.UNKNOWN),
    )
