"""Roles, each with the rights of the one before it and more, and authenticated visitors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from web.interface.beware import OPERATOR


class Role(StrEnum):
    """Rights of a user."""

    VIEWER = "viewer"
    """May look, and stop the robot."""
    OPERATOR = "operator"
    """May drive, and edit zones and the beware list."""
    ADMIN = "admin"
    """May manage users."""

    def may(self, needed: Role) -> bool:
        """Return whether this role includes another."""
        ranks = list(Role)
        return ranks.index(self) >= ranks.index(needed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Visitor:
    """Authenticated origin of a request."""

    name: str
    """Name on all screens and in the audit log."""
    role: Role
    """Rights of the visitor."""
    client_id: str
    """Id of the browser or program; control of the robot belongs to one client."""
    logged_in: bool = True
    """Whether the visitor has logged in; False on a console without users."""
    language: str | None = field(default=None, compare=False)
    """Language that the user has chosen; None without a choice, and without a log-in."""

    @property
    def signature(self) -> str:
        """Name in the event log and in the history of edits; a console without users has none."""
        return self.name if self.logged_in else OPERATOR


SCOPE_KEY = "bewarenav.visitor"
"""Key of the visitor in the ASGI scope, set by the guard."""


async def _visitor(connection: HTTPConnection) -> Visitor:
    # A coroutine: a plain function, and the emergency stop with it, would wait for a thread of the
    # pool.
    visitor: Visitor = connection.scope[SCOPE_KEY]
    return visitor


CurrentVisitor = Annotated[Visitor, Depends(_visitor)]
"""Parameter of a handler: the visitor."""
RENEWAL_KEY = "bewarenav.renewal"
"""Key in the scope of a websocket, set by the guard, of what a handler calls for a message that the
visitor sends deliberately: the session is not idle."""


async def _renewal(socket: HTTPConnection) -> Callable[[], object]:
    renew: Callable[[], object] = socket.scope[RENEWAL_KEY]
    return renew


SessionRenewal = Annotated[Callable[[], object], Depends(_renewal)]
"""Parameter of the handler of a websocket: renews the visitor's session."""
