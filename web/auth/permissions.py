"""Required role of each request, and control of the robot for those that drive it.

The guard checks it before any handler runs. A request that changes something and is not listed
needs an operator, so that a new route is closed to viewers by default.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from web.auth.roles import Role

_API = "/api/v1"
SAFE = ("GET", "HEAD", "OPTIONS")
STOP = f"{_API}/stop"
LOGOUT = "/logout"
_BY_ANYONE = {
    ("POST", STOP),
    ("POST", f"{_API}/preview"),
    ("POST", f"{_API}/explain"),
    ("POST", LOGOUT),
    ("PUT", f"{_API}/me/language"),
    ("PUT", f"{_API}/me/password"),
}
_ADMINS = re.compile(rf"{_API}/users(/|$)")
_OPERATORS = re.compile(rf"{_API}/(audit(/|$)|teach/frames\.zip$)")
"""Reads that tell of users, and those that are work for the computer of the robot."""
_DRIVES = re.compile(
    rf"{_API}/(goals(/.*)?|mission(/.*)?|stop/reset|missions/.+/load|sites/.+/choose"
    r"|localisation/search)/?"
)
_NEEDS_NO_CONTROL = {f"{_API}/mission/pause"}
"""Stopping is always allowed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirement:
    """Requirement of a request."""

    role: Role
    """Least role."""
    control: bool = False
    """Whether the visitor must be in control, because the request drives the robot."""


def requirement_of(method: str, path: str) -> Requirement:
    """Return the requirement of a method and path; a websocket counts as GET, its handler checks
    the messages."""
    if _ADMINS.match(path):
        return Requirement(role=Role.ADMIN)
    if method in SAFE:
        return Requirement(role=Role.OPERATOR if _OPERATORS.match(path) else Role.VIEWER)
    if (method, path) in _BY_ANYONE:
        return Requirement(role=Role.VIEWER)
    drives = _DRIVES.fullmatch(path) is not None and path not in _NEEDS_NO_CONTROL
    return Requirement(role=Role.OPERATOR, control=drives)
