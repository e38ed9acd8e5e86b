"""Browsers that are logged in. A session ends by log-out, by idleness, by age, and when its user
changes.

The clock is monotonic, so that no change of the machine's date prolongs or ends one.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from web.auth.users import User

IDLE_S = 12 * 3600.0
LONGEST_S = 7 * 24 * 3600.0
MAX_SESSIONS = 1000


@dataclass(slots=True)
class _Session:
    user: User
    client_id: str
    began_s: float
    seen_s: float


class Sessions:
    """In memory: a restart of the console logs everybody out. Safe to use from any thread."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._sessions: OrderedDict[str, _Session] = OrderedDict()

    def begin(self, user: User) -> str:
        """The cookie's value of a new session. When there are too many, the one that was silent
        longest ends."""
        cookie, now = secrets.token_urlsafe(32), self._clock()
        with self._lock:
            self._sessions[cookie] = _Session(
                user=user, client_id=secrets.token_hex(8), began_s=now, seen_s=now
            )
            while len(self._sessions) > MAX_SESSIONS:
                self._sessions.popitem(last=False)
        return cookie

    def of(self, cookie: str) -> tuple[User, str] | None:
        """User and seat of a cookie that is still good, and it is good for longer now."""
        now = self._clock()
        with self._lock:
            session = self._sessions.get(cookie)
            if session is None:
                return None
            if now - session.seen_s > IDLE_S or now - session.began_s > LONGEST_S:
                del self._sessions[cookie]
                return None
            session.seen_s = now
            self._sessions.move_to_end(cookie)
            return session.user, session.client_id

    def end(self, cookie: str) -> None:
        """Log out."""
        with self._lock:
            self._sessions.pop(cookie, None)

    def keep_only(self, users: dict[str, User]) -> None:
        """End the sessions of everybody whose account has gone or changed."""
        with self._lock:
            for cookie, session in list(self._sessions.items()):
                if users.get(session.user.name) != session.user:
                    del self._sessions[cookie]
