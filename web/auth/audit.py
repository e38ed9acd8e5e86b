"""Who did what: every request that may change something is put down, with its outcome."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Protocol

from starlette.types import Message, Scope, Send

from web.auth.permissions import SAFE, STOP
from web.auth.roles import Visitor

log = logging.getLogger(__name__)

MAX_DETAIL_BYTES = 4000
MAX_DEPTH = 20
_SILENT = {"/api/v1/preview"}
_SECRET = ("/api/v1/users", "/api/v1/me")


class AuditLog(Protocol):
    """Where it is put down."""

    def add(self, entry: Mapping[str, Any]) -> int:
        """Keep an entry, dated; raises `StorageFailed`."""

    def newest(
        self,
        count: int = 100,
        *,
        before: int | None = None,
        who: str | None = None,
        since: datetime | None = None,
        until: datetime | None = None,
    ) -> tuple[dict[str, Any], ...]:
        """Entries, newest first, each with `id` and `at`; older than the id `before`, by `who`, put
        down between two times."""


class Auditor:
    """Puts things down in a thread of its own kind, so that no disk holds up the loop."""

    def __init__(self, audit_log: AuditLog | None) -> None:
        self.audit_log = audit_log

    def watching(self, send: Send, scope: Scope, visitor: Visitor, body: bytes) -> Send:
        """A `send` that puts the request down before its answer goes out, and the emergency stop
        right after it."""
        if self.audit_log is None or scope["method"] in SAFE or scope["path"] in _SILENT:
            return send

        async def watched(message: Message) -> None:
            first = message["type"] == "http.response.start"
            if first and scope["path"] != STOP:
                await self.note(_entry(scope, visitor, body, message["status"]))
            await send(message)
            if first and scope["path"] == STOP:
                await self.note(_entry(scope, visitor, body, message["status"]))

        return watched

    async def note(self, entry: Mapping[str, Any]) -> None:
        """Put it down; a disk that does not take it is no reason to refuse what was done."""
        if self.audit_log is None:
            return
        try:
            await asyncio.to_thread(self.audit_log.add, entry)
        except Exception:
            log.exception("the audit has a gap: %s", dict(entry))


def _entry(scope: Scope, visitor: Visitor, body: bytes, status: int) -> dict[str, Any]:
    query = scope["query_string"].decode("latin-1")
    path = f"{scope['path']}?{query}" if query else scope["path"]
    entry = {
        "who": visitor.name,
        "role": str(visitor.role),
        "method": scope["method"],
        "path": path[:400],
        "status": status,
    }
    if body and not scope["path"].startswith(_SECRET):
        entry["detail"] = _detail(body)
    return entry


def _detail(body: bytes) -> Any:
    if len(body) > MAX_DETAIL_BYTES:
        return f"{len(body)} bytes"
    try:
        # Only what can be written again as JSON is kept as it was sent.
        detail = json.loads(body)
        json.dumps(detail, allow_nan=False).encode()
    except (ValueError, RecursionError):
        return f"{len(body)} bytes that are no JSON"
    return f"{len(body)} bytes, nested too deep" if is_deep(detail) else detail


def is_deep(value: Any) -> bool:
    """Whether JSON nests deeper than anybody means, or can be written again for who asks."""
    layer = [value]
    for _ in range(MAX_DEPTH):
        nested = [
            one.values() if isinstance(one, dict) else one
            for one in layer
            if isinstance(one, dict | list)
        ]
        layer = [inner for values in nested for inner in values]
        if not layer:
            return False
    return True
