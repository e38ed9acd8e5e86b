"""The page that answers on the console's port while the console starts, which takes up to minutes
the first time, in the language of the browser. Imports no slow package."""

from __future__ import annotations

import html
import select
import socket
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from starlette.datastructures import Headers

from web.languages.catalog import CATALOGS, language_of

_POLL_S, _READ_S = 0.05, 1.0
"""Time between two checks for the end, and longest wait for a request, seconds."""
_REQUEST_BYTES = 16_384
"""Largest request that is read; of a larger one only the beginning is."""
_SOURCE = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")
_PAGES = {
    language: catalog.page(_SOURCE).replace('lang="en"', f'lang="{language}"')
    for language, catalog in CATALOGS.items()
}
_HEADERS = (
    "HTTP/1.1 503 Service Unavailable",
    "Content-Type: text/html; charset=utf-8",
    "Retry-After: 1",
    # With an address, or a browser stays where it is: to load "/#map" again is to move to "#map".
    "Refresh: 1; url=/",
    "Cache-Control: no-store",
    "Content-Security-Policy: default-src 'none'; style-src 'unsafe-inline'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options: nosniff",
    "Connection: close",
)


LOADING_PROGRAM = "Loading the program"
"""First step of a start."""


@dataclass(frozen=True, slots=True)
class _Step:
    """A step that goes on."""

    line: str
    share: float | None = None

    def html(self, sentences: Mapping[str, str]) -> str:
        step, mark, figures = self.line.partition(" …")
        said = html.escape(sentences.get(step, step) + mark + figures)
        if self.share is None:
            return f"<p>{said}</p>"
        return f'<p><label>{said}<br><progress value="{self.share:.2f}"></progress></label></p>'


class StartingPage:
    """Answers every request with 503 and the step that the start waits for, until it is ended;
    what connects later waits for the console. A context that ends with its body."""

    def __init__(self, listener: socket.socket) -> None:
        """`listener` is a listening socket, which stays open at the end."""
        self._listener = listener
        self._steps = {LOADING_PROGRAM: _Step(f"{LOADING_PROGRAM} …")}
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

    def say(
        self, step: str, line: str, share: float | None = None, *, is_over: bool = False
    ) -> None:
        """Show a step that the start waits for until it is over, beside the others: a line of its
        name, "…" and figures, and a bar where the share that is done, 0 to 1, is known."""
        steps = {name: shown for name, shown in self._steps.items() if name != LOADING_PROGRAM}
        steps.pop(step, None) if is_over else steps.update({step: _Step(line, share)})
        self._steps = steps  # another thread reads the old one

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
            body = _page(request, list(self._steps.values()))
            head = "\r\n".join((*_HEADERS, f"Content-Length: {len(body)}", "", ""))
            connection.sendall(head.encode() + body)


def _page(request: bytes, steps: Sequence[_Step]) -> bytes:
    """Return the page with the steps in the language that a request asks for."""
    fields = (field.partition(b":") for field in request.split(b"\r\n")[1:])
    headers = Headers(raw=[(name.strip().lower(), value.strip()) for name, _, value in fields])
    language = language_of(headers)
    shown = "\n".join(step.html(CATALOGS[language].sentences) for step in steps)
    return _PAGES[language].replace("<!--steps-->", shown).encode()
