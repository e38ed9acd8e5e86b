"""Site archives: everything comes back, and a hostile one changes nothing."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import pickle
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.console.site import site_archive
from app.console.site.dock_and_tags import furnish, stored_tags
from app.console.site.site_archive import DOCUMENT, MAX_DOCUMENT_BYTES, pack
from app.console.site.site_files import add, add_nav2, export_nav2, listed
from app.console.site.site_map import accepted_map, map_of, save_accepted
from app.storage import Store
from app.storage.site_store import MAP_FILE, SiteStore
from app.storage.sites import site_table
from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration, BadGeometry, NotKnown
from navcore.formats.nav2_map import Nav2Map, State, map_from_cells, read
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mapping.changes import CellMap
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage import map_file
from navcore.mission.beware_list import MAX_RETIRED, BewareList, default_beware_list
from navcore.mission.zone import Zone
from navcore.mission.zone_shapes import Circle
from tests.app.console.site.desk import Desk
from web.interface.sites import SiteChanges, Tag

SPEC = GridSpec.centred(size_m=(6.0, 4.0), resolution_m=0.1)
CIRCLE = Circle(centre=(1.0, 1.0), radius_m=0.5)
DOCK = Pose2(x_m=1.0, y_m=2.0, yaw_rad=0.5)
TAG = Tag(id=3, x_m=1.0, y_m=0.0, z_m=0.5, yaw_rad=1.0, size_m=0.16)


def accepted() -> CellMap:
    occupied = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    occupied[3, :] = True
    return CellMap(spec=SPEC, occupied=occupied, known=np.ones_like(occupied))


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with closing(Store(tmp_path / "data")) as opened:
        site = opened.site
        ring = Zone(id="ring", name="ring", polygon=CIRCLE.outline(), drawn=CIRCLE, margin_m=0.2)
        site.save_zone(ring)
        goal = {"x_m": 1.0, "y_m": 1.0, "yaw_rad": None, "name": "a"}
        site.save_document("mission", "round", {"goals": [goal], "loop": True})
        site.save_beware(default_beware_list().edited("cup", margin_m=0.3).replaced(()))
        furnish(site, DOCK, (TAG,))
        save_accepted(site, accepted())
        state = PointMap(SPEC, MappingConfig()).state()
        site.folder.mkdir(parents=True)
        map_file.save(site.map_file, state, default_beware_list().names)
        yield opened


def test_everything_of_a_site_comes_back_with_new_zone_ids(store: Store) -> None:
    add(store.sites, "copy", pack(store.site))
    site, copy = store.site, store.sites.open("copy")
    (before,), (zone,) = site.zones(), copy.zones()
    assert zone.id != before.id and zone.drawn == CIRCLE
    assert (zone.name, zone.margin_m, zone.polygon) == ("ring", 0.2, before.polygon)
    assert copy.documents("mission") == site.documents("mission")
    beware, original = copy.beware(), site.beware()
    assert beware is not None and original is not None
    assert (beware.classes, set(beware.retired)) == (original.classes, set(original.retired))
    assert copy.map_file.read_bytes() == site.map_file.read_bytes()
    merged = accepted_map(copy)
    assert merged is not None
    np.testing.assert_array_equal(merged.occupied, accepted().occupied)
    first, second = listed(store.sites, store.site.id)
    assert (first.dock, first.tags, first.chosen) == (DOCK, (TAG,), False)
    assert (second.dock, second.tags, second.chosen, second.accepted) == (DOCK, (TAG,), True, True)


def parts_of(archive: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(archive)) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


def packed(parts: dict[str, bytes], kind: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", kind) as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    return file.getvalue()


def edited(change: Callable[[dict[str, Any]], object]) -> Callable[[dict[str, bytes]], bytes]:
    def damage(parts: dict[str, bytes]) -> bytes:
        document = json.loads(parts[DOCUMENT])
        change(document)
        return packed({**parts, DOCUMENT: json.dumps(document).encode()})

    return damage


def map_bomb(parts: dict[str, bytes]) -> bytes:
    """A map file of which one part would be a gigabyte."""
    file = io.BytesIO()
    with (
        zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as inner,
        inner.open("points_map.npy", "w") as part,
    ):
        for _ in range(1 << 10):
            part.write(bytes(1 << 20))
    return packed({**parts, MAP_FILE: file.getvalue()})


def pickled_map(parts: dict[str, bytes]) -> bytes:
    file = io.BytesIO()
    np.save(file, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    inner = {name: file.getvalue() for name in parts_of(parts[MAP_FILE])}
    return packed({**parts, MAP_FILE: packed(inner)})


HOSTILE: dict[str, Callable[[dict[str, bytes]], bytes]] = {
    "not a zip": lambda parts: b"PK\x03\x04 nothing",
    "empty": lambda parts: b"",
    "a pickle": lambda parts: pickle.dumps(parts),
    "torn": lambda parts: packed(parts)[:-40],
    "path traversal": lambda parts: packed({**parts, "../../evil": b"x"}),
    "absolute path": lambda parts: packed({**parts, "/etc/passwd": b"x"}),
    "more than a site": lambda parts: packed({**parts, "x.py": b"x"}),
    "no document": lambda parts: packed({MAP_FILE: parts[MAP_FILE]}),
    "document bomb": lambda parts: packed({DOCUMENT: b" " * (MAX_DOCUMENT_BYTES + 1)}),
    "map bomb": map_bomb,
    "pickled map": pickled_map,
    "no map": lambda parts: packed({**parts, MAP_FILE: b"nothing"}),
    "deep JSON": lambda parts: packed({DOCUMENT: b"[" * 100_000}),
    "no JSON": lambda parts: packed({DOCUMENT: b"\xff"}),
    "unknown key": edited(lambda site: site.update(extra=1)),
    "other version": edited(lambda site: site.update(version=2)),
    "crossed zone": edited(
        lambda site: site["zones"][0]["geometry"].update(
            coordinates=[[[0, 0], [2, 2], [2, 0], [0, 2]]]
        )
    ),
    "margin": edited(lambda site: site["zones"][0]["properties"].update(margin_m=99)),
    "goal": edited(lambda site: site["missions"]["round"]["goals"][0].update(x_m=1e99)),
    "name": edited(lambda site: site["missions"].update({"\x00": {"goals": [], "loop": False}})),
    "class": edited(lambda site: site["beware"].update(classes=[{"name": "x", "class_id": 99}])),
    "grid": edited(lambda site: site["accepted"]["spec"].update(rows=10**9)),
    "packed cells": edited(lambda site: site["accepted"].update(known="AAAA")),
    "tag": edited(lambda site: site["tags"][0].update(size_m=-1)),
}


@pytest.mark.parametrize("how", HOSTILE)
def test_a_hostile_archive_is_refused_and_leaves_nothing(
    store: Store, tmp_path: Path, how: str
) -> None:
    parts = parts_of(pack(store.site))
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises((BadConfiguration, BadGeometry)):
        add(store.sites, "evil", HOSTILE[how](parts))
    assert [row.name for row in store.sites.all()] == ["default"]
    assert sorted(tmp_path.rglob("*")) == before
    add(store.sites, "good", packed(parts))  # control: undamaged it is taken


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"dock": {"x_m": 1e9, "y_m": 0, "yaw_rad": 0}}, "site.json: at dock.x_m: X: at most"),
        ({"version": 2}, "site.json: at version: Version: expected 1."),
    ],
)
def test_a_bad_value_in_an_archive_is_told_in_a_sentence(
    store: Store, change: dict[str, Any], said: str
) -> None:
    archive = edited(lambda site: site.update(change))(parts_of(pack(store.site)))
    with pytest.raises(BadConfiguration, match=said):
        add(store.sites, "evil", archive)


def test_a_dock_and_a_tag_of_before_their_limits_hold_up_neither_edits_nor_the_archive(
    tmp_path: Path,
) -> None:
    desk = Desk(tmp_path / "data")
    with closing(desk.store):
        site = desk.store.site
        furnish(
            site,
            dataclasses.replace(DOCK, yaw_rad=DOCK.yaw_rad + 500 * math.pi),
            (TAG, dataclasses.replace(TAG, id=700)),
        )
        desk.sites.put_tag("default", dataclasses.replace(TAG, id=5))
        desk.sites.remove_tag("default", TAG.id)
        copy = desk.sites.add("copy", pack(site))
        assert [tag.id for tag in stored_tags(site)] == [5, 700]
        assert [tag.id for tag in copy.tags] == [5]
        assert copy.dock is not None and copy.dock.yaw_rad == pytest.approx(DOCK.yaw_rad)
        changed = desk.sites.change("default", SiteChanges(tags=(TAG,)))
        assert [tag.id for tag in changed.tags] == [TAG.id]


def test_a_site_that_is_renamed_or_deleted_meanwhile_is_exported_whole_or_not_at_all(
    store: Store,
) -> None:
    site = store.site
    store.sites.rename("default", "hall")
    assert len(json.loads(parts_of(pack(site))[DOCUMENT])["zones"]) == 1
    export_nav2(site, MappingConfig())  # control: there is a map
    store.sites.delete("hall")
    site.folder.mkdir()  # the map was read already
    state = PointMap(SPEC, MappingConfig()).state()
    map_file.save(site.map_file, state, default_beware_list().names)
    acts: tuple[Callable[[], object], ...] = (
        lambda: pack(site),
        lambda: export_nav2(site, MappingConfig()),
    )
    for act in acts:
        with pytest.raises(NotKnown, match="'default'"):
            act()


def test_an_archive_is_of_one_moment_whatever_another_program_writes(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write_and_read(site: SiteStore) -> CellMap | None:
        with site_table(store.path.parent) as others:
            others.open("default").change_zones([], ["ring"])
        return accepted_map(site)

    monkeypatch.setattr(site_archive, "accepted_map", write_and_read)
    assert len(json.loads(parts_of(pack(store.site))[DOCUMENT])["zones"]) == 1
    assert store.site.zones() == ()  # control


def test_a_nav2_map_is_the_accepted_map_and_the_prior_of_a_new_site(store: Store) -> None:
    cells = accepted()
    source = map_from_cells(occupied=cells.occupied, known=cells.known, spec=SPEC)
    add_nav2(store.sites, "hall", source, pairs=None)
    hall = store.sites.open("hall")
    state = map_of(hall, PointMap(SPEC, MappingConfig()).state()).state
    np.testing.assert_array_equal(state.prior.bools, cells.occupied)
    moved = ((0.0, 0.0), (3.0, 0.0)), ((0.0, 0.0), (0.0, 3.0))
    add_nav2(store.sites, "turned", source, pairs=moved)
    turned = accepted_map(store.sites.open("turned"))
    assert turned is not None and turned.occupied.any(axis=0).sum() <= 2  # the row is a column now


def test_a_nav2_map_to_which_the_map_cannot_grow_is_refused_with_both_extents(
    store: Store,
) -> None:
    cells = accepted()
    far = dataclasses.replace(SPEC, origin_x_m=25_000.0, origin_y_m=18_000.0)
    source = map_from_cells(occupied=cells.occupied, known=cells.known, spec=far)
    extents = r"the map covers x 25000 to 25006 m.*begins with x -3 to 3 m"
    with pytest.raises(BadConfiguration, match=extents):
        add_nav2(store.sites, "hall", source, pairs=None, first_grid=SPEC)
    # The command line does not know the world, but around the origin it lies.
    with pytest.raises(BadConfiguration, match="too far from the origin"):
        add_nav2(store.sites, "hall", source, pairs=None)
    assert [row.name for row in store.sites.all()] == ["default"]
    save_accepted(store.sites.make("hall"), dataclasses.replace(cells, spec=far))
    with pytest.raises(BadConfiguration, match=extents):
        map_of(store.sites.open("hall"), PointMap(SPEC, MappingConfig()).state())


def test_a_nav2_map_of_coarse_cells_is_as_large_as_a_map_of_such_cells(store: Store) -> None:
    def row(cols: int) -> Nav2Map:
        """Return a map of 10 rows of cells of 0.1 m around the origin."""
        cells = np.zeros((10, cols), dtype=np.bool_)
        spec = GridSpec.centred(size_m=(cols / 10, 1.0), resolution_m=0.1)
        return map_from_cells(occupied=cells, known=~cells, spec=spec)

    add_nav2(store.sites, "long", row(40_000), pairs=None)  # 80 000 cells of 0.05 m are too many
    with pytest.raises(BadConfiguration, match=r"covers x -3500 to 3500 m.*too large for one map"):
        add_nav2(store.sites, "longer", row(70_000), pairs=None)
    assert [one.name for one in store.sites.all()] == ["default", "long"]


def test_a_site_whose_classes_were_often_renamed_comes_back(store: Store) -> None:
    beware = default_beware_list()
    gone, often = (entry.name for entry in beware.classes[:2])
    beware = beware.removed(gone)
    for number in range(MAX_RETIRED + 20):
        beware = beware.renamed(often if number == 0 else f"tape {number - 1}", f"tape {number}")
    # The oldest former names go, and never the last one of an id.
    assert len(beware.retired) == MAX_RETIRED and often not in beware.ids
    assert beware.ids[gone] == default_beware_list().ids[gone]
    store.site.save_beware(beware)
    add(store.sites, "hall", pack(store.site))
    brought = store.sites.open("hall").beware()
    assert brought is not None
    assert (brought.classes, brought.retired) == (beware.classes, beware.retired)


def test_a_site_comes_back_whose_names_mean_folders_in_an_address(store: Store) -> None:
    site, beware = store.site, default_beware_list()
    one, *others = beware.classes
    beware = BewareList(
        classes=(dataclasses.replace(one, name=".."), *others),
        retired=((".", one.class_id),),
    )
    site.save_beware(beware)
    site.save_zone(Zone(id="dot", name=".", polygon=CIRCLE.outline()))
    site.save_document("mission", "..", {"goals": [], "loop": False})
    add(store.sites, "hall", pack(site))
    brought = store.sites.open("hall")
    read = brought.beware()
    assert read is not None and (read.classes, read.retired) == (beware.classes, beware.retired)
    assert [zone.name for zone in brought.zones()] == [zone.name for zone in site.zones()]
    assert brought.documents("mission") == site.documents("mission")


def test_the_nav2_export_is_without_the_zones_and_the_mask_beside_it(store: Store) -> None:
    add_nav2(
        store.sites,
        "hall",
        map_from_cells(occupied=accepted().occupied, known=accepted().known, spec=SPEC),
        pairs=None,
    )
    hall = store.sites.open("hall")
    hall.save_zone(store.site.zones()[0])
    files = parts_of(export_nav2(hall, MappingConfig()))
    plain, mask = (
        read(files[f"{name}.yaml"], files[f"{name}.pgm"], name) for name in ("map", "keepout_mask")
    )
    np.testing.assert_array_equal(plain.cells(State.OCCUPIED), accepted().occupied)
    closed = mask.cells(State.OCCUPIED)
    assert closed[SPEC.cell(1.0, 1.0)] and not closed[SPEC.cell(-2.0, -1.0)]
    beyond = dataclasses.replace(
        store.site.zones()[0], id="b", polygon=((40.0, 0.0), (41.0, 0.0), (41.0, 1.0))
    )
    hall.save_zone(beyond)
    files = parts_of(export_nav2(hall, MappingConfig()))
    mask = read(files["keepout_mask.yaml"], files["keepout_mask.pgm"], "keepout_mask")
    assert mask.cells(State.OCCUPIED)[mask.spec.cell(40.9, 0.2)]
    empty = store.sites.make("empty")
    with pytest.raises(NotKnown, match="no map yet"):
        export_nav2(empty, MappingConfig())


def test_a_map_of_another_grid_names_the_site_and_the_way_out(store: Store) -> None:
    other = GridSpec.centred(size_m=(8.0, 8.0), resolution_m=0.1)
    with pytest.raises(BadConfiguration, match=r"'default'.*--site NAME"):
        map_of(store.site, PointMap(other, MappingConfig()).state())
