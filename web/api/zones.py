"""Zones as GeoJSON: read, drawn, changed, deleted; taken back and done again; kept in named sets."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response

from navcore.errors import NotKnown, Outdated
from navcore.mission.zone import Zone
from web.gateway.etag import ExpectedVersion, etag, outdated
from web.gateway.problems import RESPONSES, JsonResponse
from web.interface.operations import RobotService
from web.schemas.convert import zone_of, zones_of
from web.schemas.fields import Name
from web.schemas.responses import ZoneOut, ZoneSetOut, ZonesOut
from web.schemas.zones import ZoneIn

_BY_STATUS = {status: {status: RESPONSES[status]} for status in RESPONSES}
SetName = Annotated[Name, Path()]
_EDITS = {**_BY_STATUS[404], **_BY_STATUS[409], **_BY_STATUS[422], **_BY_STATUS[503]}


def zones_router(operations: RobotService) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["zones"], default_response_class=JsonResponse)

    def find(zone_id: str) -> Zone:
        for zone in operations.zones.stored:
            if zone.id == zone_id:
                return zone
        raise NotKnown("no zone has this id")

    def conflict(zone_id: str, given: int | None) -> Response:
        zone = find(zone_id)
        return outdated(f"zone {zone.name!r}", given, zone_of(zone).model_dump(), zone.version)

    @router.get("/zones", response_model=ZonesOut)
    def list_zones() -> ZonesOut:
        """All stored zones as a GeoJSON FeatureCollection, in metres of the map frame."""
        return zones_of(operations)

    @router.post(
        "/zones",
        status_code=201,
        response_model=ZoneOut,
        responses={**_BY_STATUS[422], **_BY_STATUS[503]},
    )
    def add_zone(zone: ZoneIn, response: Response) -> ZoneOut:
        """Store a zone, given as a GeoJSON Feature or as a bare geometry with a name; it binds the
        robot at once.

        The geometry is a Polygon, a Point with `radius_m`, or a LineString with `width_m`.
        """
        stored = operations.zones.add(zone.draft())
        response.headers.update({**etag(stored.version), "Location": f"/api/v1/zones/{stored.id}"})
        return zone_of(stored)

    @router.get("/zones/{zone_id}", response_model=ZoneOut, responses=_BY_STATUS[404])
    def get_zone(zone_id: str, response: Response) -> ZoneOut:
        """One zone; its ETag is its version."""
        zone = find(zone_id)
        response.headers.update(etag(zone.version))
        return zone_of(zone)

    @router.put("/zones/{zone_id}", response_model=ZoneOut, responses=_EDITS)
    def replace_zone(
        zone_id: str, zone: ZoneIn, response: Response, expected: ExpectedVersion
    ) -> ZoneOut | Response:
        """Change a zone. With `If-Match`, an edit of a version that somebody else has changed is
        refused."""
        find(zone_id)
        try:
            stored = operations.zones.replace(zone_id, zone.draft(), expected_version=expected)
        except Outdated:
            return conflict(zone_id, expected)
        response.headers.update(etag(stored.version))
        return zone_of(stored)

    @router.delete("/zones/{zone_id}", status_code=204, responses=_EDITS)
    def delete_zone(zone_id: str, expected: ExpectedVersion) -> Response:
        """Forget a zone."""
        find(zone_id)
        try:
            operations.zones.delete(zone_id, expected_version=expected)
        except Outdated:
            return conflict(zone_id, expected)
        return Response(status_code=204)

    @router.post(
        "/zones/undo", response_model=ZonesOut, responses={**_BY_STATUS[409], **_BY_STATUS[503]}
    )
    def undo() -> ZonesOut:
        """Take the newest edit of the zones back, whoever made it."""
        operations.zones.undo()
        return zones_of(operations)

    @router.post(
        "/zones/redo", response_model=ZonesOut, responses={**_BY_STATUS[409], **_BY_STATUS[503]}
    )
    def redo() -> ZonesOut:
        """Do again what was taken back last."""
        operations.zones.redo()
        return zones_of(operations)

    @router.get("/zone-sets")
    def list_sets() -> list[ZoneSetOut]:
        """Zones that are kept under a name, e.g. for the night."""
        return [
            ZoneSetOut(name=name, zones=len(zones))
            for name, zones in operations.zones.sets().items()
        ]

    @router.put(
        "/zone-sets/{name:path}",
        status_code=204,
        responses={**_BY_STATUS[409], **_BY_STATUS[422], **_BY_STATUS[503]},
    )
    def save_set(name: SetName) -> Response:
        """Keep the present zones under a name."""
        operations.zones.save_set(name)
        return Response(status_code=204)

    @router.post(
        "/zone-sets/{name:path}/use",
        response_model=ZonesOut,
        responses={**_BY_STATUS[404], **_BY_STATUS[503]},
    )
    def use_set(name: SetName) -> ZonesOut:
        """Let a set's zones bind the robot in the place of the present ones, as one edit that can
        be taken back."""
        operations.zones.use_set(name)
        return zones_of(operations)

    @router.delete(
        "/zone-sets/{name:path}", status_code=204, responses={**_BY_STATUS[404], **_BY_STATUS[503]}
    )
    def delete_set(name: SetName) -> Response:
        """Forget a set; the present zones stay."""
        operations.zones.delete_set(name)
        return Response(status_code=204)

    return router
