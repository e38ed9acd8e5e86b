"""Required role of each request, and control of the robot for those that drive it.

The guard checks it before any handler runs. A request that changes something and is not listed
needs an operator, so that a new route is closed to viewers by default.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from pydantic import TypeAdapter, ValidationError
from starlette.datastructures import QueryParams

from web.auth.roles import Role

_API = "/api/v1"
SAFE = ("GET", "HEAD", "OPTIONS")
STOP = f"{_API}/stop"
RESET = f"{STOP}/reset"
LOGOUT = "/logout"
POSE = f"{_API}/pose"
LANGUAGE = f"{_API}/me/language"
_DRAFTS = (
    "preview",
    "explain",
    "beware/preview",
    "beware/colour",
    "beware/colour/looks",
    "beware/example",
    "beware/example/click",
    "beware/example/looks",
    "control/keep",
)
SILENT = frozenset(f"{_API}/{path}" for path in _DRAFTS)
"""Requests that change nothing and come with every move of a slider, click of a draft, change of a
tried path or sign of life: they are not logged."""
_PAGES = ("/", "/runs", "/teach", "/docs")
_FLAG = TypeAdapter(bool)
_BY_ANYONE = {
    ("POST", STOP),
    ("POST", f"{_API}/preview"),
    ("POST", f"{_API}/explain"),
    ("POST", LOGOUT),
    ("PUT", LANGUAGE),
    ("PUT", f"{_API}/me/password"),
}
_ADMINS = re.compile(rf"{_API}/users(/|$)")
_OPERATORS = re.compile(rf"{_API}/(audit(/|$)|teach/frames\.zip$|sites/.+/(export|nav2)$)")
"""Reads that tell of users, and those that are work for the computer of the robot."""
_DRIVES = re.compile(
    rf"{_API}/(goals(/.*)?|mission(/.*)?|stop/reset|missions/.+/load|sites/.+/choose"
    r"|localisation/search|pose)"
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


def requirement_of(method: str, path: str, query: bytes | str = b"") -> Requirement:
    """Return the requirement of a request; a websocket counts as GET, its handler checks the
    messages. A path with a slash at its end, which is redirected, requires what it does without."""
    path = path.removesuffix("/")
    if _ADMINS.match(path):
        return Requirement(role=Role.ADMIN)
    if method in SAFE:
        return Requirement(role=Role.OPERATOR if _OPERATORS.match(path) else Role.VIEWER)
    if (method, path) in _BY_ANYONE:
        return Requirement(role=Role.VIEWER)
    drives = _DRIVES.fullmatch(path) is not None and path not in _NEEDS_NO_CONTROL
    if path == POSE and only_checks(query):
        drives = False
    return Requirement(role=Role.OPERATOR, control=drives)


def only_checks(query: bytes | str) -> bool:
    """Return whether a request for a place of the robot only asks how well it fits, as its route
    takes the query."""
    try:
        return _FLAG.validate_python(QueryParams(query).get("check", False))
    except ValidationError:
        return False


def is_deliberate(method: str, path: str) -> bool:
    """Return whether a visitor makes a request, not an open page by itself, nor a program that
    watches: it changes something, or opens a page. Of a websocket, its handler says which messages
    are deliberate, by `web.auth.roles.SessionRenewal`."""
    return path in _PAGES if method in SAFE else path not in SILENT
