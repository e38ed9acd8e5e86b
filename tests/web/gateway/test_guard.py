"""The guard: every route of the app refuses foreign requests before its handler runs."""

from __future__ import annotations

from typing import Any

import httpx
import pytest
from starlette.datastructures import Headers

from tests.reliability.routes import FOREIGN_HEADERS, PARAMETER, response_status, routes_of
from tests.web.conftest import Accounts
from tests.web.fake_operations import FakeOperations
from web.gateway.origin_check import check_origin
from web.server import create_app


class Untouchable(FakeOperations):
    """Robot that fails the test when a handler is reached."""

    def __init__(self) -> None:
        super().__init__()
        self._watched = True

    def __getattribute__(self, name: str) -> Any:
        if not name.startswith("_") and "_watched" in self.__dict__:
            raise AssertionError(f"a handler ran and asked for {name}")
        return super().__getattribute__(name)


@pytest.mark.parametrize("stranger", FOREIGN_HEADERS)
def test_every_route_refuses_a_foreign_request_before_its_handler_runs(stranger: str) -> None:
    app = create_app(Untouchable(), allowed_hosts=["console"])
    routes = routes_of(app)
    assert len(routes) > 30
    refused = {route: response_status(app, *route, FOREIGN_HEADERS[stranger]) for route in routes}
    assert {route: status for route, status in refused.items() if status not in (403, 421)} == {}


def test_without_the_guard_the_same_requests_reach_the_handlers() -> None:
    app = create_app(FakeOperations(), allowed_hosts=["console"])
    app.user_middleware.clear()
    assert response_status(app, "GET", "/api/v1/state", FOREIGN_HEADERS["foreign origin"]) == 200
    assert response_status(app, "GET", "/healthz", FOREIGN_HEADERS["foreign host"]) == 200


def test_every_route_asks_an_unknown_visitor_to_log_in(accounts: Accounts) -> None:
    app = create_app(Untouchable(), allowed_hosts=["console"], access=accounts.access)
    statuses = {
        route: response_status(app, *route, {"Host": "console"}) for route in routes_of(app)
    }
    assert {route: status for route, status in statuses.items() if status not in (401, 403)} == {}


ACTS = ("POST", "PUT", "PATCH", "DELETE")
MAY_BE_ASKED_BY_VIEWERS = {
    ("POST", "/api/v1/stop"),
    ("POST", "/api/v1/preview"),
    ("POST", "/api/v1/explain"),
    ("PUT", "/api/v1/me/language"),
    ("PUT", "/api/v1/me/password"),
}
MAY_NOT_BE_READ_BY_VIEWERS = {
    "audit", "sites/X/export", "sites/X/nav2", "teach/frames.zip", "users",
}  # fmt: skip
MAY_BE_READ_BY_VIEWERS = {
    "beware", "beware.toml", "beware/versions", "beware/versions/X", "camera.jpg", "camera/labels",
    "candidates", "cloud.ply", "control", "control/live", "edits", "events", "explain", "goals",
    "journal", "localisation", "map", "map.pgm", "map.png", "map.yaml", "map/changes", "map/edits",
    "map/poses", "map/tiles", "map/tiles/X/X.png", "me", "missions", "path", "path/settings",
    "runs", "runs/X", "series", "sightings", "sightings/X/picture.jpg",
    "sightings/snapshots/X.jpg", "sites", "sites/X", "state", "tags/seen", "teach/frames",
    "teach/frames/X.png", "teach/frames/X/labels", "teach/networks", "teach/training",
    "teach/training/looks/X.png", "viewer/X", "zone-sets", "zones", "zones.pgm", "zones.yaml",
    "zones/X",
}  # fmt: skip
PAGES = {
    "/", "/docs", "/healthz", "/metrics", "/openapi.json", "/page/X", "/runs", "/teach", "/viewer",
    "/viewer/", "/viewer/X", "/viewer/X/",
}  # fmt: skip


def test_the_guard_lets_a_viewer_only_look_and_stop(
    accounts: Accounts,
) -> None:
    app = create_app(Untouchable(), allowed_hosts=["console"], access=accounts.access)
    acts = [route for route in routes_of(app) if route[0] in ACTS]
    assert len(acts) > 15 and set(acts) >= MAY_BE_ASKED_BY_VIEWERS
    refused = {
        route
        for route in acts
        if response_status(app, *route, accounts.headers("viewer"), quiet=True) == 403
    }
    assert refused == set(acts) - MAY_BE_ASKED_BY_VIEWERS
    reads = {path for method, path in routes_of(app) if method in ("GET", "WS")}
    closed = {
        path.replace(PARAMETER, "X")
        for path in reads
        if response_status(app, "GET", path, accounts.headers("viewer"), quiet=True) == 403
    }
    assert closed == {f"/api/v1/{path}" for path in MAY_NOT_BE_READ_BY_VIEWERS}
    shown = {path.replace(PARAMETER, "X") for path in reads}
    assert shown - closed == {f"/api/v1/{path}" for path in MAY_BE_READ_BY_VIEWERS} | PAGES
    assert response_status(app, "GET", "/api/v1/users", accounts.headers("operator")) == 403


