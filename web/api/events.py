"""`WS /api/v1/events`: the state at 10 Hz and on every change. A client gets the newest value,
never a queue of old ones."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, WebSocket
from pydantic import TypeAdapter

from web.api.router import api_router
from web.gateway.websockets import until_gone, until_one_ends
from web.interface.operations import RobotService
from web.interface.snapshots import State

POLL_S = 0.025
"""Period of the search for changes, seconds; a snapshot is cheap to read."""
PERIOD_S = 0.1
"""Longest time between two messages, seconds."""
_STATE = TypeAdapter(State)


def events_router(operations: RobotService) -> APIRouter:
    """Return the websocket below `/api/v1`."""
    router = api_router()

    @router.websocket("/events")
    async def events(socket: WebSocket) -> None:
        """Send the state until the client closes the connection."""
        await socket.accept()
        await until_one_ends(_send(socket, operations), until_gone(socket))

    return router


async def _send(socket: WebSocket, operations: RobotService) -> None:
    clock = asyncio.get_running_loop().time
    sent_at, sent = -PERIOD_S, None
    while True:
        state = operations.state()
        notable = _notable(state)
        if notable != sent or clock() - sent_at >= PERIOD_S:
            sent_at, sent = clock(), notable
            # A slow client delays its own coroutine only, and then gets the newest state.
            await socket.send_text(_STATE.dump_json(state).decode())
        await asyncio.sleep(POLL_S)


def _notable(state: State) -> tuple[Any, ...]:
    """Return the values whose changes must reach the operator at once."""
    return (
        state.phase,
        state.moving,
        state.stop_latched,
        tuple(reason.cause for reason in state.reasons),
        state.queue,
        state.reached,
        state.zones_version,
        state.beware_version,
        state.in_zone,
    )
