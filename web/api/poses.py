"""The poses that the map is made from, for a program that knows them better: a loop closure or a
re-localisation."""

from __future__ import annotations

from fastapi import APIRouter, Response

from navcore.geometry.transform import Pose2
from web.port import Operations
from web.problems import RESPONSES, JsonResponse
from web.replies import NumberedPoseOut, PosesOut
from web.schemas.poses import PosesIn


def poses_router(operations: Operations) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["map and camera"], default_response_class=JsonResponse)

    @router.get("/map/poses", response_model=PosesOut)
    def get_poses() -> PosesOut:
        """Where the robot was when it saw the map's points; a new ID every so many metres or
        degrees."""
        poses = enumerate(operations.poses())
        return PosesOut(
            poses=[
                NumberedPoseOut(id=i, x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad)
                for i, pose in poses
            ]
        )

    @router.patch(
        "/map/poses", status_code=204, response_class=Response, responses={422: RESPONSES[422]}
    )
    def correct_poses(body: PosesIn) -> None:
        """Put past poses right: what was seen from them moves along, and the path follows, from the
        next tick on."""
        operations.correct_poses(
            {
                pose.id: Pose2(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad)
                for pose in body.poses
            }
        )

    return router
