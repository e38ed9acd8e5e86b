"""Routes of the detected objects and their images; corrections become training data."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response

from navcore.errors import StorageFailed
from web.api.router import api_router
from web.gateway.problems import refusals
from web.interface.insight import LabellingState
from web.interface.operations import RobotService
from web.interface.wire import values_of
from web.schemas.insight import MissedObjectIn, SightingOut, SightingsOut, SnapshotOut, WrongIn

SightingId = Annotated[int, Path(ge=0, le=2**53)]
_REFUSALS = refusals(404, 409, 422, 503)


def sightings_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("understand")

    @router.get("/sightings", response_model=SightingsOut)
    def get_sightings() -> SightingsOut:
        """Return the detected objects of the beware list, newest first, and their number by
        class."""
        insight, now_s = operations.insight, operations.state().stamp_s
        labelling, failure = None, None
        try:
            labelling = insight.labelling.state()
        except StorageFailed as error:  # the detections are shown without it
            failure = str(error)
        return SightingsOut(
            seen={str(class_id): n for class_id, n in insight.detections.counts().items()},
            sightings=[
                SightingOut(**values_of(one), age_s=max(now_s - one.last_s, 0.0))
                for one in insight.detections.all()
            ],
            labelling=labelling,
            labelling_failure=failure,
        )

    @router.get(
        "/sightings/{sighting_id}/picture.jpg", response_class=Response, responses=refusals(404)
    )
    def get_picture(sighting_id: SightingId) -> Response:
        """Return the object's best view, cut out of the camera image."""
        return Response(operations.insight.detections.crop(sighting_id), media_type="image/jpeg")

    @router.post(
        "/sightings/{sighting_id}/wrong", response_model=LabellingState, responses=_REFUSALS
    )
    def call_wrong(sighting_id: SightingId, body: WrongIn) -> LabellingState:
        """Mark a detection as wrong; its frame is added to the labelling folder, corrected."""
        return operations.insight.mark_wrong(sighting_id, body.class_name)

    @router.post("/sightings", status_code=201, response_model=LabellingState, responses=_REFUSALS)
    def add_example(body: MissedObjectIn) -> LabellingState:
        """Add a held image to the labelling folder, with the object in the box as an example of a
        class."""
        return operations.insight.add_example(body.snapshot, body.class_name, body.box)

    @router.post(
        "/sightings/snapshots", status_code=201, response_model=SnapshotOut, responses=refusals(409)
    )
    def take_snapshot() -> SnapshotOut:
        """Hold the present image, so that a box drawn on it refers to it. Only the newest few are
        held."""
        return SnapshotOut(snapshot=operations.insight.snapshot())

    @router.get(
        "/sightings/snapshots/{snapshot}.jpg", response_class=Response, responses=refusals(404)
    )
    def get_snapshot(snapshot: SightingId) -> Response:
        """Return a held image."""
        return Response(operations.insight.snapshot_image(snapshot), media_type="image/jpeg")

    return router
