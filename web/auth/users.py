"""Accounts: what is kept of a user, and how a password or a token becomes something that can be
kept."""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
import secrets
from dataclasses import dataclass
from typing import Protocol

from navcore.errors import BadConfiguration
from web.auth.roles import Role

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.@-]{0,39}")
SHORTEST_PASSWORD, LONGEST_PASSWORD = 10, 200
_COST, _BLOCK, _PARALLEL = 15, 8, 1
_MEMORY = 64 * 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class User:
    """Who may log in."""

    name: str
    """Unique."""
    role: Role
    """What he may do."""
    password_hash: str
    """By scrypt, with its cost and its salt."""
    token_hash: str | None = None
    """SHA-256 of a program's bearer token, which is random and long and needs nothing slower."""


class Users(Protocol):
    """Where accounts are kept. `add`, `change` and `remove` raise `Refused` or `NotKnown`, all
    `StorageFailed`."""

    def all(self) -> tuple[User, ...]:
        """By name."""

    def add(self, user: User) -> None:
        """A new one."""

    def change(
        self,
        name: str,
        *,
        role: Role | None = None,
        password_hash: str | None = None,
        token_hash: str | None = None,
        instead_of: str | None = None,
    ) -> User:
        """What is said of one there is, and nothing else of him; `instead_of`: only as long as that
        is his password's hash."""

    def remove(self, name: str) -> None:
        """One fewer."""


def new_user(name: str, role: Role, password: str) -> User:
    """Raises `BadConfiguration` for a name or a password that will not do."""
    if NAME.fullmatch(name) is None:
        raise BadConfiguration(
            f"user name {name!r:.60}: expected 1 to 40 letters, digits, dots, dashes, @ or _"
        )
    return User(name=name, role=role, password_hash=hash_password(password))


def hash_password(password: str) -> str:
    """For keeping; raises `BadConfiguration` when it is too short or too long."""
    if not SHORTEST_PASSWORD <= len(password) <= LONGEST_PASSWORD:
        raise BadConfiguration(
            f"the password must have {SHORTEST_PASSWORD} to {LONGEST_PASSWORD} characters"
        )
    salt = secrets.token_bytes(16)
    return f"scrypt${_COST}${_BLOCK}${_PARALLEL}${_text(salt)}${_text(_scrypt(password, salt, _COST, _BLOCK, _PARALLEL))}"


def is_password(given: str, kept: str) -> bool:
    """Whether it is the password of which this is kept. Takes some 0.1 s, right or wrong."""
    _, cost, block, parallel, salt, digest = kept.split("$")
    made = _scrypt(
        given[: LONGEST_PASSWORD + 1], base64.b64decode(salt), int(cost), int(block), int(parallel)
    )
    return hmac.compare_digest(made, base64.b64decode(digest))


def new_token() -> tuple[str, str]:
    """A bearer token for a program, and what is kept of it."""
    token = f"bn_{secrets.token_urlsafe(32)}"
    return token, hash_token(token)


def hash_token(token: str) -> str:
    """For keeping and for finding."""
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).hexdigest()


def _scrypt(password: str, salt: bytes, cost: int, block: int, parallel: int) -> bytes:
    text = password.encode("utf-8", "surrogatepass")
    return hashlib.scrypt(text, salt=salt, n=2**cost, r=block, p=parallel, maxmem=_MEMORY, dklen=32)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
