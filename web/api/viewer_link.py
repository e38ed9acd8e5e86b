"""`WS /api/v1/viewer/{page_id}`: messages between a console page and its 3D view.

The page sends mode and draft, the view sends clicks and drags as points on the floor. No message
acts on the robot: the page turns a click into a request to the same routes that programs use.
"""

from __future__ import annotations

import asyncio
import json
from typing import Any

from fastapi import APIRouter, WebSocket
from pydantic import ValidationError

from web.api.router import api_router
from web.gateway.websockets import BAD_MESSAGE, POLICY_VIOLATION, until_one_ends
from web.viewer.messages import PageMessage
from web.viewer.page_link import PAGE_ID, PageLink
from web.viewer.viewer import Viewer


def viewer_link_router(viewer: Viewer | None) -> APIRouter:
    """Return the websocket below `/api/v1`."""
    router = api_router()

    @router.websocket("/viewer/{page_id}")
    async def link(socket: WebSocket, page_id: str) -> None:
        if viewer is None or PAGE_ID.fullmatch(page_id) is None:
            await socket.close(POLICY_VIOLATION)
            return
        await socket.accept()
        mailbox = PageLink(asyncio.get_running_loop())
        viewer.links.put(page_id, mailbox)
        try:
            await until_one_ends(
                _send(socket, mailbox),
                _receive(socket, viewer, page_id),
            )
        except ValidationError:
            # Only a page of another version, or another program, sends unknown messages.
            await socket.close(BAD_MESSAGE)
        finally:
            if viewer.links.drop(page_id, mailbox):
                await asyncio.to_thread(viewer.forget, page_id)

    return router


async def _send(socket: WebSocket, mailbox: PageLink) -> None:
    while True:
        message: dict[str, Any] = await mailbox.next()
        await socket.send_text(json.dumps(message, allow_nan=False))


async def _receive(socket: WebSocket, viewer: Viewer, page_id: str) -> None:
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            return
        # It takes time to read, waits for a lock and may look through the map, and a stop must not
        # wait for that.
        await asyncio.to_thread(_take, viewer, page_id, message.get("text") or "")


def _take(viewer: Viewer, page_id: str, text: str) -> None:
    """Read a message of a page and apply it; raises `ValidationError`."""
    viewer.receive(page_id, PageMessage.validate_json(text))
