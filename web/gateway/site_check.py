"""Header of a request that names the site whose map it is meant for: where the robot is at another
one by now, a zone or a goal would be somewhere else. It is checked before the handler, and again
where the edit is made."""

from __future__ import annotations

import re
from collections.abc import Callable

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from navcore.errors import OtherSite
from web.auth.permissions import SAFE
from web.gateway.problems import refusal
from web.interface.meant_site import mean_site, require_meant_site

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
        mean_site(None if named is None else lambda: self._present() == named)
        try:
            require_meant_site()
        except OtherSite as error:
            await refusal(error)(scope, receive, send)
        else:
            await self._app(scope, receive, send)
