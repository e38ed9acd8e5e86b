"""Bodies of requests, bounded in size and time, read before any handler runs."""

from __future__ import annotations

import asyncio
import io
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import BinaryIO, cast

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Message, Receive, Scope

from navcore.errors import BewareNavError
from web.auth.audit import BODY_KEY
from web.auth.permissions import SAFE, STOP
from web.gateway.login import LOGIN_PATH
from web.gateway.problems import problem, refusal
from web.interface.sites import MAX_ARCHIVE_BYTES
from web.interface.teaching import MAX_FRAMES_BYTES, MAX_UPLOAD_BYTES
from web.schemas.map.poses import MAX_POSES_BYTES
from web.schemas.teaching import MAX_RUNS
from web.schemas.zones import MAX_IMAGE_FILE, MAX_IMPORT_BYTES

MAX_BODY_BYTES = 1_000_000
"""Largest body in bytes."""
BODY_TIMEOUT_S = 10.0
"""Time limit of the arrival of a body, seconds."""
MAX_PASSWORD_BODY_BYTES = 10_000
"""Largest body in bytes of a password: the event loop reads it."""
BODY_LIMITS = {
    LOGIN_PATH: (MAX_PASSWORD_BODY_BYTES, BODY_TIMEOUT_S),
    "/api/v1/me/password": (MAX_PASSWORD_BODY_BYTES, BODY_TIMEOUT_S),
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
Spools = Mapping[str, Callable[[], BinaryIO]]
"""Path → what opens an empty file to which its body is written as it arrives, since the computer of
a robot may lack the memory; may raise `BewareNavError`."""
_LABELS = re.compile("/api/v1/teach/frames/[0-9]{1,12}/labels")


async def bounded_body(
    scope: Scope, receive: Receive, spools: Spools
) -> bytes | BinaryIO | Response:
    """Return the whole body, as an open file where `spools` opens one, or the refusal of one that
    is too large, too slow or cut off. That of a stop is left unread: nothing in it could matter."""
    if scope["method"] in SAFE or scope["path"] == STOP:
        return b""
    path = "labels" if _LABELS.fullmatch(scope["path"]) else scope["path"]
    at_most, limit_s = BODY_LIMITS.get(path, (MAX_BODY_BYTES, BODY_TIMEOUT_S))
    length = Headers(scope=scope).get("content-length", "0")
    if not length.isdigit() or len(length) > 12 or int(length) > at_most:
        return _too_large(at_most)
    try:
        body = await asyncio.to_thread(spools[path]) if path in spools else io.BytesIO()
    except BewareNavError as error:
        return refusal(error)
    try:
        async with asyncio.timeout(limit_s):
            refused = await _receive(body, receive, at_most)
        await _beside(body, body.seek, 0)
    except TimeoutError:
        refused = problem(408, "too_slow", f"the body did not arrive within {limit_s:g} s", "body")
    except OSError as error:
        said = f"the body cannot be stored: {error.strerror or error}"
        refused = problem(503, "storage_failed", said, "body")
    if refused is None:
        return body.read() if isinstance(body, io.BytesIO) else body
    await close(body)
    return refused


async def close(body: BinaryIO) -> None:
    """Close the file of a body."""
    with suppress(OSError):  # on a full disk, of what is written at the close
        await _beside(body, body.close)


async def _beside(body: BinaryIO, act: Callable[..., object], *given: object) -> None:
    """Do something with a body; what is on the disk in a thread, so that no disk delays the event
    loop."""
    if isinstance(body, io.BytesIO):
        act(*given)
    else:
        await asyncio.to_thread(act, *given)


async def _receive(body: BinaryIO, receive: Receive, at_most: int) -> Response | None:
    """Write a body as it arrives; returns the refusal of one that is too large or cut off."""
    size = 0
    while True:
        message = await receive()
        part = message.get("body", b"")
        size += len(part)
        if size > at_most:
            return _too_large(at_most)
        if message["type"] != "http.request":
            return problem(400, "cut_off", "the connection ended before the body", "body")
        await _beside(body, body.write, part)
        if not message.get("more_body"):
            return None


def _too_large(at_most: int) -> Response:
    return problem(413, "too_large", f"a body may have at most {at_most} bytes", "body")


def replayed(body: bytes | BinaryIO, scope: Scope, receive: Receive) -> Receive:
    """Return a `receive` that gives a body that was read already; a file is in `body_file`."""
    scope[BODY_KEY] = body
    waiting = [body if isinstance(body, bytes) else b""]

    async def replay() -> Message:
        if waiting:
            return {"type": "http.request", "body": waiting.pop(), "more_body": False}
        return await receive()

    return replay


def body_file(request: Request) -> BinaryIO:
    """Return the file of a body that `Spools` name, open at its beginning until the request is
    answered."""
    return cast(BinaryIO, request.scope[BODY_KEY])
