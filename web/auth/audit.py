"""Audit log: every request that may change something, with its outcome."""

from __future__ import annotations

import asyncio
import json
import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import datetime
from typing import Any, Protocol
from urllib.parse import quote

from starlette.types import Message, Scope, Send

from web.auth.permissions import LANGUAGE, RESET, SAFE, SILENT, STOP
from web.auth.roles import Visitor

log = logging.getLogger(__name__)

MAX_DETAIL_BYTES = 4000
"""Largest body that is logged, bytes."""
MAX_DEPTH = 20
"""Largest nesting of JSON that is logged."""
MOST_REFUSED, PERIOD_S = 200, 3600.0
"""Number of refused requests of a name, and of tries of its password from an address, that are
logged within a period in seconds: they push nothing that was done out of the log."""
MAX_COUNTED = 10_000
"""Largest number of names and addresses that are counted."""
REPEAT_PERIOD_S = 1.0
"""Time in seconds after a logged stop in which the same visitor's next ones, which change nothing,
are not logged; so for beginnings of driving by hand."""
MAX_WAITING = 1000
"""Largest number of stops that wait for the disk, and of entries of driving by hand."""
MAX_PATH = 400
"""Largest length of a logged path, and of its query, in characters."""
BODY_KEY = "bewarenav.body"
"""Key of the body, bytes or an open file, in the scope of a request, once it is read."""
_SECRET = ("/api/v1/users", "/api/v1/me")


class AuditLog(Protocol):
    """Storage of the audit log."""

    def add(self, entry: Mapping[str, Any]) -> int:
        """Store an entry with its date and return its id; raises `StorageFailed`."""

    def newest(
        self,
        count: int = 100,
        *,
        before: int | None = None,
        who: str | None = None,
        since: datetime | None = None,
        until: datetime | None = None,
    ) -> tuple[dict[str, Any], ...]:
        """Return entries, newest first, each with `id` and `at`: those before an id, of one
        visitor, between two times."""


class _Limit:
    """Limit of the entries of a kind for which no request waits: they come by the thousand over an
    open connection."""

    def __init__(self) -> None:
        self.places = threading.BoundedSemaphore(MAX_WAITING)
        """Places of those that wait for the disk."""
        self.noted_s: dict[object, float] = {}
        """Time of the last entry of each key, seconds."""

    def is_repeated(self, key: object, now_s: float) -> bool:
        """Return whether an entry of a key was noted just before."""
        self.noted_s = {
            other: at_s for other, at_s in self.noted_s.items() if now_s - at_s < REPEAT_PERIOD_S
        }
        return key in self.noted_s


