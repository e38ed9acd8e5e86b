"""The exported map, read by the package's own reader of Nav2's format."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import httpx
import numpy as np

from navcore.costmap.costmap import Costmap
from navcore.formats.nav2_map import Nav2Map, State, load
from navcore.grid.grid import GridSpec, OccupancyGrid
from navcore.mission.zone_cells import rasterise
from tests.web.fake_operations import FakeOperations
from tests.web.fake_world import SPEC
from web.images.encode import map_pgm, map_yaml
from web.interface.snapshots import TickSnapshot

CORNERS = ((-6.0, -5.0), (-5.0, -5.0), (-5.0, -3.5))


def handed_out(folder: Path, pgm: bytes, yaml: str) -> Nav2Map:
    (folder / "map.pgm").write_bytes(pgm)
    (folder / "map.yaml").write_text(yaml)
    return load(folder / "map.yaml")


def with_grid(picture: TickSnapshot, grid: OccupancyGrid) -> TickSnapshot:
    return dataclasses.replace(picture, occupancy=Costmap.of(grid, picture.blocked, version=0))


def assert_says_the_same(nav2_map: Nav2Map, picture: TickSnapshot) -> None:
    occupied = picture.grid.occupied()
    for _, mask in picture.grid.wide_zones:
        occupied = occupied | mask
    assert nav2_map.spec == picture.grid.spec
    np.testing.assert_array_equal(nav2_map.cells(State.OCCUPIED), occupied)
    np.testing.assert_array_equal(nav2_map.cells(State.FREE), picture.seen & ~occupied)
    np.testing.assert_array_equal(nav2_map.cells(State.UNKNOWN), ~picture.seen & ~occupied)


def test_the_map_over_http_is_read_back_cell_by_cell(
    client: httpx.Client, operations: FakeOperations, tmp_path: Path
) -> None:
    nav2_map = handed_out(
        tmp_path, client.get("/api/v1/map.pgm").content, client.get("/api/v1/map.yaml").text
    )
    picture = operations.newest_tick()
    assert picture is not None
    assert {int(state) for state in np.unique(nav2_map.states())} == {
        State.FREE,
        State.OCCUPIED,
        State.UNKNOWN,
    }
    assert_says_the_same(nav2_map, picture)
    assert nav2_map.cells(State.OCCUPIED)[SPEC.cell(4.0, 2.5)]
    assert not nav2_map.cells(State.OCCUPIED)[
        SPEC.cell(4.0, -2.5)
    ]  # control: it is not upside down


def test_zones_are_on_the_map_only_when_they_are_asked_for(
    tmp_path: Path, operations: FakeOperations
) -> None:
    picture = operations.newest_tick()
    assert picture is not None
    mask = rasterise(CORNERS, SPEC)
    for own in ({"wide_zones": ((0.3, mask),)}, {"zones": mask}):
        zoned = with_grid(picture, dataclasses.replace(picture.grid, **own))
        plain = handed_out(tmp_path, map_pgm(zoned), map_yaml(zoned))
        assert_says_the_same(plain, picture)
        with_zones = handed_out(tmp_path, map_pgm(zoned, zones=True), map_yaml(zoned))
        assert mask.any() and with_zones.cells(State.OCCUPIED)[mask].all()
        assert_says_the_same(with_zones, zoned)


def test_an_origin_that_is_not_a_round_number_is_exported_exactly(
    tmp_path: Path, operations: FakeOperations
) -> None:
    picture = operations.newest_tick()
    assert picture is not None
    spec = GridSpec(
        resolution_m=0.1 + 1e-12,
        rows=SPEC.rows,
        cols=SPEC.cols,
        origin_x_m=1e-17,
        origin_y_m=-1 / 3,
    )
    picture = with_grid(picture, dataclasses.replace(picture.grid, spec=spec))
    assert handed_out(tmp_path, map_pgm(picture), map_yaml(picture)).spec == spec
