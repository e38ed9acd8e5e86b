"""Routes of the operator's edits of the map: erase, reject a detection, undo, redo; and one undo
for all edits."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from web.api.beware.detections import SightingId
from web.api.router import api_router
from web.auth.roles import CurrentVisitor
from web.gateway.problems import refusals
from web.interface.operations import RobotService
from web.schemas.map.edits import EditDone, EditsOut, EraseIn, MapEditsOut, RejectAtIn, RejectIn


def map_edits_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("map and camera")

    def edits() -> MapEditsOut:
        return MapEditsOut.of(operations.map_edits)

    @router.get("/map/edits", response_model=MapEditsOut)
    def get_edits() -> MapEditsOut:
        """Return which edits of the map can be undone and redone, and what was rejected."""
        return edits()

    @router.post("/map/erase", response_model=MapEditsOut, responses=refusals(409, 422))
    def erase(body: EraseIn, visitor: CurrentVisitor) -> MapEditsOut:
        """Erase obstacles, points of the beware list or both from an area before the next tick.
        What the camera sees there later comes back."""
        operations.map_edits.erase(body.geometry.corners(), body.what, by=visitor.signature)
        return edits()

    @router.post(
        "/sightings/{sighting_id}/reject",
        response_model=MapEditsOut,
        responses=refusals(404, 409, 422),
    )
    def reject(sighting_id: SightingId, body: RejectIn, visitor: CurrentVisitor) -> MapEditsOut:
        """Reject a detection: what it occupies is free from the next tick on, and its class counts
        there only with a higher confidence. Kept with the map."""
        operations.map_edits.reject(
            sighting_id, all_of_class=body.all_of_class, by=visitor.signature
        )
        return edits()

    @router.post("/map/reject", response_model=MapEditsOut, responses=refusals(409, 422))
    def reject_at(body: RejectAtIn, visitor: CurrentVisitor) -> MapEditsOut:
        """Reject what the map holds of a class at a place, or with `all_of_class` anywhere: it is
        free from the next tick on, and the class counts there only with a higher confidence."""
        operations.map_edits.reject_at(
            body.class_id, body.at, all_of_class=body.all_of_class, by=visitor.signature
        )
        return edits()

    @router.delete(
        "/map/rejected/{rejection_id}", response_model=MapEditsOut, responses=refusals(404, 409)
    )
    def forget(rejection_id: SightingId, visitor: CurrentVisitor) -> MapEditsOut:
        """Forget a rejection: its class counts there as everywhere."""
        operations.map_edits.forget(rejection_id, by=visitor.signature)
        return edits()

    @router.post("/map/undo", response_model=MapEditsOut, responses=refusals(409))
    def undo(visitor: CurrentVisitor) -> MapEditsOut:
        """Undo the newest edit of the map by any operator since the start of the console."""
        operations.map_edits.undo(by=visitor.signature)
        return edits()

    @router.post("/map/redo", response_model=MapEditsOut, responses=refusals(409))
    def redo(visitor: CurrentVisitor) -> MapEditsOut:
        """Repeat the edit that was undone last."""
        operations.map_edits.redo(by=visitor.signature)
        return edits()

    @router.get("/edits", response_model=EditsOut)
    def get_all_edits() -> EditsOut:
        """Return the newest edit of zones, beware list, map or path settings since the start of the
        console, and the one that was undone last."""
        return EditsOut.of(operations.edits)

    @router.post("/edits/undo", response_model=EditDone, responses=refusals(409, 422, 503))
    def undo_any(
        visitor: CurrentVisitor, number: Annotated[int | None, Query(ge=1)] = None
    ) -> EditDone:
        """Undo the newest edit by any operator, of zones, beware list, map or path settings. With a
        `number`, the undo is refused when that edit is no longer the newest."""
        return EditDone(text=operations.edits.undo(by=visitor.signature, number=number))

    @router.post("/edits/redo", response_model=EditDone, responses=refusals(409, 422, 503))
    def redo_any(visitor: CurrentVisitor) -> EditDone:
        """Repeat the edit that was undone last, whichever it was of."""
        return EditDone(text=operations.edits.redo(by=visitor.signature))

    return router
