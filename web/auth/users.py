"""User accounts, and the hashes of passwords and tokens."""

from __future__ import annotations

import base64
import hashlib
import hmac
import itertools
import re
import secrets
from dataclasses import dataclass, field
from typing import Protocol

from navcore.errors import BadConfiguration
from web.auth.roles import Role

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.@-]{0,39}")
SHORTEST_PASSWORD, LONGEST_PASSWORD = 10, 200
"""Range of the length of passwords, characters."""
_COST, _BLOCK, _PARALLEL = 15, 8, 1
"""Parameters of scrypt: log2 of N, r, and p."""
_MEMORY = 64 * 1024 * 1024
"""Memory limit of scrypt in bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class User:
    """User who may log in."""

    name: str
    """Unique name."""
    role: Role
    """Rights of the user."""
    password_hash: str
    """Hash of the password by scrypt, with cost and salt."""
    token_hash: str | None = field(default=None, compare=False)
    """SHA-256 of a program's bearer token, which is long and random; None without a token. Not
    compared: a session whose account has changed ends, and none begins by a token."""
    language: str | None = field(default=None, compare=False)
    """Language of the pages, None until one is chosen. Not compared: no right depends on it."""


class Users(Protocol):
    """Storage of the accounts. `add`, `change` and `remove` raise `Refused` or `NotKnown`, all
    methods `StorageFailed`."""

    def all(self) -> tuple[User, ...]:
        """Return all users, sorted by name."""

    def add(self, user: User) -> None:
        """Add a user."""

    def change(
        self,
        name: str,
        *,
        role: Role | None = None,
        password_hash: str | None = None,
        token_hash: str | None = None,
        language: str | None = None,
        instead_of: str | None = None,
    ) -> User:
        """Change the given fields of a user; with `instead_of`, only while the stored password hash
        is this one."""

    def remove(self, name: str) -> None:
        """Remove a user."""


def new_user(name: str, role: Role, password: str) -> User:
    """Return a new user; raises `BadConfiguration` for an invalid name or password."""
    if NAME.fullmatch(name) is None:
        raise BadConfiguration("user name: expected 1 to 40 letters, digits, dots, dashes, @ or _")
    return User(name=name, role=role, password_hash=hash_password(password))


def first_admin(users: Users) -> tuple[str, str] | None:
    """Add an admin if there is none; return name and password, of which only the hash is stored."""
    known = users.all()
    if any(user.role is Role.ADMIN for user in known):
        return None
    taken, password = {user.name for user in known}, secrets.token_urlsafe(12)
    names = itertools.chain(["admin"], (f"admin-{number}" for number in itertools.count(2)))
    name = next(name for name in names if name not in taken)
    users.add(new_user(name, Role.ADMIN, password))
    return name, password


def hash_password(password: str) -> str:
    """Return the hash of a password; raises `BadConfiguration` when it is too short or too long."""
    if not SHORTEST_PASSWORD <= len(password) <= LONGEST_PASSWORD:
        raise BadConfiguration(
            f"the password must have {SHORTEST_PASSWORD} to {LONGEST_PASSWORD} characters"
        )
    salt = secrets.token_bytes(16)
    digest = _scrypt(password, salt, _COST, _BLOCK, _PARALLEL)
    return f"scrypt${_COST}${_BLOCK}${_PARALLEL}${_text(salt)}${_text(digest)}"


def is_password(given: str, kept: str) -> bool:
    """Return whether a password has a stored hash; takes about 0.1 s in either case."""
    _, cost, block, parallel, salt, digest = kept.split("$")
    made = _scrypt(
        given[: LONGEST_PASSWORD + 1], base64.b64decode(salt), int(cost), int(block), int(parallel)
    )
    return hmac.compare_digest(made, base64.b64decode(digest))


def new_token() -> tuple[str, str]:
    """Return a new bearer token and its hash."""
    token = f"bn_{secrets.token_urlsafe(32)}"
    return token, hash_token(token)


def hash_token(token: str) -> str:
    """Return the hash of a bearer token."""
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).hexdigest()


def _scrypt(password: str, salt: bytes, cost: int, block: int, parallel: int) -> bytes:
    text = password.encode("utf-8", "surrogatepass")
    return hashlib.scrypt(text, salt=salt, n=2**cost, r=block, p=parallel, maxmem=_MEMORY, dklen=32)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
