"""Requests to every route that an app declares, without a network between."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI
from fastapi.routing import iter_route_contexts
from starlette.routing import Route, WebSocketRoute
from starlette.types import Message, Scope

FOREIGN_HEADERS = {
    "foreign host": {"Host": "evil.example"},
    "host with a trick": {"Host": "console.evil.example"},
    "host and port of another": {"Host": "evil.example:8000"},
    "foreign origin": {"Host": "console", "Origin": "http://evil.example"},
    "no origin to speak of": {"Host": "console", "Origin": "null"},
    "same name, other port": {"Host": "console", "Origin": "http://console:9999"},
    "origin with a trick": {"Host": "console", "Origin": "http://console@evil.example"},
    "embedded elsewhere": {
        "Host": "console",
        "Sec-Fetch-Site": "cross-site",
        "Sec-Fetch-Dest": "image",
    },
}
"""Headers of requests that a console with the host name `console` must refuse."""
PARAMETER = "x" * 16


def routes_of(app: FastAPI) -> list[tuple[str, str]]:
    """Return (method or WS, path) of every route of the app."""
    found = []
    for route in iter_route_contexts(app.routes):
        assert route.path is not None, f"{route!r} is of an unknown kind"
        path = re.sub(r"\{[^}]*\}", PARAMETER, route.path)
        if isinstance(route.original_route, WebSocketRoute):
            found.append(("WS", path))
        else:
            assert isinstance(route.original_route, Route), f"{route!r} is of an unknown kind"
            found += [(method, path) for method in sorted(route.methods or ())]
    return found


def response_status(
    app: Any,
    method: str,
    path: str,
    headers: dict[str, str],
    *,
    messages: Sequence[Message] = (),
    quiet: bool = False,
) -> int:
    """Return the status of the answer; 101 for a websocket that is accepted, 403 for one that is
    closed before.

    `messages` come in over a websocket before it is closed. `quiet`: a handler that is reached and
    fails answers 500, and its error is not raised again.
    """
    sent: list[Message] = []
    scope: Scope = {
        "type": "websocket" if method == "WS" else "http",
        "method": method,
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "scheme": "http",
        "http_version": "1.1",
        "subprotocols": [],
        "headers": [(name.lower().encode(), value.encode()) for name, value in headers.items()],
    }
    opening = (
        {"type": "websocket.connect"} if method == "WS" else {"type": "http.request", "body": b""}
    )
    arriving = iter([opening, *messages])

    async def receive() -> Message:
        return next(
            arriving,
            {"type": "websocket.disconnect"} if method == "WS" else {"type": "http.disconnect"},
        )

    async def send(message: Message) -> None:
        sent.append(message)

    try:
        asyncio.run(app(scope, receive, send))
    except Exception:
        if not quiet or not sent:
            raise
    if method == "WS":
        return 101 if sent and sent[0]["type"] == "websocket.accept" else 403
    return int(sent[0]["status"])
