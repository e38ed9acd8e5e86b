"""The one door: every route the app itself knows refuses strangers before its handler runs."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from fastapi.routing import iter_route_contexts
from starlette.routing import Route, WebSocketRoute
from starlette.types import Message, Scope
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from tests.web.fake_operations import FakeOperations
from web.server import ConsoleServer, create_app

TOKEN = "a token of the operator"


def routes_of(app: FastAPI) -> list[tuple[str, str]]:
    """(method or WS, path) of every route, taken from the app."""
    found = []
    for route in iter_route_contexts(app.routes):
        assert route.path is not None, f"{route!r} is of a kind this test does not know"
        path = re.sub(r"\{[^}]*\}", "x" * 16, route.path)
        if isinstance(route.original_route, WebSocketRoute):
            found.append(("WS", path))
        else:
            assert isinstance(route.original_route, Route), f"{route!r} is of a kind this test does not know"
            found += [(method, path) for method in sorted(route.methods or ())]
    return found


def ask(app: Any, method: str, path: str, headers: dict[str, str]) -> int:
    """Status of the app's answer; 101 for a websocket that is accepted, 403 for one that is closed before."""
    sent: list[Message] = []
    scope: Scope = {
        "type": "websocket" if method == "WS" else "http",
        "method": method,
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "scheme": "http",
        "http_version": "1.1",
        "subprotocols": [],
        "headers": [(name.lower().encode(), value.encode()) for name, value in headers.items()],
    }
    arriving = iter([{"type": "websocket.connect"} if method == "WS" else {"type": "http.request", "body": b""}])

    async def receive() -> Message:
        return next(arriving, {"type": "websocket.disconnect"} if method == "WS" else {"type": "http.disconnect"})

    async def send(message: Message) -> None:
        sent.append(message)

    asyncio.run(app(scope, receive, send))
    if method == "WS":
        return 101 if sent and sent[0]["type"] == "websocket.accept" else 403
    return int(sent[0]["status"])


STRANGERS = {
    "foreign host": {"Host": "evil.example"},
    "host with a trick": {"Host": "console.evil.example"},
    "host and port of another": {"Host": "evil.example:8000"},
    "foreign origin": {"Host": "console", "Origin": "http://evil.example"},
    "no origin to speak of": {"Host": "console", "Origin": "null"},
    "same name, other port": {"Host": "console", "Origin": "http://console:9999"},
    "origin with a trick": {"Host": "console", "Origin": "http://console@evil.example"},
    "embedded elsewhere": {"Host": "console", "Sec-Fetch-Site": "cross-site", "Sec-Fetch-Dest": "image"},
}


class Untouchable(FakeOperations):
    """Fails the test when a handler is reached."""

    def __getattribute__(self, name: str) -> Any:
        if not name.startswith("_"):
            raise AssertionError(f"a handler ran and asked for {name}")
        return super().__getattribute__(name)


@pytest.mark.parametrize("stranger", STRANGERS)
def test_every_route_refuses_a_stranger_before_its_handler_runs(stranger: str) -> None:
    app = create_app(Untouchable(), allowed_hosts=["console"])
    routes = routes_of(app)
    assert len(routes) > 30
    refused = {route: ask(app, *route, STRANGERS[stranger]) for route in routes}
    assert {route: status for route, status in refused.items() if status not in (403, 421)} == {}


def test_without_the_guard_the_same_requests_reach_the_handlers() -> None:
    app = create_app(FakeOperations(), allowed_hosts=["console"])
    app.user_middleware.clear()
    assert ask(app, "POST", "/api/v1/stop", STRANGERS["foreign origin"]) == 200
    assert ask(app, "GET", "/healthz", STRANGERS["foreign host"]) == 200


def test_every_route_asks_for_the_login_when_a_token_is_set() -> None:
    app = create_app(Untouchable(), allowed_hosts=["console"], token=TOKEN)
    statuses = {route: ask(app, *route, {"Host": "console"}) for route in routes_of(app)}
    assert {route: status for route, status in statuses.items() if status not in (401, 403)} == {}


@pytest.mark.parametrize("host", ["console", "CONSOLE:8000", "127.0.0.1:1", "[::1]:8000"])
def test_the_console_answers_to_its_own_names(host: str) -> None:
    app = create_app(FakeOperations(), allowed_hosts=["console", "127.0.0.1", "[::1]"])
    assert ask(app, "GET", "/healthz", {"Host": host, "Origin": f"http://{host}"}) == 200
    assert ask(app, "WS", "/api/v1/events", {"Host": host, "Origin": f"http://{host}"}) == 101


@pytest.fixture
def locked(operations: FakeOperations) -> Iterator[ConsoleServer]:
    """A console that wants a login."""
    console = ConsoleServer(operations, port=0, token=TOKEN)
    console.start()
    yield console
    console.stop()


def test_a_program_logs_in_with_a_bearer_and_with_nothing_less(locked: ConsoleServer) -> None:
    with httpx.Client(base_url=locked.url, trust_env=False) as program:
        assert program.get("/api/v1/state").status_code == 401
        assert program.get("/api/v1/state", headers={"Authorization": "Bearer wrong"}).status_code == 401
        assert program.get("/api/v1/state", headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 200
    address = locked.url.replace("http", "ws") + "/api/v1/events"
    with pytest.raises(InvalidStatus), connect(address, proxy=None):
        pass
    with connect(address, proxy=None, additional_headers={"Authorization": f"Bearer {TOKEN}"}) as socket:
        assert "state" in str(socket.recv(timeout=5))


def test_a_browser_logs_in_by_link_or_by_form_and_keeps_a_strict_cookie(locked: ConsoleServer) -> None:
    for by_link in (True, False):
        with httpx.Client(base_url=locked.url, trust_env=False, headers={"Accept": "text/html"}) as browser:
            assert "<form" in browser.get("/").text
            assert browser.post("/login", data={"token": "wrong"}).status_code == 401
            answer = browser.get(locked.login_url) if by_link else browser.post("/login", data={"token": TOKEN})
            cookie = answer.headers["set-cookie"]
            assert answer.status_code == 200 and "HttpOnly" in cookie and "SameSite=strict" in cookie and TOKEN not in cookie
            assert "Operator console" in browser.get("/").text and browser.get("/api/v1/state").status_code == 200


def test_a_login_from_another_page_is_refused(locked: ConsoleServer) -> None:
    with httpx.Client(base_url=locked.url, trust_env=False) as browser:
        answer = browser.post("/login", data={"token": TOKEN}, headers={"Origin": "http://evil.example"})
        assert answer.status_code == 403 and "set-cookie" not in answer.headers


def test_every_answer_carries_the_headers_that_keep_browsers_honest(client: httpx.Client) -> None:
    for path in ("/", "/viewer/", "/api/v1/state", "/nowhere"):
        headers = client.get(path).headers
        assert headers["x-content-type-options"] == "nosniff" and "frame-ancestors 'self'" in headers["content-security-policy"]
    assert "unsafe" not in client.get("/").headers["content-security-policy"]
    assert client.get("/healthz", headers={"Host": "evil.example"}).status_code == 421
