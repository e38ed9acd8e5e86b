"""Fixtures: the whole console on a free port, around a small robot in memory."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from app.storage import Store
from tests.web.fake_operations import FakeOperations
from web.auth.access import Access
from web.auth.roles import Role, Visitor
from web.auth.users import User, hash_password, new_token
from web.server import ConsoleServer

PASSWORD = "correct horse"


@pytest.fixture
def operations() -> FakeOperations:
    """Return a new robot."""
    return FakeOperations()


@pytest.fixture
def server(operations: FakeOperations) -> Iterator[ConsoleServer]:
    """Yield a console without users."""
    console = ConsoleServer(operations, port=0)
    console.start()
    yield console
    console.stop()


@pytest.fixture
def client(server: ConsoleServer) -> Iterator[httpx.Client]:
    """Yield a program that talks to the console."""
    with httpx.Client(base_url=server.url, trust_env=False, timeout=60.0) as program:
        yield program


class Accounts:
    """Store with one user for each role, named after it; all have the same password and an own
    token."""

    def __init__(self, folder: Path) -> None:
        self.store = Store(folder)
        self.tokens: dict[str, str] = {}
        hashed = hash_password(PASSWORD)
        for role in Role:
            self.tokens[role], token_hash = new_token()
            self.store.users.add(
                User(name=str(role), role=role, password_hash=hashed, token_hash=token_hash)
            )
        self.access = Access.by_login(self.store.users, self.store.audit)

    def headers(self, name: str) -> dict[str, str]:
        """Return the headers of a program of a user."""
        return {"Host": "console", "Authorization": f"Bearer {self.tokens[name]}"}

    def visitor(self, name: str) -> Visitor:
        """Return this program as an authenticated visitor."""
        return Visitor(name=name, role=Role(name), client_id=f"program {name}")


@pytest.fixture
def accounts(tmp_path: Path) -> Iterator[Accounts]:
    """Yield the users."""
    made = Accounts(tmp_path / "data")
    yield made
    made.store.close()


@pytest.fixture
def locked(operations: FakeOperations, accounts: Accounts) -> Iterator[ConsoleServer]:
    """Yield a console that needs a log-in."""
    console = ConsoleServer(operations, port=0, access=accounts.access)
    console.start()
    yield console
    console.stop()
