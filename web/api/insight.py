"""Routes of the event log, the time series and the explanation of the path."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import numpy.typing as npt
from fastapi import APIRouter, Query

from web.api.router import api_router
from web.gateway.pooled_route import one_at_a_time
from web.gateway.problems import refusals
from web.interface.insight import Alternative, Explanation, Kind, Page
from web.interface.operations import RobotService
from web.interface.wire import rounded
from web.schemas.insight import ArcOut, CandidatesOut, WithoutIn

STEP = 4
"""Every fourth point of a motion primitive is sent: it bends evenly, and all primitives are sent
several times a second."""
MAX_LIMIT = 1000
"""Largest number of entries of the event log in an answer."""


def explain_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`. They are plain functions, so that they run in the server's
    pool, beside everything that drives."""
    router = api_router("understand")

    @router.get("/explain", response_model=Explanation, responses=refusals(409))
    @one_at_a_time
    def explain() -> Explanation:
        """Explain the present path by the rules it touches and the cost of each; without a path,
        name the fewest rules whose removal opens one."""
        return operations.insight.explain()

    @router.post("/explain", response_model=Alternative, responses=refusals(404, 409, 422))
    @one_at_a_time
    def without(body: WithoutIn) -> Alternative:
        """Plan the path without some rules; nothing is applied."""
        return operations.insight.without(body.without)

    @router.get("/candidates", response_model=CandidatesOut)
    def candidates() -> CandidatesOut:
        """Return the present motion primitives of the local planner and the chosen one."""
        found = operations.insight.candidates()
        if found is None or not np.isfinite(found.arcs).all():
            return CandidatesOut(arcs=[], chosen=None)
        pairs = zip(found.arcs, found.free, strict=True)
        return CandidatesOut(
            arcs=[_arc(arc, int(free)) for arc, free in pairs], chosen=found.chosen
        )

    return router


def _arc(points: npt.NDArray[np.float64], free: int) -> ArcOut:
    clear, touch = points[:free], rounded(points[free : free + 1])
    return ArcOut(
        points=rounded(np.vstack([clear[:-1:STEP], clear[-1:]])),
        touch=touch[0] if touch else None,
    )


def journal_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("understand")

    @router.get("/journal", response_model=Page, responses=refusals(422, 503))
    def get_journal(
        kind: Annotated[
            list[Kind] | None,
            Query(description="Kinds of entries; repeat for several, omit for all.", max_length=16),
        ] = None,
        since: Annotated[
            int, Query(ge=0, le=2**53, description="Only entries with a larger id.")
        ] = 0,
        before: Annotated[
            int | None,
            Query(ge=0, le=2**53, description="Only entries with a smaller id, to page back."),
        ] = None,
        limit: Annotated[int, Query(ge=1, le=MAX_LIMIT)] = 200,
    ) -> Page:
        """Return the newest entries of the event log, oldest first: changes of the path, reasons of
        standstills, first detections.

        Paging back with `before` reaches the entries of earlier starts of the console.
        """
        return operations.insight.event_log.page(
            kinds=kind or (), since=since, before=before, limit=limit
        )

    @router.get("/series", response_model=dict[str, list[float | None]], responses=refusals(422))
    def get_series(
        since_s: Annotated[
            float,
            Query(
                allow_inf_nan=False, description="Only rows after this time of the robot's clock."
            ),
        ] = -1.0,
    ) -> dict[str, list[float | None]]:
        """Return speed, distance, explored area and volume, and tick times: one row per second of
        the last hour, column by column."""
        return dict(operations.insight.series.after(since_s))

    return router
