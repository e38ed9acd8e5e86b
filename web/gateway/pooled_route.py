"""Routes that run wholly in the server's pool, with the reading of their bodies and the writing of
their answers: FastAPI has only the handler run there, and the emergency stop would wait for the
rest on the event loop."""

from __future__ import annotations

import asyncio
import functools
import gc
import inspect
import json
import threading
from collections.abc import Callable, Coroutine
from contextlib import nullcontext
from typing import Any, TypeVar

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.concurrency import run_in_threadpool

from web.schemas.fields import hand_over

Handler = TypeVar("Handler", bound=Callable[..., Any])
LARGE_BYTES = 1_000_000
"""Size of a body in bytes from which its many values keep the garbage collector busy."""


_SINGLE = "_is_single"
"""Attribute of a handler that does one request at a time."""


def one_at_a_time(handler: Handler) -> Handler:
    """Have the requests to a handler that does one at a time wait for that before the pool, whose
    threads they would keep from all others."""
    setattr(handler, _SINGLE, True)
    return handler


class PooledRoute(APIRoute):
    """Route whose plain function runs in the pool from the body of the request, which has arrived,
    to the answer. A coroutine function runs on the event loop as ever."""

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        self._is_plain = not inspect.iscoroutinefunction(endpoint)
        self._turn = asyncio.Lock() if hasattr(endpoint, _SINGLE) else nullcontext()
        super().__init__(path, _as_coroutine(endpoint) if self._is_plain else endpoint, **options)

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers a request."""
        handle = super().get_route_handler()

        async def pooled(request: Request) -> Response:
            arrived = _Arrived(request.scope, request.receive)
            is_large = len(await arrived.body()) > LARGE_BYTES
            async with self._turn:
                with _uncollected if is_large else nullcontext():
                    return await run_in_threadpool(_result, handle(arrived))

        return pooled if self._is_plain else handle


class _Arrived(Request):
    """Request whose body has arrived."""

    async def json(self) -> Any:
        """Return the value of the body."""
        return json.loads(
            await self.body(), object_hook=hand_over, parse_int=_int, parse_float=_float
        )


def _int(digits: str) -> int:
    """Return an integer as the reader of JSON does, but see `hand_over`."""
    return int(digits)


def _float(digits: str) -> float:
    """Return a number as the reader of JSON does, but see `hand_over`."""
    return float(digits)


class _Uncollected:
    """Keeps the garbage collector, which holds up all threads, from looking through the new values
    of large bodies again and again while they are made, and once more while they live: until the
    last of the requests that came with them is answered."""

    def __init__(self) -> None:
        self._lock, self._bodies = threading.Lock(), 0

    def __enter__(self) -> None:
        with self._lock:
            self._bodies += 1
            gc.disable()

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._bodies -= 1
            if not self._bodies:
                gc.enable()


_uncollected = _Uncollected()


def _as_coroutine(function: Callable[..., Any]) -> Callable[..., Coroutine[Any, Any, Any]]:
    """Return a function as FastAPI runs it where it is, instead of in the pool once more."""

    @functools.wraps(function)
    async def run(*args: Any, **named: Any) -> Any:
        return function(*args, **named)

    return run


def _result(coroutine: Coroutine[Any, Any, Response]) -> Response:
    """Return the result of a coroutine that waits for nothing."""
    try:
        coroutine.send(None)
    except StopIteration as ended:
        return ended.value  # type: ignore[no-any-return]
    coroutine.close()
    raise RuntimeError("a route of the pool waits for the event loop")
