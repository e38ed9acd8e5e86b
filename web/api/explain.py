"""Why this way, and why none: which rule each stretch of the path keeps clear of, what lifting one
would bring, and which motions there are to choose from.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from fastapi import APIRouter

from web.api.answers import track
from web.api.insight_replies import (
    AlternativeOut,
    ArcOut,
    CandidatesOut,
    ExplanationOut,
    LiftOut,
    RuleOut,
    StretchOut,
    WithoutIn,
)
from web.insight import Explanation
from web.port import Operations
from web.problems import RESPONSES, JsonResponse

THINNED = 4


def explain_router(operations: Operations) -> APIRouter:
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
