"""Routes of the zones as GeoJSON: read, add, change, delete, undo, redo, named sets."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Response

from navcore.errors import NotKnown, Outdated
from navcore.mission.zone import Zone
from web.api.router import api_router
from web.gateway.etag import ExpectedVersion, etag, outdated
from web.gateway.problems import refusals
from web.interface.operations import RobotService
from web.schemas.fields import Name, NewName
from web.schemas.zones import ZoneIn, ZoneOut, ZoneSetOut, ZonesOut

SetName = Annotated[Name, Path()]
_EDITS = refusals(404, 409, 422, 503)


def zones_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("zones")

    def all_zones() -> ZonesOut:
        return ZonesOut.of(operations.zones.stored, operations.zones.history)

    def find(zone_id: str) -> Zone:
        for zone in operations.zones.stored:
            if zone.id == zone_id:
                return zone
        raise NotKnown("no zone has this id")

    def conflict(zone_id: str, given: int | None) -> Response:
        zone = find(zone_id)
        return outdated(
            f"zone {zone.name!r}", given, ZoneOut.of(zone).model_dump(mode="json"), zone.version
        )

    @router.get("/zones", response_model=ZonesOut)
    def list_zones() -> ZonesOut:
        """Return all stored zones as a GeoJSON FeatureCollection, in metres of the map frame."""
        return all_zones()

    @router.post(
        "/zones",
        status_code=201,
        response_model=ZoneOut,
        responses=refusals(422, 503),
    )
    def add_zone(zone: ZoneIn, response: Response) -> ZoneOut:
        """Store a zone, given as a GeoJSON Feature or as a bare geometry with a name; it applies at
        once.

        The geometry is a Polygon, a Point with `radius_m`, or a LineString with `width_m`.
        """
        stored = operations.zones.add(zone.draft())
        response.headers.update({**etag(stored.version), "Location": f"/api/v1/zones/{stored.id}"})
        return ZoneOut.of(stored)

    @router.get("/zones/{zone_id}", response_model=ZoneOut, responses=refusals(404))
    def get_zone(zone_id: str, response: Response) -> ZoneOut:
        """Return one zone; its ETag is its version."""
        zone = find(zone_id)
        response.headers.update(etag(zone.version))
        return ZoneOut.of(zone)

    @router.put("/zones/{zone_id}", response_model=ZoneOut, responses=_EDITS)
    def replace_zone(
        zone_id: str, zone: ZoneIn, response: Response, expected: ExpectedVersion
    ) -> ZoneOut | Response:
        """Change a zone. With `If-Match`, an edit of an outdated version is refused."""
        find(zone_id)
        try:
            stored = operations.zones.replace(zone_id, zone.draft(), expected_version=expected)
        except Outdated:
            return conflict(zone_id, expected)
        response.headers.update(etag(stored.version))
        return ZoneOut.of(stored)

    @router.delete("/zones/{zone_id}", status_code=204, responses=_EDITS)
    def delete_zone(zone_id: str, expected: ExpectedVersion) -> Response:
        """Delete a zone."""
        find(zone_id)
        try:
            operations.zones.delete(zone_id, expected_version=expected)
        except Outdated:
            return conflict(zone_id, expected)
        return Response(status_code=204)

    @router.post("/zones/undo", response_model=ZonesOut, responses=refusals(409, 503))
    def undo() -> ZonesOut:
        """Undo the newest edit of the zones by any operator."""
        operations.zones.undo()
        return all_zones()

    @router.post("/zones/redo", response_model=ZonesOut, responses=refusals(409, 503))
    def redo() -> ZonesOut:
        """Repeat the edit that was undone last."""
        operations.zones.redo()
        return all_zones()

    @router.get("/zone-sets")
    def list_sets() -> list[ZoneSetOut]:
        """Return the named sets of zones, for example for the night."""
        return [
            ZoneSetOut(name=name, zones=len(zones))
            for name, zones in operations.zones.sets().items()
        ]

    @router.put(
        "/zone-sets/{name:path}",
        status_code=204,
        responses=refusals(409, 422, 503),
    )
    def save_set(
        name: Annotated[NewName, Path()],
        replace: Annotated[bool, Query(description="Replace a set of that name.")] = False,
    ) -> Response:
        """Save the present zones under a name; refused with 409 where a set has it, unless
        `replace` is true."""
        operations.zones.save_set(name, replace=replace)
        return Response(status_code=204)

    @router.post(
        "/zone-sets/{name:path}/use",
        response_model=ZonesOut,
        responses=refusals(404, 503),
    )
    def use_set(name: SetName) -> ZonesOut:
        """Replace the present zones by those of a set, as one edit that can be undone."""
        operations.zones.use_set(name)
        return all_zones()

    @router.delete("/zone-sets/{name:path}", status_code=204, responses=refusals(404, 503))
    def delete_set(name: SetName) -> Response:
        """Delete a set; the present zones stay."""
        operations.zones.delete_set(name)
        return Response(status_code=204)

    return router
