"""`WS /api/v1/events`: the state at 10 Hz and on every change. Each client gets the newest value,
never a queue of old ones."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, WebSocket

from web.gateway.websockets import until_gone, until_one_ends
from web.interface.operations import RobotService
from web.interface.snapshots import State
from web.schemas.convert import state_of

LOOK_S = 0.025
"""How often a change is looked for; a snapshot is one attribute read."""
PERIOD_S = 0.1
"""Longest time between two messages."""


def events_router(operations: RobotService) -> APIRouter:
    """The websocket below `/api/v1`."""
    router = APIRouter()

    @router.websocket("/events")
    async def events(socket: WebSocket) -> None:
        """The state, again and again, until the client goes."""
        await socket.accept()
        await until_one_ends(_send(socket, operations), until_gone(socket))

    return router


async def _send(socket: WebSocket, operations: RobotService) -> None:
    clock = asyncio.get_running_loop().time
    sent_at, sent = -PERIOD_S, None
    while True:
        notable = _notable(operations.state())
        if notable != sent or clock() - sent_at >= PERIOD_S:
            sent_at, sent = clock(), notable
            # A slow client holds up its own coroutine only, and then gets what is newest.
            await socket.send_text(state_of(operations).model_dump_json())
        await asyncio.sleep(LOOK_S)


def _notable(state: State) -> tuple[Any, ...]:
    """What must reach the operator at once, not at the next turn."""
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
