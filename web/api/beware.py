"""The beware list: read it, replace it, switch one class off and on."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Path, Response

from navcore.beware import BewareClass, BewareList, ColourRule
from navcore.errors import Outdated
from web.api.answers import beware_of
from web.api.versions import ExpectedVersion, etag, outdated
from web.port import Operations
from web.problems import RESPONSES, JsonResponse
from web.replies import BewareOut
from web.schemas import MAX_NAME, BewareClassIn, BewareListIn, BewarePatchIn, ColourRuleIn

_REFUSALS: dict[int | str, dict[str, Any]] = {status: RESPONSES[status] for status in (412, 422, 503)}


def beware_router(operations: Operations) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["beware list"], default_response_class=JsonResponse)

    def answer(beware: BewareList, response: Response) -> BewareOut:
        response.headers.update(etag(beware.version))
        return beware_of(beware)

    @router.get("/beware", response_model=BewareOut)
    async def get_beware(response: Response) -> BewareOut:
        """What the robot must not touch, with the console's colour of each class."""
        return answer(operations.beware(), response)

    @router.put("/beware", response_model=BewareOut, responses=_REFUSALS)
    def replace_beware(body: BewareListIn, response: Response, expected: ExpectedVersion) -> BewareOut | Response:
        """Put another list in force; it acts at once on everything the robot has seen."""
        entries = tuple(_entry(entry) for entry in body.classes)
        try:
            return answer(operations.replace_beware(BewareList(classes=entries), expected_version=expected), response)
        except Outdated:
            stored = operations.beware()
            return outdated("the beware list", expected, beware_of(stored).model_dump(), stored.version)

    @router.patch("/beware/{class_name}", response_model=BewareOut, responses={404: RESPONSES[404], **_REFUSALS})
    def edit_beware(
        class_name: Annotated[str, Path(max_length=MAX_NAME)], changes: BewarePatchIn, response: Response
    ) -> BewareOut:
        """Change fields of one class, e.g. `{"enabled": false}`; the map follows within a tick."""
        entry = next((entry for entry in operations.beware().classes if entry.name == class_name), None)
        if entry is None:
            raise HTTPException(404, "no class of the beware list has this name")
        return answer(operations.edit_beware(class_name, _changes(changes, entry)), response)

    return router


def _entry(entry: BewareClassIn) -> BewareClass:
    return BewareClass(
        name=entry.name,
        class_id=entry.class_id,
        enabled=entry.enabled,
        margin_m=entry.margin_m,
        min_confidence=entry.min_confidence,
        colour=_rule(entry.colour),
    )


def _changes(patch: BewarePatchIn, entry: BewareClass) -> dict[str, object]:
    # A missing field is unchanged; null means something for a colour rule that is there, and for nothing else.
    given = {name: getattr(patch, name) for name in patch.model_fields_set}
    changes = {name: value for name, value in given.items() if value is not None and name != "colour"}
    if patch.colour is not None:
        changes["colour"] = patch.colour.model_dump()
    elif "colour" in given and entry.colour is not None:
        changes["colour"] = None
    return changes


def _rule(rule: ColourRuleIn | None) -> ColourRule | None:
    return None if rule is None else ColourRule(**rule.model_dump())
