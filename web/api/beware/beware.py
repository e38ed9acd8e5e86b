"""Routes of the beware list: read it, edit one class or all of it, undo, and its file."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, HTTPException, Path, Query, Request, Response
from pydantic import TypeAdapter

from navcore.errors import BadConfiguration, Outdated
from navcore.mission.beware_list import BewareList, as_toml
from web.api.router import api_router
from web.auth.roles import CurrentVisitor
from web.gateway.etag import ExpectedVersion, etag, outdated
from web.gateway.problems import refusals
from web.interface.operations import RobotService
from web.schemas.beware import BewareChanges, BewareListIn, BewareOut, ListName, NewEntry, OrderIn
from web.schemas.fields import MAX_NAME

_REFUSALS = refusals(409, 422, 503)
_EDITS = refusals(404, 409, 422, 503)
_OUT = TypeAdapter(BewareOut)
ClassName = Annotated[str, Path(max_length=MAX_NAME)]
Force = Annotated[
    bool, Query(description="Accept an empty list, too: the robot then avoids no class.")
]


def beware_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("beware list")

    def answer(beware: BewareList, response: Response) -> BewareOut:
        response.headers.update(etag(beware.version))
        return BewareOut.of(beware, operations.beware)

    def conflict(given: int | None) -> Response:
        stored = operations.beware.list
        shown = _OUT.dump_python(BewareOut.of(stored, operations.beware), mode="json")
        return outdated("the beware list", given, shown, stored.version)

    def require(class_name: str) -> None:
        if class_name not in {entry.name for entry in operations.beware.list.classes}:
            raise HTTPException(404, "no class of the beware list has this name")

    @router.get("/beware", response_model=BewareOut)
    async def get_beware(response: Response) -> BewareOut:
        """Return the classes of objects that the robot must not touch, with the console's colour of
        each."""
        return answer(operations.beware.list, response)

    @router.put("/beware", response_model=BewareOut, responses=_REFUSALS)
    def replace_beware(
        body: BewareListIn,
        response: Response,
        expected: ExpectedVersion,
        visitor: CurrentVisitor,
        force: Force = False,
    ) -> BewareOut | Response:
        """Replace the list; the new one applies at once to everything that the robot has observed.

        An empty list is refused with 409, unless `force` is true.
        """
        try:
            beware = operations.beware.replace(
                BewareList(classes=tuple(body.classes)),
                expected_version=expected,
                force=force,
                by=visitor.signature,
            )
        except Outdated:
            return conflict(expected)
        return answer(beware, response)

    @router.post("/beware", status_code=201, response_model=BewareOut, responses=_REFUSALS)
    def add_class(entry: NewEntry, response: Response, visitor: CurrentVisitor) -> BewareOut:
        """Add a class at the end of the list; the console gives it its id. A class that was removed
        before gets its id back, and with it its points on the map."""
        return answer(operations.beware.add(entry, by=visitor.signature), response)

    @router.put("/beware/order", response_model=BewareOut, responses=_REFUSALS)
    def order(body: OrderIn, response: Response, visitor: CurrentVisitor) -> BewareOut:
        """Change the order of the classes; the first enabled colour rule that fits a pixel labels
        it."""
        return answer(operations.beware.order(body.names, by=visitor.signature), response)

    @router.post("/beware/defaults", response_model=BewareOut, responses=_REFUSALS)
    def take_ready_made(
        response: Response,
        visitor: CurrentVisitor,
        name: Annotated[ListName, Query(description="Which ready-made list.")] = "default",
    ) -> BewareOut:
        """Replace the list by that of a new site, or by another ready-made one, as one edit that
        can be undone."""
        return answer(operations.beware.take_ready_made(name, by=visitor.signature), response)

    @router.post("/beware/undo", response_model=BewareOut, responses=_REFUSALS)
    def undo(response: Response, visitor: CurrentVisitor) -> BewareOut:
        """Restore the list before the newest edit, under a new version."""
        operations.beware.undo(by=visitor.signature)
        return answer(operations.beware.list, response)

    @router.post("/beware/redo", response_model=BewareOut, responses=_REFUSALS)
    def redo(response: Response, visitor: CurrentVisitor) -> BewareOut:
        """Repeat the edit that was undone last, under a new version."""
        operations.beware.redo(by=visitor.signature)
        return answer(operations.beware.list, response)

    @router.patch("/beware/{class_name:path}", response_model=BewareOut, responses=_EDITS)
    def edit_beware(
        class_name: ClassName,
        changes: BewareChanges,
        response: Response,
        expected: ExpectedVersion,
        visitor: CurrentVisitor,
    ) -> BewareOut | Response:
        """Change fields of one class, for example `{"enabled": false}`; the map follows within a
        tick. A new `name` keeps what is on the map and what the network detects.

        With `If-Match` (the list's ETag), an edit of an outdated list is refused.
        """
        require(class_name)
        try:
            beware = operations.beware.edit(
                class_name, changes, expected_version=expected, by=visitor.signature
            )
        except Outdated:
            return conflict(expected)
        return answer(beware, response)

    @router.delete("/beware/{class_name:path}", response_model=BewareOut, responses=_EDITS)
    def remove_class(
        class_name: ClassName,
        response: Response,
        expected: ExpectedVersion,
        visitor: CurrentVisitor,
        force: Force = False,
    ) -> BewareOut | Response:
        """Remove a class; its points stay in the map, hidden, and come back with it. The last class
        is refused with 409, unless `force` is true."""
        require(class_name)
        try:
            beware = operations.beware.remove(
                class_name, expected_version=expected, force=force, by=visitor.signature
            )
        except Outdated:
            return conflict(expected)
        return answer(beware, response)

    @router.get("/beware.toml", response_class=Response)
    def get_beware_toml() -> Response:
        """Return the list as a file for `bewarenav console --beware` and `drive --beware`."""
        return Response(
            as_toml(operations.beware.list), media_type="application/toml; charset=utf-8"
        )

    @router.put(
        "/beware.toml",
        response_model=BewareOut,
        responses=_REFUSALS,
        openapi_extra={
            "requestBody": {
                "required": True,
                "content": {"application/toml": {"schema": {"type": "string"}}},
            }
        },
    )
    async def import_toml(
        request: Request,
        response: Response,
        expected: ExpectedVersion,
        visitor: CurrentVisitor,
        force: Force = False,
    ) -> BewareOut | Response:
        """Replace the list by that of a TOML file, the body of the request. A known name keeps its
        id here, whatever the file says. What is wrong is named with its line and key, and then
        nothing has changed."""
        data = await request.body()
        try:
            text = data.decode()
        except UnicodeDecodeError as error:
            raise BadConfiguration(
                f"the file: not UTF-8 text: byte {error.start} is wrong"
            ) from None
        try:
            beware = await asyncio.to_thread(
                operations.beware.import_toml,
                text,
                expected_version=expected,
                force=force,
                by=visitor.signature,
            )
        except Outdated:
            return conflict(expected)
        return answer(beware, response)

    return router
