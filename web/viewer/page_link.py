"""Which console page a viewer belongs to, and the thread-safe way from a click in the one to the
other."""

from __future__ import annotations

import asyncio
import re
import threading
from collections import deque
from dataclasses import dataclass, field
from typing import Any

PAGE_ID = re.compile(r"[a-z0-9]{16,64}")
"""Made by the page itself, at random; it names the page, it proves nothing."""
PAGE_ID_HEADER = "X-Console-Page"
MAX_WAITING = 64


class PageLink:
    """Messages for one page: posted from viser's thread, taken on the web server's loop. Old ones
    give way to new ones."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._waiting: deque[dict[str, Any]] = deque(maxlen=MAX_WAITING)
        self._ready = asyncio.Event()

    def post(self, message: dict[str, Any]) -> None:
        """From any thread."""
        self._waiting.append(message)
        try:
            self._loop.call_soon_threadsafe(self._ready.set)
        except RuntimeError:
            # The loop has ended, and the page with it.
            self._waiting.clear()

    async def next(self) -> dict[str, Any]:
        """The oldest message that waits."""
        while not self._waiting:
            self._ready.clear()
            await self._ready.wait()
        return self._waiting.popleft()


@dataclass(slots=True)
class PageLinks:
    """The pages that listen, by id."""

    _links: dict[str, PageLink] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def put(self, page_id: str, link: PageLink) -> None:
        """A page listens; one of the same id before it does no more."""
        with self._lock:
            self._links[page_id] = link

    def drop(self, page_id: str, link: PageLink) -> bool:
        """A page has gone; False when it has come back on another connection meanwhile."""
        with self._lock:
            present = self._links.get(page_id) is link
            if present:
                del self._links[page_id]
            return present

    def post(self, page_id: str, message: dict[str, Any]) -> None:
        """To the page, if it listens."""
        with self._lock:
            link = self._links.get(page_id)
        if link is not None:
            link.post(message)
