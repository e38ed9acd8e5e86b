"""Bodies of requests, bounded in size and time, read before any handler runs."""

from __future__ import annotations

import asyncio
import re

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import Message, Receive, Scope

from web.gateway.problems import problem
from web.interface.sites import MAX_ARCHIVE_BYTES
from web.interface.teaching import MAX_FRAMES_BYTES, MAX_UPLOAD_BYTES
from web.schemas.map.poses import MAX_POSES_BYTES
from web.schemas.teaching import MAX_RUNS
from web.schemas.zones import MAX_IMAGE_FILE, MAX_IMPORT_BYTES

MAX_BODY_BYTES = 1_000_000
"""Largest body in bytes."""
BODY_TIMEOUT_S = 10.0
"""Time limit of the arrival of a body, seconds."""
LARGE_BODIES = {
    "/api/v1/sites/import": (MAX_ARCHIVE_BYTES, 120.0),
    "/api/v1/sites/import-nav2": (MAX_IMAGE_FILE + MAX_BODY_BYTES, 120.0),
    "/api/v1/zones/import": (MAX_IMPORT_BYTES, 120.0),
    "/api/v1/map/poses": (MAX_POSES_BYTES, 120.0),
    "/api/v1/zones/import-mask": (MAX_IMAGE_FILE + MAX_BODY_BYTES, 120.0),
    "/api/v1/teach/frames.zip": (MAX_FRAMES_BYTES, 300.0),
    "/api/v1/teach/networks": (MAX_UPLOAD_BYTES, 300.0),
    "labels": (MAX_BODY_BYTES + 10 * MAX_RUNS, 60.0),
}
"""Path → largest body in bytes and its time limit in seconds, where these differ; `labels` are all
annotations, each of whose numbers has ten characters at most."""
_LABELS = re.compile("/api/v1/teach/frames/[0-9]{1,12}/labels")


async def bounded_body(scope: Scope, receive: Receive) -> bytes | Response:
    """Return the whole body, or the refusal of one that is too large, too slow or cut off."""
    if scope["method"] in ("GET", "HEAD", "OPTIONS"):
        return b""
    path = "labels" if _LABELS.fullmatch(scope["path"]) else scope["path"]
    at_most, limit_s = LARGE_BODIES.get(path, (MAX_BODY_BYTES, BODY_TIMEOUT_S))
    too_large = problem(413, "too_large", f"a body may have at most {at_most} bytes", "body")
    length = Headers(scope=scope).get("content-length", "0")
    if not length.isdigit() or len(length) > 12 or int(length) > at_most:
        return too_large
    body = bytearray()
    try:
        async with asyncio.timeout(limit_s):
            while True:
                message = await receive()
                body += message.get("body", b"")
                if len(body) > at_most:
                    return too_large
                if message["type"] != "http.request":
                    return problem(400, "cut_off", "the connection ended before the body", "body")
                if not message.get("more_body"):
                    return bytes(body)
    except TimeoutError:
        return problem(408, "too_slow", f"the body did not arrive within {limit_s:g} s", "body")


def replayed(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that gives a body that was read already."""
    waiting = [body]

    async def replay() -> Message:
        if waiting:
            return {"type": "http.request", "body": waiting.pop(), "more_body": False}
        return await receive()

    return replay
