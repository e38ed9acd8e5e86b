"""Websockets with two directions: when one ends, both end, and only a fault is an error."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

from fastapi import WebSocket, WebSocketDisconnect
from websockets.exceptions import ConnectionClosed

GOING_AWAY, BAD_MESSAGE, POLICY_VIOLATION, TRY_AGAIN = 1001, 1007, 1008, 1013
"""Close codes of RFC 6455 and its registry."""
_AFTER_CLOSE = "after sending 'websocket.close'", "once a close message has been sent"


async def until_one_ends(*directions: Coroutine[Any, Any, None]) -> None:
    """Run all coroutines; when the first ends, cancel the others.

    Raises its error, unless it only reports that the other side has closed the connection.
    """
    tasks = [asyncio.create_task(direction) for direction in directions]
    try:
        ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in ended:
        error = task.exception()
        if error is not None and not _is_closed(error):
            raise error


def _is_closed(error: BaseException) -> bool:
    """Return whether an error says that the connection was closed, by either side."""
    if isinstance(error, WebSocketDisconnect | ConnectionClosed):
        return True
    # The server raises no class of its own for what is sent in the moment of the close.
    return isinstance(error, RuntimeError) and any(text in str(error) for text in _AFTER_CLOSE)


async def until_gone(socket: WebSocket) -> None:
    """Read and drop all messages until the client closes the connection."""
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass
