"""`bewarenav site`: the sites of a data folder.

The console may be running; it alone renames and deletes then, in the page or by the API. One of an
earlier version may not: its data folder would be converted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.options import check_data_folder, finite_point
from navcore.errors import BadConfiguration

if TYPE_CHECKING:
    from app.storage.sites import SiteTable
    from web.interface.sites import PointPair

site_cli = typer.Typer(
    help="Sites: named places with map, zones, missions and beware list.", no_args_is_help=True
)
DataOption = Annotated[
    Path, typer.Option("--data", metavar="DIR", help="The console's data folder.")
]
NameArgument = Annotated[str, typer.Argument(metavar="NAME", help="Name of the site.")]
NewNameArgument = Annotated[str, typer.Argument(metavar="NEW", help="Name of the new site.")]
FileArgument = Annotated[Path, typer.Argument(metavar="FILE.zip", help="Site archive.")]
RemoveOption = Annotated[bool, typer.Option("--remove", help="Remove it.")]
PairOption = Annotated[
    list[str] | None,
    typer.Option(
        "--point",
        metavar="X,Y=X,Y",
        help="A point of the map's frame and the same point at the site, in metres; give two.",
    ),
]


@site_cli.command("list")
def list_sites(data: DataOption = Path("data")) -> None:
    """Print the sites; `*` marks the one that was chosen last."""
    from app.console.site.site_files import listed

    with _sites(data) as sites:
        newest = max(sites.all(), key=lambda row: row.chosen, default=None)
        for site in listed(sites, "" if newest is None else newest.id):
            typer.echo(
                f"{'*' if site.chosen else ' '} {site.name:40} {site.zones:4} zones "
                f"{site.missions:4} missions {site.map_bytes / 1e6:8.1f} MB map"
                f"{', accepted' if site.accepted else ''}"
            )


@site_cli.command("new")
def new(name: NameArgument, data: DataOption = Path("data")) -> None:
    """Make an empty site."""
    _check_name(name)
    with _sites(data, makes=True) as sites:
        sites.make(name)
    typer.echo(f"Site {name} is made; use it with `console --site`.")


@site_cli.command("rename")
def rename(name: NameArgument, new_name: NewNameArgument, data: DataOption = Path("data")) -> None:
    """Rename a site; not while a console uses the data folder."""
    with _locked(data) as sites:
        sites.rename(name, new_name)
    typer.echo(f"{name} is called {new_name} now.")


@site_cli.command("copy")
def copy(name: NameArgument, new_name: NewNameArgument, data: DataOption = Path("data")) -> None:
    """Copy a site with everything in it."""
    with _sites(data) as sites:
        sites.copy(name, new_name)
    typer.echo(f"{new_name} is a copy of {name}.")


@site_cli.command("delete")
def delete(name: NameArgument, data: DataOption = Path("data")) -> None:
    """Delete a site with its map, zones and missions; not while a console uses the data folder."""
    with _locked(data) as sites:
        sites.delete(name)
    typer.echo(f"Site {name} is deleted.")


@site_cli.command("export")
def export(name: NameArgument, file: FileArgument, data: DataOption = Path("data")) -> None:
    """Write a site to an archive."""
    from app.console.site.site_archive import pack
    from navcore.files import write_whole

    with _sites(data) as sites:
        write_whole(file, pack(sites.open(name)))
    typer.echo(f"Site {name} is in {file}.")


@site_cli.command("import")
def import_site(name: NameArgument, file: FileArgument, data: DataOption = Path("data")) -> None:
    """Make a site of an archive."""
    from app.console.site.site_files import add
    from navcore.files import read_whole
    from web.interface.sites import MAX_ARCHIVE_BYTES

    _check_name(name)
    archive = read_whole(file, at_most=MAX_ARCHIVE_BYTES)
    with _sites(data, makes=True) as sites:
        add(sites, name, archive)
    typer.echo(f"Site {name} is made of {file}.")


@site_cli.command("export-nav2")
def export_nav2(
    name: NameArgument,
    file: Annotated[Path, typer.Argument(metavar="FILE.zip", help="Zip of Nav2 files.")],
    data: DataOption = Path("data"),
) -> None:
    """Write the map of a site, without the zones, and the keep-out mask as Nav2 files."""
    from app.console.site.site_files import export_nav2
    from navcore.config.mapping import MappingConfig
    from navcore.files import write_whole

    with _sites(data) as sites:
        write_whole(file, export_nav2(sites.open(name), MappingConfig()))
    typer.echo(f"The map of site {name} is in {file}.")


@site_cli.command("dock")
def dock(
    name: NameArgument,
    at: Annotated[
        str | None,
        typer.Option(metavar="X,Y,DEG", help="Pose of the robot in it: metres, and its heading."),
    ] = None,
    remove: RemoveOption = False,
    data: DataOption = Path("data"),
) -> None:
    """Set or remove the dock of a site; a running console takes it at its next start."""
    from app.console.site.dock_and_tags import furnish, stored_tags
    from navcore.geometry.transform import Pose2, wrap_angle
    from web.interface.sites import FAR_M

    pose = None
    if (numbers := _pose(at, remove, "X,Y,DEG")) is not None:
        x_m, y_m, degrees = numbers
        if max(abs(x_m), abs(y_m)) > FAR_M:
            raise BadConfiguration(f"--at: expected X and Y within ±{FAR_M:.0f} m, got {at!r:.60}")
        pose = Pose2(x_m=x_m, y_m=y_m, yaw_rad=wrap_angle(math.radians(degrees)))
    # As they are stored now: a running console changes them, too.
    with _sites(data) as sites, sites.renaming(name, None) as site:
        furnish(site, pose, stored_tags(site))
    typer.echo(f"The dock of site {name} is {'removed' if remove else 'set'}.")


@site_cli.command("tag")
def tag(
    name: NameArgument,
    number: Annotated[int, typer.Argument(metavar="NUMBER", help="Number in the family 36h11.")],
    at: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z,DEG",
            help="Middle of the tag and its height in metres, and the direction it faces.",
        ),
    ] = None,
    size: Annotated[float, typer.Option(help="Side of its black square, metres.")] = 0.3,
    remove: RemoveOption = False,
    data: DataOption = Path("data"),
) -> None:
    """Set or remove a tag of a site; a running console takes it at its next start."""
    from app.console.site.dock_and_tags import (
        dock_of,
        furnish,
        stored_tags,
        with_tag,
        without_tag,
    )
    from navcore.geometry.transform import wrap_angle
    from navcore.toml_config import from_table
    from web.interface.sites import Tag

    with _sites(data) as sites, sites.renaming(name, None) as site:
        tags = stored_tags(site)
        if (numbers := _pose(at, remove, "X,Y,Z,DEG")) is not None:
            x_m, y_m, z_m, degrees = numbers
            made = {"id": number, "x_m": x_m, "y_m": y_m, "z_m": z_m, "size_m": size}
            made["yaw_rad"] = wrap_angle(math.radians(degrees))
            changed = with_tag(tags, from_table(Tag, made, f"tag {number}"))
        elif (changed := without_tag(tags, number)) == tags:
            raise BadConfiguration(f"site {name} has no tag {number}")
        furnish(site, dock_of(site), changed)
    typer.echo(f"Tag {number} of site {name} is {'removed' if remove else 'set'}.")


@site_cli.command("import-nav2")
def import_nav2(
    name: NameArgument,
    map_file: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="Nav2 map.")],
    point: PairOption = None,
    data: DataOption = Path("data"),
) -> None:
    """Make a site of a Nav2 map; without points its frame is that of the site."""
    from app.console.site.site_files import add_nav2
    from navcore.formats import nav2_map

    _check_name(name)
    loaded, pairs = nav2_map.load(map_file), _pairs(point or [])
    with _sites(data, makes=True) as sites:
        add_nav2(sites, name, loaded, pairs=pairs)
    typer.echo(f"Site {name} is made of {map_file}.")


def _check_name(name: str) -> None:
    """Refuse a name that is not allowed before a data folder is made for it."""
    from app.storage.sites import checked_name

    checked_name(name)


def _pose(at: str | None, remove: bool, form: str) -> list[float] | None:
    """Return the numbers of `--at`, None for `--remove`; raises `BadConfiguration`."""
    if (at is None) is not remove:
        raise BadConfiguration(f"give either --at {form} or --remove")
    if at is None:
        return None
    try:
        numbers = [float(part) for part in at.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != form.count(",") + 1 or not all(map(math.isfinite, numbers)):
        raise BadConfiguration(f"--at: expected {form}, got {at!r:.60}")
    return numbers


def _pairs(texts: list[str]) -> tuple[PointPair, PointPair] | None:
    if not texts:
        return None
    if len(texts) != 2 or any(text.count("=") != 1 for text in texts):
        raise BadConfiguration(
            "--point: expected two, each X,Y on the map = X,Y at the site, "
            "e.g. --point 0,0=3.5,-2 --point 8,0=3.5,6"
        )
    (a, c), (b, d) = (
        tuple(finite_point(part, "--point") for part in text.split("=")) for text in texts
    )
    return (a, b), (c, d)


@contextmanager
def _sites(data: Path, *, makes: bool = False) -> Iterator[SiteTable]:
    """Open the sites of a data folder; `makes`: also of a new one."""
    from app.storage.sites import site_table

    check_data_folder(data, makes=makes)
    with site_table(data) as sites:
        yield sites


@contextmanager
def _locked(data: Path) -> Iterator[SiteTable]:
    """Open the sites of a data folder that no console uses."""
    from contextlib import closing

    from app.storage import Store

    check_data_folder(data)
    with closing(Store(data)) as store:
        yield store.sites
