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
STOP_PERIOD_S = 1.0
"""Time in seconds after a logged stop in which the same visitor's next ones, which change nothing,
are not logged: they come by the thousand over an open connection."""
MAX_WAITING = 1000
"""Largest number of entries for which no request waits that wait for the disk."""
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
        self._stopped: dict[tuple[object, object], float] = {}
        """Times of the last logged stops of each visitor and outcome, since the last reset."""
        self._room = threading.BoundedSemaphore(MAX_WAITING)

    def watching(self, send: Send, scope: Scope, visitor: Visitor) -> Send:
        """Return a `send` that logs the request before its answer, and the emergency stop after the
        beginning of its answer, none of which waits for the disk."""
        if self.audit_log is None or scope["method"] in SAFE or scope["path"] in SILENT:
            return send

        async def watched(message: Message) -> None:
            first, is_stop = message["type"] == "http.response.start", scope["path"] == STOP
            if first and not is_stop:
                await self.note(_entry(scope, visitor, message["status"]))
            await send(message)
            if first and is_stop:
                self.note_later(_entry(scope, visitor, message["status"]))

        return watched

    async def note(self, entry: Mapping[str, Any]) -> None:
        """Log an entry; return when it is stored. A failed disk is no reason to refuse the
        request."""
        if _address(entry) == RESET:  # the next stop changes something again
            self._stopped.clear()
        await asyncio.wrap_future(self._thread.submit(self._add, entry))

    def note_later(self, entry: Mapping[str, Any]) -> Future[None]:
        """Log an entry, but for a stop that repeats one, and while too many wait; return at
        once."""
        noted = Future[None]()
        if self._repeats(entry):
            noted.set_result(None)
        elif self._room.acquire(blocking=False):
            noted = self._thread.submit(self._add, entry)
            noted.add_done_callback(lambda _: self._room.release())
        else:
            log.error("the disk is too slow; the audit log misses an entry: %s", dict(entry))
            noted.set_result(None)
        return noted

    def _repeats(self, entry: Mapping[str, Any]) -> bool:
        """Return whether an entry is a stop like the one that the same visitor made just before."""
        if not _is_stop(entry):
            return False
        key, now = (entry.get("who"), entry.get("status")), self._clock()
        self._stopped = {kept: at for kept, at in self._stopped.items() if now - at < STOP_PERIOD_S}
        if key in self._stopped:
            return True
        self._stopped[key] = now
        return False

    def _add(self, entry: Mapping[str, Any]) -> None:
        if self.audit_log is None or (counted := self._counted(entry)) is None:
            return
        try:
            self.audit_log.add(counted)
        except Exception:
            log.exception("the audit log misses an entry: %s", dict(entry))

    def _counted(self, entry: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """Return the entry, or None for one of too many that were refused or choose a language; the
        last one says so. A stop is none of these."""
        is_refused = entry.get("status", 200) >= 400 and not _is_stop(entry)
        if not is_refused and entry.get("path") != LANGUAGE:
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


def _address(entry: Mapping[str, Any]) -> str:
    return str(entry.get("path")).partition("?")[0]


def _is_stop(entry: Mapping[str, Any]) -> bool:
    return _address(entry) in (STOP, "stop")


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
