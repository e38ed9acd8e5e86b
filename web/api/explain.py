"""Why this way, and why none: which rule each stretch of the path keeps clear of, and what lifting one would bring."""

from __future__ import annotations

from fastapi import APIRouter

from web.api.answers import track
from web.api.insight_replies import AlternativeOut, ExplanationOut, LiftOut, RuleOut, StretchOut, WithoutIn
from web.insight import Explanation
from web.port import Operations
from web.problems import RESPONSES, JsonResponse


def explain_router(operations: Operations) -> APIRouter:
    """Routes below `/api/v1`. Plain functions on purpose: they run in the server's pool, beside everything that drives."""
    router = APIRouter(tags=["understand"], default_response_class=JsonResponse)

    @router.get("/explain", response_model=ExplanationOut, responses={409: RESPONSES[409]})
    def explain() -> ExplanationOut:
        """The present path, cut by what it lies against, with each rule's cost; without a path, the fewest rules to lift."""
        return _out(operations.insight.explain())

    @router.post("/explain", response_model=AlternativeOut, responses={status: RESPONSES[status] for status in (404, 409, 422)})
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

    return router


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
        # Not thinned: the stretches count its points, and a path has no more than the map has cells across, times a few.
        path=[(x, y) for x, y in explanation.points.round(3).tolist()],
        stretches=[StretchOut(key=key, first=first, last=last) for key, first, last in explanation.stretches],
        rules=[RuleOut(key=rule.key, name=rule.name, along_m=rule.along_m, saves_m=rule.saves_m) for rule in explanation.rules],
        all_cost_m=explanation.all_cost_m,
        lift=None if explanation.reason is None else lift,
    )
