"""Routes of the captured frames and their annotation."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from fastapi import APIRouter, Path, Request, Response

from navcore.errors import NotKnown, Outdated
from web.api.archive import Archive
from web.api.router import api_router
from web.gateway.etag import ExpectedVersion, etag, outdated
from web.gateway.problems import refusals
from web.gateway.request_body import body_file
from web.interface.operations import RobotService
from web.interface.teaching import Annotation, CapturedFrame
from web.schemas.teaching import (
    AddedOut,
    AnnotationIn,
    AnnotationOut,
    CaptureOut,
    CapturingIn,
    FramesOut,
    RegionIn,
    StoredAnnotationOut,
)

FrameId = Annotated[str, Path(pattern=r"^[0-9]{1,12}$")]
_REFUSALS = refusals(409, 422, 503)
_OF_ONE = refusals(404, 409, 422, 503)
REGION = "region"
"""Class name of the pixels of a grown region."""


def teach_frames_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("teach")

    def find(frame_id: str) -> CapturedFrame:
        for frame in operations.teaching.frames.all():
            if frame.id == frame_id:
                return frame
        raise NotKnown("no captured frame has this name")

    @router.get("/teach/frames", response_model=FramesOut)
    def get_frames() -> FramesOut:
        """Return the captured frames and what the folder holds."""
        frames = operations.teaching.frames
        return FramesOut(folder=frames.state(), frames=list(frames.all()))

    @router.post("/teach/frames", response_model=CaptureOut, responses=_REFUSALS)
    def capture() -> CaptureOut:
        """Store the newest frame of the camera: colours, depth, intrinsics and pose. A
        near-duplicate of a stored one, by pose and image, is dropped."""
        return CaptureOut(frame=operations.teaching.frames.capture())

    @router.put("/teach/capturing", status_code=204, response_class=Response, responses=_REFUSALS)
    def capture_while_driving(body: CapturingIn) -> None:
        """Set whether frames are captured while the robot moves."""
        operations.teaching.frames.capture_while_driving(body.on)

    @router.get("/teach/frames.zip", response_class=Response, responses=_REFUSALS)
    def export_frames() -> Response:
        """Return all frames as a zip archive of a data set, with the annotated classes alone and
        everything in the split `train`. Operators only, one at a time."""
        return Archive(operations.teaching.frames.export(), "frames.zip")

    @router.post("/teach/frames.zip", response_model=AddedOut, responses=_REFUSALS)
    def add_frames(request: Request) -> AddedOut:
        """Add the frames of such an archive, the body of the request: all or none."""
        return AddedOut(added=operations.teaching.frames.add_archive(body_file(request)))

    @router.get("/teach/frames/{frame_id}.png", response_class=Response, responses=_OF_ONE)
    def get_picture(frame_id: FrameId) -> Response:
        """Return the colours of a frame."""
        return Response(operations.teaching.frames.picture(frame_id), media_type="image/png")

    @router.delete(
        "/teach/frames/{frame_id}", status_code=204, response_class=Response, responses=_OF_ONE
    )
    def delete_frame(frame_id: FrameId) -> None:
        """Delete a frame and its annotation."""
        operations.teaching.frames.delete(frame_id)

    @router.get(
        "/teach/frames/{frame_id}/labels", response_model=StoredAnnotationOut, responses=_OF_ONE
    )
    def get_labels(frame_id: FrameId, response: Response) -> StoredAnnotationOut:
        """Return the annotation of a frame; its ETag is its version."""
        stored = operations.teaching.frames.annotation(frame_id)
        response.headers.update(etag(stored.version))
        return StoredAnnotationOut.of(stored)

    @router.put("/teach/frames/{frame_id}/labels", response_model=CapturedFrame, responses=_OF_ONE)
    def put_labels(
        frame_id: FrameId, body: AnnotationIn, response: Response, expected: ExpectedVersion
    ) -> CapturedFrame | Response:
        """Replace the annotation of a frame. The classes that are marked must be on the beware
        list, or `background`: what is none of them. With `If-Match`, an edit of an outdated
        version is refused."""
        frame, frames = find(frame_id), operations.teaching.frames
        annotation = body.annotation(frame.height, frame.width)
        try:
            marked = frames.annotate(frame_id, annotation, expected_version=expected)
        except Outdated:
            stored = frames.annotation(frame_id)
            shown = StoredAnnotationOut.of(stored).model_dump(mode="json")
            return outdated("the annotation", expected, shown, stored.version)
        response.headers.update(etag(marked.version))
        return marked

    @router.post("/teach/frames/{frame_id}/region", response_model=AnnotationOut, responses=_OF_ONE)
    def grow_region(frame_id: FrameId, body: RegionIn) -> AnnotationOut:
        """Return the connected pixels of like colour around a pixel, without a step of depth
        between them, as label 1; nothing is stored."""
        found = operations.teaching.frames.region(frame_id, body.row, body.col, body.tolerance)
        return AnnotationOut.of(Annotation(class_names=(REGION,), labels=found.astype(np.uint8)))

    return router
