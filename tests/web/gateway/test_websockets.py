"""A connection that is closed is no error, whatever says so."""

from __future__ import annotations

import asyncio

import pytest
from fastapi import WebSocketDisconnect

from web.gateway.websockets import until_one_ends

CLOSED = RuntimeError("Unexpected ASGI message 'websocket.send', after sending 'websocket.close'.")


async def ending(error: Exception) -> None:
    raise error


@pytest.mark.parametrize("error", [WebSocketDisconnect(), CLOSED])
def test_a_closed_connection_ends_both_directions(error: Exception) -> None:
    asyncio.run(until_one_ends(ending(error), asyncio.sleep(60.0)))


@pytest.mark.parametrize(
    "text", ["a bug", 'Expected ASGI message "websocket.send" or "websocket.close", but got x']
)
def test_a_fault_is_an_error(text: str) -> None:
    with pytest.raises(RuntimeError, match=text):
        asyncio.run(until_one_ends(ending(RuntimeError(text)), asyncio.sleep(60.0)))
