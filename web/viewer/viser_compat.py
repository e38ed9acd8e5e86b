"""All uses of viser's private members; an update of viser needs a check of this file only."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any

import rich
import viser
import websockets.asyncio.server
from viser import _messages
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request

PAGE_FILE = Path(viser.__file__).with_name("client") / "build" / "index.html"
"""viser's page: one file, which its own server sends as it is."""
ACCEPTED = (
    _messages.ViewerCameraMessage,
    _messages.ScenePointerMessage,
    _messages.SceneNodeClickMessage,
    _messages.SceneNodeDragMessage,
)
"""Messages of a client that the console needs: camera pose, clicks and drags. Uploads, widgets and
the public tunnel are dropped."""


def accept_only_needed_messages(server: viser.ViserServer) -> None:
    """Drop every message of a client but the `ACCEPTED` ones, the request of a public tunnel above
    all."""

    def restrict(listener: Any) -> None:
        for kind in [kind for kind in listener._incoming_handlers if kind not in ACCEPTED]:
            listener.unregister_handler(kind)

    restrict(server._websock_server)
    # viser installs a client's handlers in a callback of the same list, so this one runs later.
    server._websock_server.on_client_connect(restrict)


def request_header(server: viser.ViserServer, client: viser.ClientHandle, name: str) -> str:
    """Return a header of the request that opened a client's connection; empty without it."""
    connection = server._websock_server._live_connections.get(client.client_id)
    request = None if connection is None else connection.request
    return "" if request is None else str(request.headers.get(name, ""))


@contextmanager
def refusing_others(header: str, secret: str) -> Iterator[None]:
    """Have the server that viser begins in the block refuse each connection without a header, which
    only the relay sends: its port is open to every program of this machine, and so to every page in
    a browser there."""
    serve = websockets.asyncio.server.serve

    def guarded(*given: Any, process_request: Any, **options: Any) -> Any:
        def checked(connection: ServerConnection, request: Request) -> Any:
            told = request.headers.get(header, "")
            if not secrets.compare_digest(told.encode(), secret.encode()):
                return connection.respond(HTTPStatus.FORBIDDEN, "the 3D view is in the console\n")
            return process_request(connection, request)

        return serve(*given, process_request=checked, **options)

    websockets.asyncio.server.serve = guarded  # type: ignore[misc, assignment]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]


class Quiet:
    """Context without viser's output: its private address must not be mistaken for the
    console's."""

    def __enter__(self) -> None:
        self._was_quiet = rich.get_console().quiet
        rich.get_console().quiet = True

    def __exit__(self, *_: Any) -> None:
        rich.get_console().quiet = self._was_quiet
