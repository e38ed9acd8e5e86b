"""`bewarenav site`: sites on the command line, while a console may run."""

from __future__ import annotations

import math
import threading
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.sites import site_cli
from app.console.site import dock_and_tags
from app.console.site.dock_and_tags import dock_of, furnish, stored_tags, with_tag
from app.console.site.site_map import accepted_map
from app.storage import Store, database
from app.storage.site_store import SiteStore
from app.storage.sites import site_table
from navcore.errors import BadConfiguration, BadGeometry, BewareNavError, NotKnown, StorageFailed
from navcore.formats.nav2_map import map_from_cells
from navcore.geometry.transform import Pose2
from navcore.grid.grid import GridSpec
from navcore.mission.zone import Zone
from tests.app.console.site.desk import Desk
from tests.navcore.formats.stored import save
from web.interface.sites import Tag

CORNERS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))


def site(data: Path, *arguments: str) -> str:
    """Run a command; return its output or raise its refusal."""
    result = CliRunner().invoke(site_cli, [*arguments, "--data", str(data)])
    if isinstance(result.exception, BewareNavError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def names(data: Path) -> list[str]:
    return [line[2:42].strip() for line in site(data, "list").splitlines()]


def test_a_site_is_made_copied_renamed_exported_imported_and_deleted(tmp_path: Path) -> None:
    data, archive = tmp_path / "data", tmp_path / "hall.zip"
    site(data, "new", "hall")
    with closing(Store(data)) as store:
        store.sites.open("hall").save_zone(Zone(id="a", name="wet", polygon=CORNERS))
    site(data, "copy", "hall", "Day 2")
    site(data, "rename", "Day 2", "Day 3")
    site(data, "export", "Day 3", str(archive))
    site(data, "import", "back", str(archive))
    site(data, "delete", "hall")
    assert names(data) == ["back", "Day 3"]
    assert "   1 zones" in site(data, "list").splitlines()[0]
    with pytest.raises(NotKnown, match="'hall'"):
        site(data, "export", "hall", str(archive))
    with pytest.raises(BadConfiguration, match="no such file"):
        site(data, "import", "other", str(tmp_path / "nothing.zip"))


def test_only_a_new_site_makes_a_new_data_folder(tmp_path: Path) -> None:
    mistyped = tmp_path / "dtaa"
    for command in (["list"], ["copy", "a", "b"], ["delete", "a"]):
        with pytest.raises(BadConfiguration, match="is no data folder of a console"):
            site(mistyped, *command)
    (tmp_path / "hall.zip").write_bytes(b"no archive")
    cells, spec = (
        np.zeros((2, 2), np.bool_),
        GridSpec(origin_x_m=0.0, origin_y_m=0.0, resolution_m=0.1, rows=2, cols=2),
    )
    save(map_from_cells(occupied=cells, known=~cells, spec=spec), tmp_path / "map.yaml")
    for command in (["new"], ["import", "hall.zip"], ["import-nav2", "map.yaml"]):
        with pytest.raises(BadConfiguration, match="site name 'bad/name'"):
            site(mistyped, command[0], "bad/name", *(str(tmp_path / file) for file in command[1:]))
    assert not mistyped.exists()
    site(mistyped, "new", "hall")
    assert names(mistyped) == ["hall"]


def test_a_running_console_alone_renames_and_deletes(tmp_path: Path) -> None:
    with closing(Store(tmp_path)) as console:
        with console.using(console.site, "office"):
            pass
        site(tmp_path, "new", "hall")
        assert site(tmp_path, "list").splitlines()[0].startswith("* default")
        for arguments in (("rename", "hall", "other"), ("delete", "hall")):
            with pytest.raises(StorageFailed, match="another console uses"):
                site(tmp_path, *arguments)
        assert [row.name for row in console.sites.all()] == ["default", "hall"]


def test_a_nav2_map_is_placed_by_two_points(tmp_path: Path) -> None:
    occupied = np.zeros((20, 40), dtype=np.bool_)
    occupied[10, :] = True
    spec = GridSpec(resolution_m=0.1, rows=20, cols=40, origin_x_m=0.0, origin_y_m=0.0)
    source = map_from_cells(occupied=occupied, known=np.ones_like(occupied), spec=spec)
    save(source, tmp_path / "hall.yaml")
    data, file = tmp_path / "data", str(tmp_path / "hall.yaml")
    site(data, "import-nav2", "plain", file)
    site(data, "import-nav2", "moved", file, "--point", "0,1.05=10,5", "--point", "3,1.05=10,8")
    with closing(Store(data)) as store:
        plain, moved = (accepted_map(store.sites.open(name)) for name in ("plain", "moved"))
    assert plain is not None and moved is not None
    np.testing.assert_array_equal(plain.occupied, occupied)
    assert moved.occupied[moved.spec.cell(10.0, 6.5)]
    with pytest.raises(BadGeometry, match="33 %"):
        site(data, "import-nav2", "bad", file, "--point", "0,0=0,0", "--point", "3,0=4,0")
    with pytest.raises(BadConfiguration, match="expected two"):
        site(data, "import-nav2", "bad", file, "--point", "0,0=0,0")
    far = (tmp_path / "hall.yaml").read_text().replace("[0.0, 0.0", "[5.0e5, 0.0")
    (tmp_path / "far.yaml").write_text(far)
    with pytest.raises(BadConfiguration, match="too far from the origin"):
        site(data, "import-nav2", "far", str(tmp_path / "far.yaml"))
    site(
        data,
        "import-nav2",
        "near",
        str(tmp_path / "far.yaml"),
        "--point",
        "5e5,0=0,0",
        "--point",
        "500003,0=3,0",
    )
    assert names(data) == ["moved", "near", "plain"]
    out = tmp_path / "nav2.zip"
    site(data, "export-nav2", "moved", str(out))
    assert out.read_bytes().startswith(b"PK")


def test_dock_and_tags_are_set_and_removed_and_bad_ones_are_refused_by_name(tmp_path: Path) -> None:
    data = tmp_path / "data"
    site(data, "new", "hall")
    site(data, "dock", "hall", "--at", "1.5,-2,90")
    site(data, "tag", "hall", "12", "--at", "4,0.5,0.6,180", "--size", "0.2")
    site(data, "tag", "hall", "7", "--at", "3,0.5,0.6,180")
    with site_table(data) as sites:
        stored = sites.open("hall")
        assert dock_of(stored) == Pose2(x_m=1.5, y_m=-2.0, yaw_rad=math.radians(90))
        assert [(tag.id, tag.x_m, tag.size_m) for tag in stored_tags(stored)] == [
            (7, 3.0, 0.3),
            (12, 4.0, 0.2),
        ]
    site(data, "dock", "hall", "--at", "1,2,90090")
    with site_table(data) as sites:
        turned = dock_of(sites.open("hall"))
        assert turned is not None and turned.yaw_rad == pytest.approx(math.radians(90))
    site(data, "dock", "hall", "--remove")
    site(data, "tag", "hall", "12", "--remove")
    with site_table(data) as sites:
        assert dock_of(sites.open("hall")) is None
        assert [tag.id for tag in stored_tags(sites.open("hall"))] == [7]
    for bad, said in (
        (("tag", "hall", "12", "--remove"), "no tag 12"),
        (("tag", "hall", "5", "--at", "1,2,3"), "expected X,Y,Z,DEG"),
        (("tag", "hall", "5", "--at", "1,2,3,4", "--size", "0"), "tag 5.size_m"),
        (("dock", "hall", "--at", "1,nan,3"), "expected X,Y,DEG"),
        (("tag", "hall", "587", "--at", "1,2,3,4"), "tag 587.id"),
        (("dock", "hall", "--at", "1e9,2,90"), "X and Y within ±1000000 m"),
        (("dock", "hall"), "either --at X,Y,DEG or --remove"),
    ):
        with pytest.raises(BadConfiguration, match=said):
            site(data, *bad)


@pytest.mark.parametrize("by", ["command", "console"])
def test_a_tag_that_another_process_sets_meanwhile_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, by: str
) -> None:
    monkeypatch.setattr(database, "BUSY_S", 30.0)
    data = tmp_path / "data"
    desk = Desk(data)
    seven, five = (
        Tag(id=number, x_m=1.0, y_m=0.0, z_m=1.0, yaw_rad=0.0, size_m=0.3) for number in (7, 5)
    )

    def set_seven() -> None:
        with site_table(data) as sites, sites.renaming("default", None) as stored:
            furnish(stored, None, with_tag(stored_tags(stored), seven))

    def read_before(stored: SiteStore) -> tuple[Tag, ...]:
        tags = stored_tags(stored)
        if other.ident is None:
            other.start()
            other.join(0.5)  # it waits, or stores at once
        return tags

    other = threading.Thread(target=set_seven)
    monkeypatch.setattr(dock_and_tags, "stored_tags", read_before)
    with closing(desk.store):
        if by == "command":
            site(data, "tag", "default", "5", "--at", "1,0,1,0")
        else:
            desk.sites.put_tag("default", five)
        other.join()
        assert [tag.id for tag in stored_tags(desk.store.site)] == [5, 7]
