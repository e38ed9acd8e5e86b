"""The whole console, on a free port, around a small system in memory."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from tests.web.fake_operations import FakeOperations
from web.server import ConsoleServer


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
