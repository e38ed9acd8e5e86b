"""Routes of the robot's place in the map."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from navcore.geometry.transform import Pose2
from web.api.router import api_router
from web.gateway.problems import refusals
from web.interface.localisation import PlaceCheck, PlaceOut
from web.interface.operations import RobotService
from web.schemas.fields import PoseIn


def localisation_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("localisation")

    @router.get("/localisation", response_model=PlaceOut)
    def get_place() -> PlaceOut:
        """Return how well the robot knows where it is."""
        return operations.place.status()

    @router.post("/pose", response_model=PlaceCheck, responses=refusals(409, 422))
    def set_pose(
        body: PoseIn,
        check: Annotated[bool, Query(description="only say how well the scan fits")] = False,
        force: Annotated[bool, Query(description="set it although the scan does not fit")] = False,
    ) -> PlaceCheck:
        """Say where the robot is; the newest scan is matched there, and the best pose nearby is
        taken. Refused while the robot drives, and where the scan contradicts the map. Needs
        control, unless it only checks."""
        pose = Pose2(x_m=body.x_m, y_m=body.y_m, yaw_rad=body.yaw_rad)
        if check:
            return operations.place.check(pose)
        return operations.place.place(pose, force=force)

    @router.post("/localisation/search", response_model=PlaceOut, responses=refusals(409))
    def search() -> PlaceOut:
        """Look for the robot's place in the whole map."""
        operations.place.search()
        return operations.place.status()

    return router
