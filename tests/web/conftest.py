"""The whole console, on a free port, around a small system in memory."""

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
    """A fresh system."""
    return FakeOperations()


@pytest.fixture
def server(operations: FakeOperations) -> Iterator[ConsoleServer]:
    """The console."""
    console = ConsoleServer(operations, port=0)
    console.start()
    yield console
    console.stop()


@pytest.fixture
def client(server: ConsoleServer) -> Iterator[httpx.Client]:
    """A program that talks to it."""
    with httpx.Client(base_url=server.url, trust_env=False) as program:
        yield program


class Accounts:
    """A store with one user of each role, called like it; all have the same password, and a token
    each."""

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
        """Of a program of this user."""
        return {"Host": "console", "Authorization": f"Bearer {self.tokens[name]}"}

    def visitor(self, name: str) -> Visitor:
        """The same as the door sees it."""
        return Visitor(name=name, role=Role(name), client_id=f"program {name}")


@pytest.fixture
def accounts(tmp_path: Path) -> Iterator[Accounts]:
    """Who may log in."""
    made = Accounts(tmp_path / "data")
    yield made
    made.store.close()


@pytest.fixture
def locked(operations: FakeOperations, accounts: Accounts) -> Iterator[ConsoleServer]:
    """A console that wants a log-in."""
    console = ConsoleServer(operations, port=0, access=accounts.access)
    console.start()
    yield console
    console.stop()