def test_driving_is_refused_to_a_visitor_who_is_not_in_control(accounts: Accounts) -> None:
    app = create_app(Untouchable(), allowed_hosts=["console"], access=accounts.access)
    accounts.access.control.take(accounts.visitor("admin"))
    acts = [route for route in routes_of(app) if route[0] in ACTS]
    refused = {
        route
        for route in acts
        if response_status(app, *route, accounts.headers("operator"), quiet=True) == 409
    }
    expected = {
        ("POST", "/api/v1/goals"),
        ("DELETE", "/api/v1/goals/xxxxxxxxxxxxxxxx"),
        ("PATCH", "/api/v1/goals/xxxxxxxxxxxxxxxx"),
    }
    expected |= {("PUT", "/api/v1/goals/order"), ("PUT", "/api/v1/mission/loop")}
    expected |= {("POST", "/api/v1/missions/xxxxxxxxxxxxxxxx/load")}
    expected |= {("POST", "/api/v1/mission/back-off"), ("POST", "/api/v1/localisation/search")}
    expected |= {("POST", "/api/v1/pose")}
    expected |= {("POST", "/api/v1/sites/xxxxxxxxxxxxxxxx/choose")}
    expected |= {("POST", "/api/v1/mission/xxxxxxxxxxxxxxxx"), ("POST", "/api/v1/stop/reset")}
    assert refused == expected


@pytest.mark.parametrize("host", ["console", "CONSOLE:8000", "127.0.0.1:1", "[::1]:8000"])
def test_the_console_answers_to_its_own_names(host: str) -> None:
    app = create_app(FakeOperations(), allowed_hosts=["console", "127.0.0.1", "[::1]"])
    assert (
        response_status(app, "GET", "/healthz", {"Host": host, "Origin": f"http://{host}"}) == 200
    )
    assert (
        response_status(app, "WS", "/api/v1/events", {"Host": host, "Origin": f"http://{host}"})
        == 101
    )


def test_every_answer_carries_the_headers_that_keep_browsers_honest(client: httpx.Client) -> None:
    for path in ("/", "/viewer/", "/api/v1/state", "/nowhere"):
        headers = client.get(path).headers
        assert (
            headers["x-content-type-options"] == "nosniff"
            and "frame-ancestors 'self'" in headers["content-security-policy"]
        )
    assert "unsafe" not in client.get("/").headers["content-security-policy"]
    assert client.get("/healthz", headers={"Host": "evil.example"}).status_code == 421


@pytest.mark.parametrize("end", ["\n", "\r", "\x00", "\x7f"])
def test_no_route_is_reached_by_a_path_that_only_a_router_takes_for_its_own(
    end: str, accounts: Accounts
) -> None:
    app = create_app(Untouchable(), allowed_hosts=["console"], access=accounts.access)
    accounts.access.control.take(accounts.visitor("admin"))
    reached = {
        (method, path): status
        for method, path in routes_of(app)
        if (
            status := response_status(
                app, method, path + end, accounts.headers("operator"), quiet=True
            )
        )
        not in (403, 404)
    }
    assert reached == {}


@pytest.mark.parametrize(
    ("host", "local", "is_answered"),
    [
        ("192.168.7.5:8000", "192.168.7.5", True),
        ("192.168.7.5", "::ffff:192.168.7.5", True),
        ("[fe80::1]:8000", "fe80::1%wlan0", True),
        ("192.168.7.6:8000", "192.168.7.5", False),
        ("[fe80::1%eth0]:8000", "fe80::1%wlan0", False),
        ("192.168.7.5.example.org:8000", "192.168.7.5", False),
        ("evil.example", "192.168.7.5", False),
        ("evil.example", "evil.example", False),
        ("192.168.7.5:8000:8000", "192.168.7.5", False),
        ("", "", False),
    ],
)
def test_the_console_answers_to_the_address_that_the_connection_came_to_and_to_no_other(
    host: str, local: str, is_answered: bool
) -> None:
    """A computer that starts before its Wi-Fi gets its address later."""
    scope = {"type": "http", "method": "GET", "path": "/", "server": (local, 8000)}
    refusal = check_origin(scope, Headers({"host": host}), frozenset({"console"}))
    assert (refusal is None) == is_answered
    other = Headers({"host": host, "origin": "http://192.168.7.5:9999"})
    assert check_origin(scope, other, frozenset({"console"})) is not None


def test_a_stop_with_a_slash_at_its_end_is_one_for_every_visitor(accounts: Accounts) -> None:
    operations = FakeOperations()
    app = create_app(operations, allowed_hosts=["console"], access=accounts.access)
    for name in ("viewer", "operator"):
        assert response_status(app, "POST", "/api/v1/stop/", accounts.headers(name)) == 200
    assert len(operations.stops) == 2
