"""Roles, each of which may do what the one before it may and more; and a visitor, as the door has
recognised him."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection


class Role(StrEnum):
    """What somebody may do."""

    VIEWER = "viewer"
    """Look, and stop the robot."""
    OPERATOR = "operator"
    """Drive, edit zones and the beware list."""
    ADMIN = "admin"
    """Decide who else may."""

    def may(self, needed: Role) -> bool:
        """Whether this role includes another."""
        ranks = list(Role)
        return ranks.index(self) >= ranks.index(needed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Visitor:
    """Who a request comes from."""

    name: str
    """What he is called on every screen and in the audit."""
    role: Role
    """What he may do."""
    client_id: str
    """Where he sits: a browser that is logged in, or a program. Control of the robot belongs to a
    seat."""
    logged_in: bool = True
    """Whether he has said who he is; in an open house nobody has."""


SCOPE_KEY = "bewarenav.visitor"
"""Where the door leaves the visitor in the ASGI scope."""


async def _visitor(connection: HTTPConnection) -> Visitor:
    # A coroutine on purpose: a plain function would wait for a thread of the pool, and the
    # emergency stop with it.
    visitor: Visitor = connection.scope[SCOPE_KEY]
    return visitor


CurrentVisitor = Annotated[Visitor, Depends(_visitor)]
"""For handlers: who asks."""
