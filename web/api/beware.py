"""The beware list: read it, replace it, edit one class, undo an edit, restore the defaults."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Path, Query, Response

from navcore.errors import Outdated, Refused
from navcore.mission.beware_list import OPTIONAL, BewareClass, BewareList, ColourRule, as_toml
from web.gateway.etag import ExpectedVersion, etag, outdated
from web.gateway.problems import RESPONSES, JsonResponse
from web.interface.operations import RobotService
from web.schemas.beware import BewareClassIn, BewareListIn, BewarePatchIn, ColourRuleIn
from web.schemas.convert import beware_of
from web.schemas.fields import MAX_NAME
from web.schemas.responses import BewareOut

_REFUSALS: dict[int | str, dict[str, Any]] = {
    status: RESPONSES[status] for status in (409, 422, 503)
}
Force = Annotated[
    bool, Query(description="Put an empty list in force, too: the robot then bewares of nothing")
]


def beware_router(operations: RobotService) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["beware list"], default_response_class=JsonResponse)

    def answer(beware: BewareList, response: Response) -> BewareOut:
        response.headers.update(etag(beware.version))
        return beware_of(beware, operations)

    def conflict(given: int | None) -> Response:
        stored = operations.beware.list
        return outdated(
            "the beware list", given, beware_of(stored, operations).model_dump(), stored.version
        )

    @router.get("/beware", response_model=BewareOut)
    async def get_beware(response: Response) -> BewareOut:
        """What the robot must not touch, with the console's colour of each class."""
        return answer(operations.beware.list, response)

    @router.put("/beware", response_model=BewareOut, responses=_REFUSALS)
    def replace_beware(
        body: BewareListIn, response: Response, expected: ExpectedVersion, force: Force = False
    ) -> BewareOut | Response:
        """Put another list in force; it acts at once on everything the robot has seen.

        An empty list is refused with 409, unless `force` is true.
        """
        if not body.classes and not force:
            raise Refused(
                "with an empty beware list the robot bewares of nothing; repeat with ?force=true to put it in force"
            )
        entries = tuple(_entry(entry) for entry in body.classes)
        try:
            return answer(
                operations.beware.replace(BewareList(classes=entries), expected_version=expected),
                response,
            )
        except Outdated:
            return conflict(expected)

    @router.post("/beware/defaults", response_model=BewareOut, responses=_REFUSALS)
    def restore_defaults(response: Response) -> BewareOut:
        """Put the list that is shipped with the console in force, as one edit that can be undone."""
        return answer(operations.beware.restore_defaults(), response)

    @router.post("/beware/undo", response_model=BewareOut, responses=_REFUSALS)
    def undo(response: Response) -> BewareOut:
        """Undo the newest edit of the list; the list before it is in force again, under a new
        version."""
        return answer(operations.beware.undo(), response)

    @router.patch(
        "/beware/{class_name:path}",
        response_model=BewareOut,
        responses={404: RESPONSES[404], **_REFUSALS},
    )
    def edit_beware(
        class_name: Annotated[str, Path(max_length=MAX_NAME)],
        changes: BewarePatchIn,
        response: Response,
        expected: ExpectedVersion,
    ) -> BewareOut | Response:
        """Change fields of one class, e.g. `{"enabled": false}`; the map follows within a tick.

        With `If-Match` (the list's ETag), an edit of a list that somebody else has changed is
        refused.
        """
        if class_name not in {entry.name for entry in operations.beware.list.classes}:
            raise HTTPException(404, "no class of the beware list has this name")
        try:
            return answer(
                operations.beware.edit(class_name, _changes(changes), expected_version=expected),
                response,
            )
        except Outdated:
            return conflict(expected)

    @router.get("/beware.toml", response_class=Response)
    def get_beware_toml() -> Response:
        """The list as a file for `bewarenav drive --beware`."""
        return Response(
            as_toml(operations.beware.list), media_type="application/toml; charset=utf-8"
        )

    return router


def _entry(entry: BewareClassIn) -> BewareClass:
    return BewareClass(
        name=entry.name,
        class_id=entry.class_id,
        enabled=entry.enabled,
        margin_m=entry.margin_m,
        min_confidence=entry.min_confidence,
        colour=_rule(entry.colour),
        min_height_m=entry.min_height_m,
        max_height_m=entry.max_height_m,
        min_size_m=entry.min_size_m,
        label=entry.label,
    )


def _changes(patch: BewarePatchIn) -> dict[str, object]:
    # A missing field is unchanged; null means something for what may be absent, and for nothing
    # else.
    given = patch.model_dump(exclude_unset=True)
    return {name: value for name, value in given.items() if value is not None or name in OPTIONAL}


def _rule(rule: ColourRuleIn | None) -> ColourRule | None:
    return None if rule is None else ColourRule(**rule.model_dump())
