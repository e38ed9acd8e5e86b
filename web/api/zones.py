"""Zones as GeoJSON, and what a draft would lead to."""

from __future__ import annotations

import math

from fastapi import APIRouter, Response

from navcore.errors import NotKnown, Outdated
from navcore.path import NoPath
from navcore.zones import Zone
from web.api.answers import track, zone_of
from web.api.versions import ExpectedVersion, etag, outdated
from web.port import Operations, PathPreview
from web.problems import RESPONSES, JsonResponse
from web.replies import PreviewOut, ZoneOut, ZonesOut
from web.schemas import PreviewIn, ZoneIn

_BY_STATUS = {status: {status: RESPONSES[status]} for status in RESPONSES}
_EDITS = {**_BY_STATUS[404], **_BY_STATUS[409], **_BY_STATUS[422], **_BY_STATUS[503]}


def zones_router(operations: Operations) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["zones"], default_response_class=JsonResponse)

    def find(zone_id: str) -> Zone:
        for zone in operations.zones():
            if zone.id == zone_id:
                return zone
        raise NotKnown("no zone has this id")

    def conflict(zone_id: str, given: int | None) -> Response:
        zone = find(zone_id)
        return outdated(f"zone {zone.name!r}", given, zone_of(zone).model_dump(), zone.version)

    @router.get("/zones", response_model=ZonesOut)
    def list_zones() -> ZonesOut:
        """All stored zones as a GeoJSON FeatureCollection, in metres of the map frame."""
        return ZonesOut(features=[zone_of(zone) for zone in operations.zones()])

    @router.post("/zones", status_code=201, response_model=ZoneOut, responses={**_BY_STATUS[422], **_BY_STATUS[503]})
    def add_zone(zone: ZoneIn, response: Response) -> ZoneOut:
        """Store a zone, given as a GeoJSON Feature or as a bare geometry with a name; it binds the robot at once."""
        stored = operations.add_zone(zone.draft())
        response.headers.update({**etag(stored.version), "Location": f"/api/v1/zones/{stored.id}"})
        return zone_of(stored)

    @router.get("/zones/{zone_id}", response_model=ZoneOut, responses=_BY_STATUS[404])
    def get_zone(zone_id: str, response: Response) -> ZoneOut:
        """One zone; its ETag is its version."""
        zone = find(zone_id)
        response.headers.update(etag(zone.version))
        return zone_of(zone)

    @router.put("/zones/{zone_id}", response_model=ZoneOut, responses=_EDITS)
    def replace_zone(zone_id: str, zone: ZoneIn, response: Response, expected: ExpectedVersion) -> ZoneOut | Response:
        """Change a zone. With `If-Match`, an edit of a version that somebody else has changed is refused."""
        find(zone_id)
        try:
            stored = operations.replace_zone(zone_id, zone.draft(), expected_version=expected)
        except Outdated:
            return conflict(zone_id, expected)
        response.headers.update(etag(stored.version))
        return zone_of(stored)

    @router.delete("/zones/{zone_id}", status_code=204, responses=_EDITS)
    def delete_zone(zone_id: str, expected: ExpectedVersion) -> Response:
        """Forget a zone."""
        find(zone_id)
        try:
            operations.delete_zone(zone_id, expected_version=expected)
        except Outdated:
            return conflict(zone_id, expected)
        return Response(status_code=204)

    @router.post("/preview", response_model=PreviewOut, responses={**_BY_STATUS[409], **_BY_STATUS[422]})
    def preview(draft: PreviewIn) -> PreviewOut:
        """The path from here if the draft zone stood or the draft goal were the present one; nothing is applied."""
        goal = None if draft.goal is None else (draft.goal.x_m, draft.goal.y_m)
        polygon = None if draft.polygon is None else tuple(draft.polygon)
        return _preview_of(operations.preview(goal=goal, polygon=polygon))

    return router


def _preview_of(preview: PathPreview) -> PreviewOut:
    reason = str(preview.outcome.reason) if isinstance(preview.outcome, NoPath) else None
    length = preview.length_m if preview.length_m is not None and math.isfinite(preview.length_m) else None
    return PreviewOut(found=reason is None, reason=reason, length_m=length, path=track(preview.points))
