"""Header of an answer that names the edit which its request has made, so that this one alone can be
undone."""

from __future__ import annotations

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from web.interface.own_edits import collected_edits

HEADER = "Undo-Number"


class UndoNumber:
    """ASGI middleware; see the module."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; with the header if it has made an edit."""
        made = collected_edits()

        async def numbered(message: Message) -> None:
            if message["type"] == "http.response.start" and made:
                MutableHeaders(scope=message)[HEADER] = str(made[-1])
            await send(message)

        await self._app(scope, receive, numbered)
