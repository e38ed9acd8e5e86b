"""Links from the 3D view to the console pages, safe from any thread."""

from __future__ import annotations

import asyncio
import re
import threading
from collections import deque
from dataclasses import dataclass, field
from typing import Any

PAGE_ID = re.compile(r"[a-z0-9]{16,64}")
"""Random id that a page makes for itself; it names the page and proves nothing."""
PAGE_ID_HEADER, SECRET_HEADER = "X-Console-Page", "X-Console-Secret"
"""Headers of the relay to viser's server: the page, and what only this console knows."""
MAX_WAITING = 64
"""Largest number of messages that wait for a page."""


class PageLink:
    """Messages for one page: posted by viser's thread, taken by the web server's event loop; beyond
    `MAX_WAITING`, the oldest is dropped."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._waiting: deque[dict[str, Any]] = deque(maxlen=MAX_WAITING)
        self._ready = asyncio.Event()

    def post(self, message: dict[str, Any]) -> None:
        """Queue a message, from any thread."""
        self._waiting.append(message)
        try:
            self._loop.call_soon_threadsafe(self._ready.set)
        except RuntimeError:
            # The event loop has ended.
            self._waiting.clear()

    async def next(self) -> dict[str, Any]:
        """Wait for the oldest message and return it."""
        while not self._waiting:
            self._ready.clear()
            await self._ready.wait()
        return self._waiting.popleft()


@dataclass(slots=True)
class PageLinks:
    """Links of the connected pages, by id."""

    _links: dict[str, PageLink] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def put(self, page_id: str, link: PageLink) -> None:
        """Connect a page, replacing a link of the same id."""
        with self._lock:
            self._links[page_id] = link

    def drop(self, page_id: str, link: PageLink) -> bool:
        """Disconnect a page; return False when it has reconnected meanwhile."""
        with self._lock:
            present = self._links.get(page_id) is link
            if present:
                del self._links[page_id]
            return present

    def post(self, page_id: str, message: dict[str, Any]) -> None:
        """Post a message to a page, if it is connected."""
        with self._lock:
            link = self._links.get(page_id)
        if link is not None:
            link.post(message)
