"""The 3D view behind the guard: viser's page, and its websocket relayed, below `/viewer`.

The relay has no queue: it takes a message from viser when the previous one has left, so a slow
client costs no memory and later gets the newest values, as viser promises. Compression is off on
both sides; it costs more than it saves in a local network.
"""

from __future__ import annotations

import hashlib
import logging

import msgspec
import websockets
from fastapi import APIRouter, HTTPException, Request, Response, WebSocket
from starlette.websockets import WebSocketState
from websockets.asyncio.client import ClientConnection
from websockets.typing import Subprotocol

from web.auth.roles import CurrentVisitor, Role
from web.gateway.etag import unless_known
from web.gateway.websockets import GOING_AWAY, TRY_AGAIN, until_one_ends
from web.viewer.page_link import PAGE_ID, PAGE_ID_HEADER, SECRET_HEADER
from web.viewer.viewer import Viewer
from web.viewer.viser_compat import PAGE_FILE

log = logging.getLogger(__name__)

CAMERA_MESSAGE = "ViewerCameraMessage"
MAX_FROM_VIEWER = 256 * 1024 * 1024
"""Largest message of viser in bytes; a new client gets the whole scene."""
_SCRIPTS = b"".join(
    b'<script src="/page/viewer/%s"></script>' % name
    for name in (b"opacity.js", b"frame_pacing.js")
)
"""Scripts that give viser's page the opacities of its console page, and keep it from drawing while
it is hidden."""


class _Kind(msgspec.Struct):
    """Type of a message to viser."""

    type: str


def viewer_router(viewer: Viewer | None) -> APIRouter:
    """Return the routes `/viewer/…`, with or without the id of the embedding page."""
    router = APIRouter(include_in_schema=False)
    html = b"" if viewer is None else _page()
    tag = f'"{hashlib.sha256(html).hexdigest()[:16]}"'

    @router.get("/viewer")
    @router.get("/viewer/")
    async def page(request: Request) -> Response:
        """Return viser's page."""
        if viewer is None:
            raise HTTPException(
                404, "the 3D view is not running; the map and every control work without it"
            )
        return unless_known(request, tag, lambda: html, "text/html; charset=utf-8")

    @router.get("/viewer/{page_id}")
    @router.get("/viewer/{page_id}/")
    async def page_of(request: Request, page_id: str) -> Response:
        """Return viser's page for one console page, which gets its clicks."""
        if PAGE_ID.fullmatch(page_id) is None:
            raise HTTPException(404, "nothing is here")
        return await page(request)

    # viser's page opens its websocket at its own address without the trailing slash.
    @router.websocket("/viewer")
    @router.websocket("/viewer/{page_id}")
    async def relay(socket: WebSocket, visitor: CurrentVisitor, page_id: str = "") -> None:
        """Relay viser's websocket."""
        offered = socket.scope.get("subprotocols", [])
        if (
            viewer is None
            or viewer.subprotocol not in offered
            or (page_id and PAGE_ID.fullmatch(page_id) is None)
        ):
            await socket.close(TRY_AGAIN)
            return
        await _relay(socket, viewer, page_id, acts=visitor.role.may(Role.OPERATOR))

    return router


def _page() -> bytes:
    """Return viser's page with our scripts, which must load before the first frame is drawn."""
    return PAGE_FILE.read_bytes().replace(b"<head>", b"<head>" + _SCRIPTS, 1)


async def _relay(socket: WebSocket, viewer: Viewer, page_id: str, *, acts: bool) -> None:
    upstream = await websockets.connect(
        viewer.websocket_url,
        subprotocols=[Subprotocol(viewer.subprotocol)],
        additional_headers={SECRET_HEADER: viewer.secret, PAGE_ID_HEADER: page_id},
        compression=None,
        max_size=MAX_FROM_VIEWER,
        max_queue=1,
        proxy=None,
    )
    try:
        await socket.accept(subprotocol=viewer.subprotocol)
        await until_one_ends(
            _from_viewer(upstream, socket), _to_viewer(socket, upstream, acts=acts)
        )
        await upstream.close()
    finally:
        # A close that is cancelled as the console ends leaves its socket open.
        upstream.transport.abort()
    if (
        socket.client_state is WebSocketState.CONNECTED
        and socket.application_state is WebSocketState.CONNECTED
    ):
        await socket.close(GOING_AWAY)


async def _from_viewer(upstream: ClientConnection, socket: WebSocket) -> None:
    async for message in upstream:
        if isinstance(message, bytes):
            await socket.send_bytes(message)


async def _to_viewer(socket: WebSocket, upstream: ClientConnection, *, acts: bool) -> None:
    while True:
        message = await socket.receive()
        if message["type"] != "websocket.receive" or message.get("bytes") is None:
            # viser sends binary messages only; any other ends this connection.
            return
        if not acts:
            try:
                kind = msgspec.msgpack.decode(message["bytes"], type=_Kind).type
            except msgspec.MsgspecError:
                return
            if kind != CAMERA_MESSAGE:
                continue  # of a viewer's messages, only the camera pose is accepted
        await upstream.send(message["bytes"])
