"""Authentication of visitors: anonymous, for a console of this machine alone, or by password or
token."""

from __future__ import annotations

import itertools
import logging
import re
import secrets
import threading
from collections import OrderedDict
from typing import Protocol
from urllib.parse import unquote

from starlette.datastructures import Headers

from navcore.errors import StorageFailed
from web.auth.rate_limit import PasswordTries
from web.auth.roles import Role, Visitor
from web.auth.sessions import Sessions
from web.auth.users import User, Users, hash_password, hash_token, is_password

log = logging.getLogger(__name__)

_CLIENT_ID = re.compile(r"[A-Za-z0-9_-]{20,64}")
MAX_CLIENTS = 1000
"""Largest number of browsers that are told apart."""
PROGRAM = "a program"
"""Name of every client without a cookie on a console without users."""


NAME_COOKIE = "bewarenav-name"
"""Cookie in which a page keeps its name for the other operators, percent-encoded."""
MAX_NAME = 40
"""Largest length of such a name in characters."""


def _own_name(headers: Headers) -> str | None:
    """Return the name in the cookies of a request; None without one that can be printed."""
    for part in headers.get("cookie", "").split(";"):
        key, _, value = part.strip().partition("=")
        name = unquote(value).strip()
        if key == NAME_COOKIE and name.isprintable() and 0 < len(name) <= MAX_NAME:
            return name
    return None


class Authenticator(Protocol):
    """Authentication of the visitors of a console."""

    def authenticate(
        self, headers: Headers, cookie: str, *, renews: bool = False
    ) -> Visitor | None:
        """Return the visitor of a request; None when a log-in is needed. With `renews`, the
        visitor's session is not idle."""

    def issue_client_cookie(self, cookie: str) -> str | None:
        """Return the cookie for a browser that opens the page; None when it has one, or gets it by
        logging in."""

    def refresh(self) -> None:
        """Read the users again; called periodically."""


class AnonymousAuthenticator:
    """Every visitor has all rights. The cookie only tells browsers apart, so that one of them
    drives at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._numbers: OrderedDict[str, int] = OrderedDict()
        self._names: dict[str, str] = {}
        self._given = 0

    def authenticate(
        self, headers: Headers, cookie: str, *, renews: bool = False
    ) -> Visitor | None:
        """Return the page of a cookie; a client without a cookie is a program."""
        if not _CLIENT_ID.fullmatch(cookie):
            return Visitor(name=PROGRAM, role=Role.ADMIN, client_id="program", logged_in=False)
        number = self._number(cookie)
        return Visitor(
            name=self._unique(cookie, _own_name(headers) or f"console {number}", number),
            role=Role.ADMIN,
            client_id=f"page {cookie}",
            logged_in=False,
        )

    def issue_client_cookie(self, cookie: str) -> str | None:
        """Return a new cookie for a browser without one."""
        return None if _CLIENT_ID.fullmatch(cookie) else secrets.token_urlsafe(24)

    def refresh(self) -> None:
        """Do nothing: there are no users."""

    def _unique(self, cookie: str, name: str, number: int) -> str:
        """Return the name of a page; one that another page or a program has gets a number."""
        with self._lock:
            taken = {other for page, other in self._names.items() if page != cookie}
            taken.add(PROGRAM)
            numbered = (f"{name} ({free})" for free in itertools.count(number))
            names = itertools.chain([name], numbered)
            self._names[cookie] = next(one for one in names if one not in taken)
            return self._names[cookie]

    def _number(self, cookie: str) -> int:
        with self._lock:
            if cookie not in self._numbers:
                self._given += 1
                self._numbers[cookie] = self._given
                while len(self._numbers) > MAX_CLIENTS:
                    old, _ = self._numbers.popitem(last=False)
                    self._names.pop(old, None)
            return self._numbers[cookie]


class PasswordAuthenticator:
    """Users log in with a password and have a session; programs send a user's bearer token.

    The accounts are in memory, so that no request waits for a disk: the emergency stop must work
    while the store is locked.
    """

    def __init__(self, users: Users, sessions: Sessions | None = None) -> None:
        self.users = users
        self.sessions = sessions or Sessions()
        self.tries = PasswordTries()
        self._known: dict[str, User] = {}
        self._by_token: dict[str, User] = {}
        self._no_user = hash_password(secrets.token_urlsafe(16))
        self.refresh()

    def authenticate(
        self, headers: Headers, cookie: str, *, renews: bool = False
    ) -> Visitor | None:
        """Authenticate by bearer token, else by session."""
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            # Looked up by its hash, so that the time of the look-up reveals nothing of a token.
            user = self._by_token.get(hash_token(given.strip()))
            return None if user is None else self._visitor(user, f"program {user.name}")
        found = self.sessions.find(cookie, renews=renews)
        return None if found is None else self._visitor(found[0], f"page {found[1]}")

    def _visitor(self, user: User, client_id: str) -> Visitor:
        # A session has the account as it was at the log-in.
        language = self._known.get(user.name, user).language
        return Visitor(name=user.name, role=user.role, client_id=client_id, language=language)

    def issue_client_cookie(self, cookie: str) -> str | None:
        """Return None: the cookie comes with the log-in."""
        return None

    def knows(self, name: str) -> bool:
        """Return whether an account has this name."""
        return name in self._known

    def log_in(self, name: str, password: str) -> str | None:
        """Return the cookie of a new session, or None; takes about 0.1 s in either case."""
        self.refresh()
        user = self._known.get(name)
        right = is_password(password, self._no_user if user is None else user.password_hash)
        return self.sessions.begin(user) if right and user is not None else None

    def refresh(self) -> None:
        """Read the accounts and end the sessions of changed or removed ones."""
        try:
            known = {user.name: user for user in self.users.all()}
        except StorageFailed:
            log.exception("the users could not be read; those known so far keep their access")
            return
        self._known = known
        self._by_token = {
            user.token_hash: user for user in known.values() if user.token_hash is not None
        }
        self.sessions.keep_only(known)
