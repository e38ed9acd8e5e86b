"""Websockets with two directions: when one ends, both end, and only a fault is an error."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

from fastapi import WebSocket, WebSocketDisconnect
from websockets.exceptions import ConnectionClosed


async def until_one_ends(*ways: Coroutine[Any, Any, None]) -> None:
    """Run all; when the first ends, cancel the others. Raises its error, unless it only says that
    the other side has gone."""
    tasks = [asyncio.create_task(way) for way in ways]
    try:
        ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in ended:
        error = task.exception()
        if error is not None and not isinstance(error, WebSocketDisconnect | ConnectionClosed):
            raise error


async def until_gone(socket: WebSocket) -> None:
    """Read and forget, until the client goes: nothing it says here has a meaning."""
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass
