"""Routes of the sites: list, make, choose, rename, copy, delete, files, and changes of the map."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

from navcore.errors import NotKnown
from web.api.archive import Archive
from web.api.router import api_router
from web.gateway.problems import refusals
from web.interface.operations import RobotService
from web.interface.single_file import SingleFile
from web.interface.sites import SITE_NAME, MapChanges, SeenTag, Site, is_same_name
from web.schemas.sites import AcceptIn, Nav2ImportIn, SiteChangesIn, SiteIn, SitesOut, TagIn

SiteName = Annotated[str, Path(pattern=SITE_NAME)]
_EDITS = refusals(404, 409, 422, 503)


def sites_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("sites")
    # One at a time: the computer of a robot may lack the memory for more.
    exports = SingleFile("a site is being exported already; wait until that has ended")

    def archive(pack: Callable[[], bytes], name: str) -> Response:
        return Archive(exports.open(lambda: io.BytesIO(pack())), name)

    def find(name: str) -> Site:
        for site in sorted(operations.sites.all(), key=lambda site: site.name != name):
            if is_same_name(site.name, name):
                return site
        raise NotKnown("no site has this name")

    @router.get("/sites", response_model=SitesOut)
    def list_sites() -> SitesOut:
        """Return all sites, and which one the robot is at."""
        return SitesOut(chosen=operations.sites.chosen, sites=operations.sites.all())

    @router.post("/sites", status_code=201, response_model=Site, responses=_EDITS)
    def make_site(body: SiteIn) -> Site:
        """Make an empty site."""
        return operations.sites.make(body.name)

    @router.post("/sites/import", status_code=201, response_model=Site, responses=_EDITS)
    async def import_site(request: Request, name: Annotated[str, Query(pattern=SITE_NAME)]) -> Site:
        """Make a site of an archive, the body of the request, which may have 64 MB."""
        archive = await request.body()
        return await asyncio.to_thread(operations.sites.add, name, archive)

    @router.post("/sites/import-nav2", status_code=201, response_model=Site, responses=_EDITS)
    def import_nav2(body: Nav2ImportIn) -> Site:
        """Make a site of a Nav2 map, placed by two points. Its obstacles count until the camera
        sees their floor free, and it is the accepted map."""
        pairs = None if body.alignment is None else body.alignment.pairs()
        return operations.sites.add_nav2(body.name, body.files(), pairs=pairs)

    @router.get("/sites/{name}", response_model=Site, responses=refusals(404))
    def get_site(name: SiteName) -> Site:
        """Return one site."""
        return find(name)

    @router.patch("/sites/{name}", response_model=Site, responses=_EDITS)
    def change_site(name: SiteName, changes: SiteChangesIn) -> Site:
        """Rename a site, or set its dock and its tags: all or nothing."""
        return operations.sites.change(find(name).name, changes.changes())

    @router.post("/sites/{name}/tags", response_model=Site, responses=_EDITS)
    def put_tag(name: SiteName, tag: TagIn) -> Site:
        """Add a tag to a site, or replace the one of its number."""
        return operations.sites.put_tag(find(name).name, tag)

    @router.delete("/sites/{name}/tags/{number}", response_model=Site, responses=_EDITS)
    def remove_tag(name: SiteName, number: Annotated[int, Path()]) -> Site:
        """Remove a tag of a site."""
        site = find(name)
        if all(tag.id != number for tag in site.tags):
            raise NotKnown(f"site {site.name!r} has no tag {number}")
        return operations.sites.remove_tag(site.name, number)

    @router.delete("/sites/{name}", status_code=204, responses=_EDITS)
    def delete_site(name: SiteName) -> Response:
        """Delete a site with its map, zones and missions; refused for the one in use."""
        operations.sites.delete(find(name).name)
        return Response(status_code=204)

    @router.post("/sites/{name}/choose", response_model=Site, responses=_EDITS)
    def choose_site(name: SiteName) -> Site:
        """Use a site: its map, zones, sets, missions and beware list. Refused unless the robot
        stands and no mission drives; its goals come back paused."""
        return operations.sites.choose(find(name).name)

    @router.post("/sites/{name}/copy", status_code=201, response_model=Site, responses=_EDITS)
    def copy_site(name: SiteName, body: SiteIn) -> Site:
        """Copy a site with everything in it under another name."""
        return operations.sites.copy(find(name).name, body.name)

    @router.get("/sites/{name}/export", response_class=Response, responses=_EDITS)
    def export_site(name: SiteName) -> Response:
        """Return a site as a zip archive for `sites/import`. Operators only, one at a time."""
        return archive(lambda: operations.sites.export(find(name).name), f"{name}.site.zip")

    @router.get("/sites/{name}/nav2", response_class=Response, responses=_EDITS)
    def export_nav2(name: SiteName) -> Response:
        """Return a zip of Nav2 files: `map.yaml` without the zones, `keepout_mask.yaml` beside it.
        Operators only, one archive at a time."""
        return archive(lambda: operations.sites.export_nav2(find(name).name), f"{name}.nav2.zip")

    @router.get("/tags/seen", response_model=list[SeenTag], responses=refusals(409))
    def seen_tags(
        size_m: Annotated[float, Query(ge=0.01, le=10, description="side of the black square")],
    ) -> tuple[SeenTag, ...]:
        """Return the markers in the newest image and where they are, to be added to the tags of the
        site. Refused while the robot does not know where it is."""
        return operations.sites.seen_tags(size_m)

    @router.get("/map/changes", response_model=MapChanges, responses=refusals(409))
    def get_changes() -> MapChanges:
        """Return the areas in which the map differs from the accepted one."""
        return operations.sites.changes()

    @router.post("/map/changes/accept", response_model=MapChanges, responses=_EDITS)
    def accept_changes(body: AcceptIn) -> MapChanges:
        """Take areas of a listing over into the accepted map, as they were listed, and return the
        remaining ones; without a listing the whole present map is accepted."""
        return operations.sites.accept(body.listing, body.areas)

    return router
