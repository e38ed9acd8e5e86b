"""What was recognised, with its pictures; "wrong" and "add" collect what the next training learns
from."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Path, Response

from web.gateway.problems import RESPONSES, JsonResponse
from web.interface.operations import RobotService
from web.schemas.insight import (
    ExampleIn,
    LabellingOut,
    SightingOut,
    SightingsOut,
    SnapshotOut,
    WrongIn,
)

SightingId = Annotated[int, Path(ge=0, le=2**53)]
_REFUSALS: dict[int | str, dict[str, Any]] = {
    status: RESPONSES[status] for status in (404, 409, 422, 503)
}


def sightings_router(operations: RobotService) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["understand"], default_response_class=JsonResponse)

    @router.get("/sightings", response_model=SightingsOut)
    def get_sightings() -> SightingsOut:
        """Everything of the beware list that was recognised, newest first, and how many of each
        class."""
        insight, now_s = operations.insight, operations.state().stamp_s
        sightings = [
            SightingOut(**asdict(one), age_s=max(now_s - one.last_s, 0.0))
            for one in insight.detections.all()
        ]
        seen = {str(class_id): count for class_id, count in insight.detections.counts().items()}
        return SightingsOut(
            seen=seen,
            sightings=sightings,
            labelling=LabellingOut(**asdict(insight.labelling.state())),
        )

    @router.get(
        "/sightings/{sighting_id}/picture.jpg",
        response_class=Response,
        responses={404: RESPONSES[404]},
    )
    def get_picture(sighting_id: SightingId) -> Response:
        """Its best view, cut out of the camera's picture."""
        return Response(operations.insight.detections.crop(sighting_id), media_type="image/jpeg")

    @router.post("/sightings/{sighting_id}/wrong", response_model=LabellingOut, responses=_REFUSALS)
    def call_wrong(sighting_id: SightingId, body: WrongIn) -> LabellingOut:
        """It is something else, or nothing of the list: its frame goes into the labelling folder,
        corrected."""
        return LabellingOut(**asdict(operations.insight.mark_wrong(sighting_id, body.class_name)))

    @router.post("/sightings", status_code=201, response_model=LabellingOut, responses=_REFUSALS)
    def add_example(body: ExampleIn) -> LabellingOut:
        """Something in a held picture was missed: what stands out in the box goes into the
        labelling folder as that class."""
        return LabellingOut(
            **asdict(operations.insight.add_example(body.snapshot, body.class_name, body.box))
        )

    @router.post(
        "/sightings/snapshots",
        status_code=201,
        response_model=SnapshotOut,
        responses={409: RESPONSES[409]},
    )
    def take_snapshot() -> SnapshotOut:
        """Hold the present picture, so that a box on it means the same to the robot as to the
        operator. Only a few are held."""
        return SnapshotOut(snapshot=operations.insight.snapshot())

    @router.get(
        "/sightings/snapshots/{snapshot}.jpg",
        response_class=Response,
        responses={404: RESPONSES[404]},
    )
    def get_snapshot(snapshot: SightingId) -> Response:
        """A held picture."""
        return Response(operations.insight.snapshot_image(snapshot), media_type="image/jpeg")

    return router