class Auditor:
    """Writer of the audit log; it writes in a thread, so that no disk delays the event loop, in the
    order in which it is asked."""

    def __init__(
        self, audit_log: AuditLog | None, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.audit_log = audit_log
        self._thread = ThreadPoolExecutor(1, "audit log")
        self._clock = clock
        self._refused: OrderedDict[tuple[str, str], tuple[float, int]] = OrderedDict()
        """Of each name and address the end of the period, and the number of entries in it."""
        self._stops, self._drives = _Limit(), _Limit()

    def watching(self, send: Send, scope: Scope, visitor: Visitor) -> Send:
        """Return a `send` that logs the request before its answer, and the emergency stop after the
        beginning of its answer, none of which waits for the disk."""
        if self.audit_log is None or scope["method"] in SAFE or scope["path"] in SILENT:
            return send

        async def watched(message: Message) -> None:
            first, is_stop = message["type"] == "http.response.start", scope["path"] == STOP
            if first and not is_stop:
                if scope["path"] == RESET and message["status"] < 400:
                    self._stops.noted_s.clear()  # the next stop changes something again
                await self.note(_entry(scope, visitor, message["status"]))
            await send(message)
            if first and is_stop:
                self.note_stop(_entry(scope, visitor, message["status"]))

        return watched

    async def note(self, entry: Mapping[str, Any]) -> None:
        """Log an entry of a request, unless too many were refused; return when it is stored. A
        failed disk is no reason to refuse the request."""
        counted = self._counted(entry)
        if counted is not None:
            await asyncio.wrap_future(self._thread.submit(self._add, counted))

    def note_stop(self, entry: Mapping[str, Any]) -> Future[None] | None:
        """Log a stop, but for one that repeats another; see `_later`."""
        return self._later(entry, self._stops, (entry.get("who"), entry.get("status")))

    def note_driving(self, entry: Mapping[str, Any], *, begins: bool) -> Future[None] | None:
        """Log that a visitor begins to drive by hand, at most once in `REPEAT_PERIOD_S`, or ends it
        after a logged beginning; see `_later`."""
        return self._later(entry, self._drives, (entry.get("who"),) if begins else None)

    def _later(
        self, entry: Mapping[str, Any], limit: _Limit, key: tuple[object, ...] | None
    ) -> Future[None] | None:
        """Log an entry and return at once what waits for the disk; None for one that is not logged,
        because it repeats another of its key or too many wait."""
        now_s = self._clock()
        if key is not None and limit.is_repeated(key, now_s):
            return None
        if not limit.places.acquire(blocking=False):
            missed = "missed", key
            if not limit.is_repeated(missed, now_s):
                limit.noted_s[missed] = now_s
                log.error("the disk is too slow; the audit log misses an entry: %s", dict(entry))
            return None
        if key is not None:
            limit.noted_s[key] = now_s
        noted = self._thread.submit(self._add, entry)
        noted.add_done_callback(lambda _: limit.places.release())
        return noted

    def _add(self, entry: Mapping[str, Any]) -> None:
        try:
            if self.audit_log is not None:
                self.audit_log.add(entry)
        except Exception:
            log.exception("the audit log misses an entry: %s", dict(entry))

    def _counted(self, entry: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """Return the entry of a request, or None for one of too many that were refused or choose a
        language; the last one says so."""
        if entry.get("status", 200) < 400 and entry.get("path") != LANGUAGE:
            return entry
        key, now = (str(entry.get("who")), str(entry.get("from", ""))), self._clock()
        until, number = self._refused.get(key, (now + PERIOD_S, 0))
        if now >= until:
            until, number = now + PERIOD_S, 0
        self._refused[key] = until, number + 1
        self._refused.move_to_end(key)
        while len(self._refused) > MAX_COUNTED:
            self._refused.popitem(last=False)
        if number + 1 < MOST_REFUSED:
            return entry
        last = f"the last of {MOST_REFUSED} that are logged within {PERIOD_S / 60:.0f} minutes"
        return None if number >= MOST_REFUSED else {**entry, "note": last}


def _entry(scope: Scope, visitor: Visitor, status: int) -> dict[str, Any]:
    query = scope["query_string"][:MAX_PATH].decode("latin-1")
    # As in an address: names may have any character. Cut before it is quoted: a quoted name may
    # have 1000 characters, and what was done with it comes after it.
    path = quote(scope["path"][:MAX_PATH]) + (f"?{query}" if query else "")
    entry = {
        "who": visitor.name,
        "role": str(visitor.role),
        "method": scope["method"],
        "path": path,
        "status": status,
    }
    body = scope.get(BODY_KEY)
    if body and isinstance(body, bytes) and not scope["path"].startswith(_SECRET):
        entry["detail"] = _detail(body)
    return entry


def _detail(body: bytes) -> Any:
    if len(body) > MAX_DETAIL_BYTES:
        return f"{len(body)} bytes"
    try:
        # Only a body that can be written as JSON again is logged as it was sent.
        detail = json.loads(body)
        json.dumps(detail, allow_nan=False).encode()
    except (ValueError, RecursionError):
        return f"{len(body)} bytes that are not JSON"
    return f"{len(body)} bytes, nested too deep" if is_deep(detail) else detail


def is_deep(value: Any) -> bool:
    """Return whether JSON is nested deeper than a reader of the log could encode."""
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
