"""Routes of the beware list: read it, replace it, edit one class, undo an edit, restore the
defaults."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, HTTPException, Path, Query, Response
from pydantic import TypeAdapter

from navcore.errors import Outdated, Refused
from navcore.mission.beware_list import BewareList, as_toml
from web.gateway.etag import ExpectedVersion, etag, outdated
from web.gateway.problems import JsonResponse, refusals
from web.interface.operations import RobotService
from web.schemas.beware import BewareChanges, BewareListIn, BewareOut
from web.schemas.fields import MAX_NAME

_REFUSALS = refusals(409, 422, 503)
_OUT = TypeAdapter(BewareOut)
Force = Annotated[
    bool, Query(description="Accept an empty list, too: the robot then avoids no class.")
]


def beware_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = APIRouter(tags=["beware list"], default_response_class=JsonResponse)

    def answer(beware: BewareList, response: Response) -> BewareOut:
        response.headers.update(etag(beware.version))
        return BewareOut.of(beware, operations.beware)

    def conflict(given: int | None) -> Response:
        stored = operations.beware.list
        shown = _OUT.dump_python(BewareOut.of(stored, operations.beware), mode="json")
        return outdated("the beware list", given, shown, stored.version)

    @router.get("/beware", response_model=BewareOut)
    async def get_beware(response: Response) -> BewareOut:
        """Return the classes of objects that the robot must not touch, with the console's colour of
        each."""
        return answer(operations.beware.list, response)

    @router.put("/beware", response_model=BewareOut, responses=_REFUSALS)
    def replace_beware(
        body: BewareListIn, response: Response, expected: ExpectedVersion, force: Force = False
    ) -> BewareOut | Response:
        """Replace the list; the new one applies at once to everything that the robot has observed.

        An empty list is refused with 409, unless `force` is true.
        """
        if not body.classes and not force:
            raise Refused(
                "with an empty beware list the robot bewares of nothing; "
                "repeat with ?force=true to put it in force"
            )
        beware = BewareList(classes=tuple(body.classes))
        try:
            return answer(operations.beware.replace(beware, expected_version=expected), response)
        except Outdated:
            return conflict(expected)

    @router.post("/beware/defaults", response_model=BewareOut, responses=_REFUSALS)
    def restore_defaults(response: Response) -> BewareOut:
        """Restore the list of the console's package, as one edit that can be undone."""
        return answer(operations.beware.restore_defaults(), response)

    @router.post("/beware/undo", response_model=BewareOut, responses=_REFUSALS)
    def undo(response: Response) -> BewareOut:
        """Restore the list before the newest edit, under a new version."""
        return answer(operations.beware.undo(), response)

    @router.patch(
        "/beware/{class_name:path}",
        response_model=BewareOut,
        responses=refusals(404, 409, 422, 503),
    )
    def edit_beware(
        class_name: Annotated[str, Path(max_length=MAX_NAME)],
        changes: BewareChanges,
        response: Response,
        expected: ExpectedVersion,
    ) -> BewareOut | Response:
        """Change fields of one class, for example `{"enabled": false}`; the map follows within a
        tick.

        With `If-Match` (the list's ETag), an edit of an outdated list is refused.
        """
        if class_name not in {entry.name for entry in operations.beware.list.classes}:
            raise HTTPException(404, "no class of the beware list has this name")
        try:
            return answer(
                operations.beware.edit(class_name, changes, expected_version=expected), response
            )
        except Outdated:
            return conflict(expected)

    @router.get("/beware.toml", response_class=Response)
    def get_beware_toml() -> Response:
        """Return the list as a file for `bewarenav drive --beware`."""
        return Response(
            as_toml(operations.beware.list), media_type="application/toml; charset=utf-8"
        )

    return router
