"""The log of decisions, and the mission's figures over time."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

from fastapi import APIRouter, Query

from web.api.insight_replies import EntryOut, JournalOut
from web.insight import Kind
from web.port import Operations
from web.problems import RESPONSES, JsonResponse
from web.replies import Figure

MAX_LIMIT = 1000


def journal_router(operations: Operations) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["understand"], default_response_class=JsonResponse)

    @router.get(
        "/journal", response_model=JournalOut, responses={422: RESPONSES[422], 503: RESPONSES[503]}
    )
    def get_journal(
        kind: Annotated[
            list[Kind] | None,
            Query(description="repeat for several; all kinds if left out", max_length=16),
        ] = None,
        since: Annotated[
            int, Query(ge=0, le=2**53, description="only entries with a larger id")
        ] = 0,
        before: Annotated[
            int | None,
            Query(ge=0, le=2**53, description="only entries with a smaller id: page back"),
        ] = None,
        limit: Annotated[int, Query(ge=1, le=MAX_LIMIT)] = 200,
    ) -> JournalOut:
        """Why the path changed, why the robot stood, what was seen first where: the newest entries,
        oldest first.

        Entries of earlier starts of the console come last, when one pages back with `before`.
        """
        page = operations.insight.journal(kinds=kind or (), since=since, before=before, limit=limit)
        entries = [EntryOut(**asdict(entry)) for entry in page.entries]
        return JournalOut(newest=page.newest, oldest=page.oldest, start=page.start, entries=entries)

    @router.get("/series", response_model=dict[str, list[Figure]], responses={422: RESPONSES[422]})
    def get_series(
        since_s: Annotated[
            float,
            Query(
                allow_inf_nan=False, description="only rows after this time of the robot's clock"
            ),
        ] = -1.0,
    ) -> dict[str, list[float | None]]:
        """Speed, distance, explored area and volume, tick times: one row a second of the last hour,
        column by column."""
        return dict(operations.insight.series(since_s))

    return router
