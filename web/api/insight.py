"""Why this way, and why none: which rule each stretch of the path keeps clear of, what lifting one
would bring, and which motions there are to choose from.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import numpy as np
import numpy.typing as npt
from fastapi import APIRouter, Query

from web.gateway.problems import RESPONSES, JsonResponse
from web.interface.insight import Explanation, Kind
from web.interface.operations import RobotService
from web.schemas.convert import track
from web.schemas.insight import (
    AlternativeOut,
    ArcOut,
    CandidatesOut,
    EntryOut,
    ExplanationOut,
    JournalOut,
    LiftOut,
    RuleOut,
    StretchOut,
    WithoutIn,
)
from web.schemas.responses import Figure

THINNED = 4


def explain_router(operations: RobotService) -> APIRouter:
    """Routes below `/api/v1`. Plain functions on purpose: they run in the server's pool, beside
    everything that drives."""
    router = APIRouter(tags=["understand"], default_response_class=JsonResponse)

    @router.get("/explain", response_model=ExplanationOut, responses={409: RESPONSES[409]})
    def explain() -> ExplanationOut:
        """The present path, cut by what it lies against, with each rule's cost; without a path, the
        fewest rules to lift."""
        return _out(operations.insight.explain())

    @router.post(
        "/explain",
        response_model=AlternativeOut,
        responses={status: RESPONSES[status] for status in (404, 409, 422)},
    )
    def without(body: WithoutIn) -> AlternativeOut:
        """The path if some rules did not stand; nothing is applied."""
        other = operations.insight.without(body.without)
        return AlternativeOut(
            found=other.reason is None,
            reason=other.reason,
            length_m=other.length_m,
            difference_m=other.difference_m,
            path=track(other.points),
        )

    @router.get("/candidates", response_model=CandidatesOut)
    def candidates() -> CandidatesOut:
        """The motions that the robot chooses from now, and which it has chosen. Made anew for
        whoever asks."""
        found = operations.insight.candidates()
        if found is None or not np.isfinite(found.arcs).all():
            return CandidatesOut(arcs=[], chosen=None)
        pairs = zip(found.arcs, found.free, strict=True)
        return CandidatesOut(
            arcs=[_arc(arc, int(free)) for arc, free in pairs], chosen=found.chosen
        )

    return router


def _arc(points: npt.NDArray[np.float64], free: int) -> ArcOut:
    """Every few points are enough for a line: an arc bends evenly, and all of them are sent several
    times a second."""
    clear = points[:free]
    thin = np.vstack([clear[:-1:THINNED], clear[-1:]]).round(3)
    return ArcOut(
        points=[(x, y) for x, y in thin.tolist()],
        touch=None
        if free >= len(points)
        else (round(float(points[free, 0]), 3), round(float(points[free, 1]), 3)),
    )


def _out(explanation: Explanation) -> ExplanationOut:
    lift = LiftOut(
        keys=None if explanation.lift is None else list(explanation.lift),
        exact=explanation.lift_exact,
        at_least=explanation.lift_at_least,
    )
    return ExplanationOut(
        goal=explanation.goal,
        found=explanation.reason is None,
        reason=explanation.reason,
        length_m=explanation.length_m,
        # Not thinned: the stretches count its points, and a path has no more than the map has cells
        # across, times a few.
        path=[(x, y) for x, y in explanation.points.round(3).tolist()],
        stretches=[
            StretchOut(key=key, first=first, last=last)
            for key, first, last in explanation.stretches
        ],
        rules=[
            RuleOut(key=rule.key, name=rule.name, along_m=rule.along_m, saves_m=rule.saves_m)
            for rule in explanation.rules
        ],
        all_cost_m=explanation.all_cost_m,
        lift=None if explanation.reason is None else lift,
    )


MAX_LIMIT = 1000


def journal_router(operations: RobotService) -> APIRouter:
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
        event_log = operations.insight.event_log
        page = event_log.page(kinds=kind or (), since=since, before=before, limit=limit)
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
        return dict(operations.insight.series.after(since_s))

    return router
