"""Sessions of logged-in browsers. A session ends by log-out, idleness, age, or a change of its
user.

The clock is monotonic, so that a change of the date neither prolongs nor ends one.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from web.auth.users import User

MAX_IDLE_S = 12 * 3600.0
"""Time without a deliberate request or message after which a session ends, seconds."""
MAX_AGE_S = 7 * 24 * 3600.0
"""Largest age of a session in seconds."""
MAX_SESSIONS, MAX_OF_USER = 1000, 20
"""Largest number of sessions, of all users and of one."""


@dataclass(slots=True)
class _Session:
    user: User
    client_id: str
    began_s: float
    seen_s: float
    used_s: float
    """Time of the last request of any kind, that of an open page included."""


class Sessions:
    """Sessions in memory; a restart of the console ends them. Safe from any thread."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._sessions: OrderedDict[str, _Session] = OrderedDict()

    def begin(self, user: User) -> str:
        """Return the cookie of a new session; beyond `MAX_OF_USER` the user's one that was not used
        for longest ends, an open page uses its own; beyond `MAX_SESSIONS` the longest idle one of
        all."""
        cookie, now = secrets.token_urlsafe(32), self._clock()
        with self._lock:
            self._sessions[cookie] = _Session(
                user=user, client_id=secrets.token_hex(8), began_s=now, seen_s=now, used_s=now
            )
            own = [key for key, one in self._sessions.items() if one.user.name == user.name]
            own.sort(key=lambda key: self._sessions[key].used_s)
            for old in own[:-MAX_OF_USER]:
                del self._sessions[old]
            while len(self._sessions) > MAX_SESSIONS:
                self._sessions.popitem(last=False)
        return cookie

    def find(self, cookie: str, *, renews: bool = False) -> tuple[User, str] | None:
        """Return user and client id of a valid cookie, None for any other. With `renews`, its
        session is not idle."""
        now = self._clock()
        with self._lock:
            session = self._sessions.get(cookie)
            if session is None:
                return None
            if now - session.seen_s > MAX_IDLE_S or now - session.began_s > MAX_AGE_S:
                del self._sessions[cookie]
                return None
            session.used_s = now
            if renews:
                session.seen_s = now
                self._sessions.move_to_end(cookie)
            return session.user, session.client_id

    def end(self, cookie: str) -> None:
        """End a session."""
        with self._lock:
            self._sessions.pop(cookie, None)

    def keep_only(self, users: dict[str, User]) -> None:
        """End the sessions of removed and changed accounts."""
        with self._lock:
            for cookie, session in list(self._sessions.items()):
                if users.get(session.user.name) != session.user:
                    del self._sessions[cookie]
