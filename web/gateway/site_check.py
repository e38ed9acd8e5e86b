"""Header of a request that names the site whose map it is meant for: where the robot is at another
one by now, a zone or a goal would be somewhere else."""

from __future__ import annotations

import re
from collections.abc import Callable

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from web.auth.permissions import SAFE
from web.gateway.problems import problem
from web.interface.sites import at_another_site

HEADER = "Site-Id"
_ANYWHERE = re.compile(r"/api/v1/(stop(/.*)?|mission/(pause|cancel)|control/.*|me/.*|teach/.*)")
"""What holds wherever the robot is, most of all its stop; nothing that is taught lies on a map."""


class SiteCheck:
    """ASGI middleware; see the module."""

    def __init__(self, app: ASGIApp, present: Callable[[], str]) -> None:
        """`present` returns the id of the site in use."""
        self._app, self._present = app, present

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; with 409 if it would change something and names another site."""
        is_edit = scope["type"] == "http" and scope["method"] not in SAFE
        named = Headers(scope=scope).get(HEADER) if is_edit else None
        if named is not None and _ANYWHERE.fullmatch(scope["path"]):
            named = None
        answer = (
            self._app
            if named is None or named == self._present()
            else problem(409, "other_site", str(at_another_site()), HEADER)
        )
        await answer(scope, receive, send)
