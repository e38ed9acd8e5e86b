"""Two kinds of house: an open one, for this machine alone, and one that knows its visitors by
password or token."""

from __future__ import annotations

import logging
import re
import secrets
import threading
from collections import OrderedDict
from typing import Protocol

from starlette.datastructures import Headers

from navcore.errors import StorageFailed
from web.auth.roles import Role, Visitor
from web.auth.sessions import Sessions
from web.auth.users import User, Users, hash_password, hash_token, is_password

log = logging.getLogger(__name__)

_CLIENT_ID = re.compile(r"[A-Za-z0-9_-]{20,64}")
MAX_CLIENTS = 1000


class Authenticator(Protocol):
    """How the door recognises who comes."""

    def authenticate(self, headers: Headers, cookie: str) -> Visitor | None:
        """The visitor; None for one who has to log in."""

    def issue_client_cookie(self, cookie: str) -> str | None:
        """The cookie to give to a browser that opens the page; None when it needs none, or must log
        in for it."""

    def refresh(self) -> None:
        """Look again who may come in; called about once a second."""


class AnonymousAuthenticator:
    """Everybody may do everything. The cookie only tells one browser from another, so that one of
    them drives at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._numbers: OrderedDict[str, int] = OrderedDict()
        self._given = 0

    def authenticate(self, headers: Headers, cookie: str) -> Visitor | None:
        """A page by its cookie; whatever has none is a program."""
        if not _CLIENT_ID.fullmatch(cookie):
            return Visitor(name="a program", role=Role.ADMIN, client_id="program", logged_in=False)
        return Visitor(
            name=f"console {self._number(cookie)}",
            role=Role.ADMIN,
            client_id=f"page {cookie}",
            logged_in=False,
        )

    def issue_client_cookie(self, cookie: str) -> str | None:
        """A fresh one for a browser without."""
        return None if _CLIENT_ID.fullmatch(cookie) else secrets.token_urlsafe(24)

    def refresh(self) -> None:
        """Nobody changes."""

    def _number(self, cookie: str) -> int:
        with self._lock:
            if cookie not in self._numbers:
                self._given += 1
                self._numbers[cookie] = self._given
                while len(self._numbers) > MAX_CLIENTS:
                    self._numbers.popitem(last=False)
            return self._numbers[cookie]


class PasswordAuthenticator:
    """Users log in with a password and keep a session; programs send the token of a user as a
    bearer.

    The accounts are read into memory, so that no request waits for a disk: the stop must pass
    though the store is locked.
    """

    def __init__(self, users: Users, sessions: Sessions | None = None) -> None:
        self.users = users
        self.sessions = sessions or Sessions()
        self._known: dict[str, User] = {}
        self._by_token: dict[str, User] = {}
        self._nobody = hash_password(secrets.token_urlsafe(16))
        self.refresh()

    def authenticate(self, headers: Headers, cookie: str) -> Visitor | None:
        """By bearer token, else by session."""
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            # Found by its hash, so what takes longer for a nearly right token tells nothing of the
            # token itself.
            user = self._by_token.get(hash_token(given.strip()))
            return (
                None
                if user is None
                else Visitor(name=user.name, role=user.role, client_id=f"program {user.name}")
            )
        found = self.sessions.of(cookie)
        return (
            None
            if found is None
            else Visitor(name=found[0].name, role=found[0].role, client_id=f"page {found[1]}")
        )

    def issue_client_cookie(self, cookie: str) -> str | None:
        """Nothing without a log-in."""
        return None

    def log_in(self, name: str, password: str) -> str | None:
        """A session's cookie, or None. Takes some 0.1 s whatever is wrong."""
        self.refresh()
        user = self._known.get(name)
        right = is_password(password, self._nobody if user is None else user.password_hash)
        return self.sessions.begin(user) if right and user is not None else None

    def refresh(self) -> None:
        """Read the accounts; sessions of those that have changed or gone end."""
        try:
            known = {user.name: user for user in self.users.all()}
        except StorageFailed:
            log.exception("the users could not be read; those known so far may come in")
            return
        self._known = known
        self._by_token = {
            user.token_hash: user for user in known.values() if user.token_hash is not None
        }
        self.sessions.keep_only(known)
