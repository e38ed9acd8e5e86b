"""The page that answers on the console's port while the console starts, which takes up to minutes
the first time. Imports no slow package."""

from __future__ import annotations

import html
import select
import socket
import threading
import time
from contextlib import suppress
from types import TracebackType

_POLL_S, _READ_S = 0.05, 1.0
"""Time between two checks for the end, and longest wait for a request, seconds."""
_REQUEST_BYTES = 16_384
"""Largest request that is read; of a larger one only the beginning is."""
_PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>The console is starting</title>
<h1>The console is starting</h1>
<p>{step}</p>
<p>This page changes to the console by itself.</p>
</html>
"""
_HEADERS = (
    "HTTP/1.1 503 Service Unavailable",
    "Content-Type: text/html; charset=utf-8",
    "Retry-After: 1",
    "Refresh: 1",
    "Cache-Control: no-store",
    "Content-Security-Policy: default-src 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options: nosniff",
    "Connection: close",
)


class StartingPage:
    """Answers every request with 503 and the step that the start waits for, until it is ended;
    what connects later waits for the console. A context that ends with its body."""

    def __init__(self, listener: socket.socket) -> None:
        """`listener` is a listening socket, which stays open at the end."""
        self._listener, self._step = listener, "Loading the program …"
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="starting page", daemon=True)

    def __enter__(self) -> StartingPage:
        """Answer from now on."""
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End."""
        self.end()

    def say(self, step: str) -> None:
        """Show a line about what the start waits for."""
        self._step = step

    def end(self) -> None:
        """Answer no more; may be called again."""
        self._ended.set()
        self._thread.join()

    def _serve(self) -> None:
        while not self._ended.is_set():
            if select.select([self._listener], [], [], _POLL_S)[0]:
                # A browser that goes away ends its own connection and nothing else.
                with suppress(OSError):
                    self._answer(self._listener.accept()[0])

    def _answer(self, connection: socket.socket) -> None:
        with connection:
            until_s = time.monotonic() + _READ_S
            request = b""
            while b"\r\n\r\n" not in request and len(request) < _REQUEST_BYTES:
                # For the whole request: a client that sends a byte now and then holds up no start.
                connection.settimeout(max(until_s - time.monotonic(), 0.001))
                more = connection.recv(_REQUEST_BYTES)
                if not more:
                    return
                request += more
            body = _PAGE.format(step=html.escape(self._step)).encode()
            head = "\r\n".join((*_HEADERS, f"Content-Length: {len(body)}", "", ""))
            connection.sendall(head.encode() + body)
