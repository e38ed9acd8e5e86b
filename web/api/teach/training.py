"""Routes of the training of the network and of its versions."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

from web.api.router import api_router
from web.gateway.problems import refusals
from web.gateway.request_body import body_file
from web.interface.operations import RobotService
from web.interface.teaching import VERSION_NAME, NetworkVersion, TrainingRun
from web.schemas.teaching import NetworksOut, TrainingIn, TrainingOut

Force = Annotated[
    bool, Query(description="Whether to use a version that does not find what it was taught.")
]
VersionName = Annotated[str, Path(pattern=VERSION_NAME)]
_REFUSALS = refusals(404, 409, 422, 503)


def teach_training_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("teach")

    def networks() -> NetworksOut:
        shown = operations.teaching.networks
        return NetworksOut(
            used=shown.used,
            previous=shown.previous,
            exchange=shown.exchange,
            trouble=shown.trouble,
            versions=list(shown.all()),
        )

    @router.get("/teach/training", response_model=TrainingOut)
    def get_training() -> TrainingOut:
        """Return the newest training run: progress, curves and how it ended."""
        return TrainingOut(run=operations.teaching.trainings.newest())

    @router.post(
        "/teach/training", status_code=201, response_model=TrainingRun, responses=_REFUSALS
    )
    def start_training(body: TrainingIn) -> TrainingRun:
        """Train the annotated classes, in a process of its own at the lowest priority. A quarter
        of the frames of a class is held back for the comparison, in all later trainings, too."""
        return operations.teaching.trainings.start(body.order())

    @router.post("/teach/training/cancel", response_model=TrainingRun, responses=_REFUSALS)
    def cancel_training() -> TrainingRun:
        """End the training; it can be resumed."""
        return operations.teaching.trainings.cancel()

    @router.post("/teach/training/resume", response_model=TrainingRun, responses=_REFUSALS)
    def resume_training() -> TrainingRun:
        """Continue the newest training where it was cancelled or failed."""
        return operations.teaching.trainings.resume()

    @router.get(
        "/teach/training/looks/{number}.png", response_class=Response, responses=refusals(404)
    )
    def get_look(number: Annotated[int, Path(ge=0, le=1000)]) -> Response:
        """Return a held-back frame with what the network finds in it at present."""
        return Response(operations.teaching.trainings.look(number), media_type="image/png")

    @router.get("/teach/networks", response_model=NetworksOut)
    def get_networks() -> NetworksOut:
        """Return all versions of the network, each with hash, origin and figures, and which one is
        in use."""
        return networks()

    @router.post(
        "/teach/networks", status_code=201, response_model=NetworkVersion, responses=_REFUSALS
    )
    def add_network(
        request: Request, name: Annotated[str, Query(pattern=VERSION_NAME)]
    ) -> NetworkVersion:
        """Store a weights file (`.safetensors`), the body of the request, as a version."""
        return operations.teaching.networks.add(name, body_file(request))

    @router.post("/teach/networks/rollback", response_model=NetworksOut, responses=_REFUSALS)
    def roll_back() -> NetworksOut:
        """Use the version that was in use before."""
        operations.teaching.networks.roll_back()
        return networks()

    @router.post("/teach/networks/{name}/use", response_model=NetworksOut, responses=_REFUSALS)
    def use_network(name: VersionName, force: Force = False) -> NetworksOut:
        """Prepare a version beside the tick, then exchange the network between two frames. The
        answer comes at once; `exchange` names the version until it is in use. A version that does
        not find what it was taught needs `force`."""
        operations.teaching.networks.use(name, force=force)
        return networks()

    @router.delete(
        "/teach/networks/{name}", status_code=204, response_class=Response, responses=_REFUSALS
    )
    def delete_network(name: VersionName) -> None:
        """Delete a version that is not in use."""
        operations.teaching.networks.delete(name)

    return router
