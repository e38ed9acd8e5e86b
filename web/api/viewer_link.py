"""`WS /api/v1/viewer/{page_id}`: what a console page and its 3D view tell each other.

The page sends its mode and draft, the view sends clicks and drags as points on the floor. Nothing
here acts on the robot: the page turns a click into a request to the same routes that programs use.
"""

from __future__ import annotations

import asyncio
import json
from typing import Any

from fastapi import APIRouter, WebSocket
from pydantic import ValidationError

from web.auth.roles import CurrentVisitor, Role
from web.gateway.websockets import until_one_ends
from web.viewer.messages import DisplayOptions, PageMessage
from web.viewer.page_link import PAGE_ID, PageLink
from web.viewer.viewer import Viewer

NOT_FOR_YOU, BAD_MESSAGE = 1008, 1007


def viewer_link_router(viewer: Viewer | None) -> APIRouter:
    """The websocket below `/api/v1`."""
    router = APIRouter()

    @router.websocket("/viewer/{page_id}")
    async def link(socket: WebSocket, page_id: str, visitor: CurrentVisitor) -> None:
        if viewer is None or PAGE_ID.fullmatch(page_id) is None:
            await socket.close(NOT_FOR_YOU)
            return
        await socket.accept()
        mailbox = PageLink(asyncio.get_running_loop())
        viewer.links.put(page_id, mailbox)
        try:
            await until_one_ends(
                _tell(socket, mailbox),
                _listen(socket, viewer, page_id, acts=visitor.role.may(Role.OPERATOR)),
            )
        except ValidationError:
            # Only a page of another version or a stranger says what is not understood.
            await socket.close(BAD_MESSAGE)
        finally:
            if viewer.links.drop(page_id, mailbox):
                viewer.forget(page_id)

    return router


async def _tell(socket: WebSocket, mailbox: PageLink) -> None:
    while True:
        message: dict[str, Any] = await mailbox.next()
        await socket.send_text(json.dumps(message, allow_nan=False))


async def _listen(socket: WebSocket, viewer: Viewer, page_id: str, *, acts: bool) -> None:
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            return
        wish = PageMessage.validate_json(message.get("text") or "")
        if acts or not isinstance(
            wish, DisplayOptions
        ):  # the scene is shown alike to everybody, so it is not a viewer's to change
            viewer.receive(page_id, wish)
