"""Log-in, roles, sessions, control; only the monotonic clock counts."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import msgspec
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from app.bench.console.viser_client import camera
from navcore.errors import BadConfiguration, Refused, StorageFailed
from tests.reliability.routes import response_status
from tests.web.conftest import PASSWORD, Accounts
from tests.web.fake_operations import FakeOperations
from tests.web.test_server import PAGE, scene, viewer_of
from web.auth.access import Access
from web.auth.authenticator import PasswordAuthenticator
from web.auth.control_lease import PROGRAM_LEASE_S, ControlLeases
from web.auth.permissions import requirement_of
from web.auth.rate_limit import BURST, FOR_ALL, PERIOD_S, RateLimiter
from web.auth.roles import Role
from web.auth.sessions import MAX_AGE_S, MAX_IDLE_S, Sessions
from web.auth.users import User, hash_password, is_password, new_user
from web.server import ConsoleServer, create_app

ANNA = User(name="anna", role=Role.OPERATOR, password_hash="-")


class Clock:
    """Clock that the test advances."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@contextmanager
def browser(server: ConsoleServer, name: str | None = None) -> Iterator[httpx.Client]:
    """Return a browser in which a user is logged in."""
    accepts = {"Accept": "text/html"}
    with httpx.Client(
        base_url=server.url, trust_env=False, headers=accepts, follow_redirects=True, timeout=60
    ) as client:
        if name is not None:
            assert (
                client.post("/login", data={"name": name, "password": PASSWORD}).status_code == 200
            )
        yield client


def test_a_program_needs_the_token_of_a_user(locked: ConsoleServer, accounts: Accounts) -> None:
    with httpx.Client(base_url=locked.url, trust_env=False, timeout=60.0) as program:
        assert program.get("/api/v1/state").status_code == 401
        assert (
            program.get("/api/v1/state", headers={"Authorization": "Bearer wrong"}).status_code
            == 401
        )
        token = {"Authorization": f"Bearer {accounts.tokens['viewer']}"}
        assert program.get("/api/v1/me", headers=token).json() == {
            "name": "viewer",
            "role": "viewer",
            "logged_in": True,
        }
    address = locked.url.replace("http", "ws") + "/api/v1/events"
    with pytest.raises(InvalidStatus), connect(address, proxy=None):
        pass
    with connect(address, proxy=None, additional_headers=token) as socket:
        assert "state" in str(socket.recv(timeout=60))


def test_a_browser_logs_in_by_the_form_keeps_a_strict_cookie_and_logs_out(
    locked: ConsoleServer,
) -> None:
    with browser(locked) as client:
        page = client.get("/")
        assert (
            page.status_code == 401
            and "<form" in page.text
            and "script" not in page.headers["content-security-policy"]
        )
        for name, password in (("operator", "wrong"), ("unknown", PASSWORD), ("", "")):
            refused = client.post("/login", data={"name": name, "password": password})
            assert (
                refused.status_code == 401
                and "wrong" in refused.text
                and "set-cookie" not in refused.headers
            )
        answer = client.post(
            "/login", data={"name": "operator", "password": PASSWORD}, follow_redirects=False
        )
        cookie = answer.headers["set-cookie"]
        assert answer.status_code == 303 and "HttpOnly" in cookie and "SameSite=strict" in cookie
        assert (
            client.get("/").status_code == 200
            and client.get("/api/v1/me").json()["name"] == "operator"
        )
        client.post("/logout")
        assert client.get("/api/v1/state").status_code == 401


def test_a_login_from_another_page_is_refused(locked: ConsoleServer) -> None:
    with browser(locked) as client:
        form = {"name": "operator", "password": PASSWORD}
        answer = client.post("/login", data=form, headers={"Origin": "http://evil.example"})
        assert answer.status_code == 403 and "set-cookie" not in answer.headers


def test_whoever_guesses_has_to_wait(
    locked: ConsoleServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "web.auth.rate_limit.PERIOD_S", 600.0
    )  # so that a slow machine gets no try more
    with browser(locked) as client:
        statuses = [
            client.post("/login", data={"name": "admin", "password": "no"}).status_code
            for _ in range(BURST + 1)
        ]
        assert statuses == [401] * BURST + [429]
        late = client.post("/login", data={"name": "admin", "password": PASSWORD})
        assert late.status_code == 429 and 0 < int(late.headers["retry-after"]) <= 600


def test_the_rate_limit_allows_tries_again_with_time_and_counts_each_address_by_itself() -> None:
    clock = Clock()
    limiter = RateLimiter(clock=clock)
    assert [limiter.wait_s("a") for _ in range(BURST + 2)] == [0] * BURST + [6, 6]
    assert limiter.wait_s("b") == 0
    clock.now_s += PERIOD_S
    assert [limiter.wait_s("a"), limiter.wait_s("a")] == [0, 6]
    limiter.refund("a")
    assert [limiter.wait_s("a"), limiter.wait_s("a")] == [0, 6]
    assert sum(limiter.wait_s(f"address {n}") == 0 for n in range(1000)) <= 10 * BURST


def test_one_right_password_gives_back_one_try_of_all() -> None:
    limiter = RateLimiter(clock=Clock())
    allowed = next(n for n in itertools.count() if limiter.wait_s(f"address {n}"))
    assert BURST < allowed <= BURST * FOR_ALL
    limiter.refund("address 0")
    assert [limiter.wait_s("another"), limiter.wait_s("a third")] == [0, 1]


def test_whoever_guesses_the_present_password_of_a_session_has_to_wait_too(
    locked: ConsoleServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("web.auth.rate_limit.PERIOD_S", 600.0)
    with browser(locked, "viewer") as viewer:
        guess = {"present": "a guess", "password": "another long one"}
        tries = [viewer.put("/api/v1/me/password", json=guess) for _ in range(BURST + 1)]
        assert [one.status_code for one in tries] == [409] * BURST + [429]
        assert 0 < int(tries[-1].headers["retry-after"]) <= 600
        late = viewer.post("/login", data={"name": "viewer", "password": PASSWORD})
        assert late.status_code == 429


def test_a_right_password_that_cannot_be_stored_counts_as_no_wrong_one(
    locked: ConsoleServer, accounts: Accounts, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> User:
        raise StorageFailed("the disk is full")

    monkeypatch.setattr("web.auth.rate_limit.PERIOD_S", 600.0)
    monkeypatch.setattr(accounts.store.users, "change", full)
    with browser(locked, "viewer") as viewer:
        change = {"present": PASSWORD, "password": "another long one"}
        tries = [viewer.put("/api/v1/me/password", json=change) for _ in range(BURST + 1)]
    assert [one.status_code for one in tries] == [503] * (BURST + 1)


def test_what_is_typed_as_a_name_is_logged_only_if_an_account_has_it(
    locked: ConsoleServer, accounts: Accounts
) -> None:
    with browser(locked) as client:
        for name in ("correct horse", "viewer"):
            client.post("/login", data={"name": name, "password": "no"})
    who = [one["who"] for one in accounts.store.audit.newest() if one["path"] == "/login"]
    assert who == ["viewer", "unknown"]


def test_a_password_is_kept_as_a_salted_hash_and_known_again() -> None:
    kept = [hash_password(PASSWORD) for _ in range(2)]
    assert kept[0] != kept[1] and PASSWORD not in kept[0]
    assert is_password(PASSWORD, kept[0]) and not is_password(PASSWORD + " ", kept[0])
    with pytest.raises(BadConfiguration, match="10 to 200"):
        hash_password("short")
    with pytest.raises(BadConfiguration, match="user name"):
        new_user("a b\n", Role.VIEWER, PASSWORD)


@pytest.mark.parametrize("wall_s", [-3600.0, 0.0, 3600.0])
def test_a_session_ends_by_idleness_by_age_and_by_log_out_whatever_the_wall_clock_does(
    wall_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, began = Clock(), time.time()
    sessions = Sessions(clock=clock)
    cookie = sessions.begin(ANNA)
    monkeypatch.setattr(time, "time", lambda: began + wall_s)
    monkeypatch.setattr(time, "time_ns", lambda: int((began + wall_s) * 1e9))
    assert sessions.find(cookie, renews=True) is not None and sessions.find("another") is None
    clock.now_s += MAX_IDLE_S - 1
    assert sessions.find(cookie, renews=True) is not None
    clock.now_s += MAX_IDLE_S + 1
    assert sessions.find(cookie, renews=True) is None
    cookie = sessions.begin(ANNA)
    for _ in range(int(MAX_AGE_S / MAX_IDLE_S)):
        clock.now_s += MAX_IDLE_S - 1
        assert sessions.find(cookie, renews=True) is not None
    clock.now_s += MAX_IDLE_S - 1
    assert sessions.find(cookie, renews=True) is None
    cookie = sessions.begin(ANNA)
    sessions.end(cookie)
    assert sessions.find(cookie, renews=True) is None


def test_a_session_by_the_wall_clock_would_end_when_it_jumps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Control of the test above."""
    sessions, began = Sessions(clock=lambda: time.time()), time.time()
    cookie = sessions.begin(ANNA)
    monkeypatch.setattr(time, "time", lambda: began + 13 * 3600)
    assert sessions.find(cookie, renews=True) is None


@pytest.mark.parametrize(
    ("method", "path", "goes_on"),
    [
        ("POST", "/api/v1/zones/undo", True),
        ("POST", "/api/v1/stop", True),
        ("GET", "/", True),
        ("GET", "/api/v1/path", False),
        ("GET", "/metrics", False),
        ("WS", "/api/v1/events", False),
        ("WS", "/api/v1/control/live", False),
        ("POST", "/api/v1/beware/colour/looks", False),
    ],
)
def test_a_session_goes_on_by_what_its_user_does_not_by_what_an_open_page_does(
    method: str, path: str, goes_on: bool, accounts: Accounts
) -> None:
    clock = Clock()
    sessions = Sessions(clock=clock)
    access = Access(authenticator=PasswordAuthenticator(accounts.store.users, sessions))
    app = create_app(FakeOperations(), allowed_hosts=["console"], access=access)
    (operator,) = (user for user in accounts.store.users.all() if user.name == "operator")
    page = {"Host": "console", "Cookie": f"bewarenav_0={sessions.begin(operator)}"}
    clock.now_s += MAX_IDLE_S - 1
    assert response_status(app, method, path, page) != (403 if method == "WS" else 401)
    clock.now_s += 2
    assert response_status(app, "GET", "/api/v1/me", page) == (200 if goes_on else 401)


@pytest.mark.parametrize(
    ("message", "goes_on"),
    [
        ({"type": "drive", "v_mps": 0.3, "w_radps": 0.0, "t_ms": 0.0}, True),
        ({"type": "stop", "by": "console key"}, True),
        ({"type": "here"}, False),
    ],
)
def test_whoever_drives_or_stops_by_the_page_stays_logged_in_not_a_page_that_is_only_open(
    message: dict[str, Any], goes_on: bool, accounts: Accounts
) -> None:
    clock = Clock()
    sessions = Sessions(clock=clock)
    access = Access(authenticator=PasswordAuthenticator(accounts.store.users, sessions))
    app = create_app(FakeOperations(), allowed_hosts=["console"], access=access)
    (operator,) = (user for user in accounts.store.users.all() if user.name == "operator")
    page = {"Host": "console", "Cookie": f"bewarenav_0={sessions.begin(operator)}"}
    clock.now_s += MAX_IDLE_S - 1
    sent = {"type": "websocket.receive", "text": json.dumps(message)}
    assert response_status(app, "WS", "/api/v1/control/live", page, messages=[sent]) == 101
    clock.now_s += 2
    assert response_status(app, "GET", "/api/v1/me", page) == (200 if goes_on else 401)


def test_a_program_keeps_control_by_what_it_does_not_by_what_it_reads(accounts: Accounts) -> None:
    clock = Clock()
    control = ControlLeases(clock=clock)
    access = Access(authenticator=accounts.access.authenticator, control=control)
    app = create_app(FakeOperations(), allowed_hosts=["console"], access=access)

    def ask(method: str, path: str) -> int:
        return response_status(app, method, path, accounts.headers("operator"))

    assert ask("POST", "/api/v1/control/take") == 200
    for path in ("keep", "ask", "keep"):
        clock.now_s += PROGRAM_LEASE_S - 1
        assert ask("POST", f"/api/v1/control/{path}") == 200
        assert control.now.holder is not None
    clock.now_s += PROGRAM_LEASE_S - 1
    for path in ("/metrics", "/healthz", "/api/v1/state", "/api/v1/control"):
        assert ask("GET", path) == 200
    clock.now_s += 2
    assert control.now.holder is None
    assert ask("POST", "/api/v1/control/keep") == 409


def test_admins_keep_the_users_and_a_change_ends_the_sessions_it_concerns(
    locked: ConsoleServer,
) -> None:
    with browser(locked, "admin") as admin, browser(locked, "viewer") as viewer:
        assert viewer.get("/api/v1/users").status_code == 403
        added = admin.post(
            "/api/v1/users", json={"name": "bob", "role": "operator", "password": "long enough"}
        )
        assert added.json() == {"name": "bob", "role": "operator", "has_token": False}
        assert (
            admin.post(
                "/api/v1/users", json={"name": "bob", "role": "viewer", "password": "long enough"}
            ).status_code
            == 409
        )
        folder = {"name": "..", "role": "viewer", "password": "long enough"}
        assert admin.post("/api/v1/users", json=folder).status_code == 422
        token = admin.post("/api/v1/users/bob/token").json()["token"]
        bearer = {"Authorization": f"Bearer {token}"}
        assert (
            httpx.get(
                f"{locked.url}/api/v1/me", headers=bearer, trust_env=False, timeout=60.0
            ).json()["name"]
            == "bob"
        )
        # A browser stays logged in.
        assert admin.post("/api/v1/users/admin/token").status_code == 201
        assert admin.delete("/api/v1/users/bob").status_code == 204
        assert (
            httpx.get(
                f"{locked.url}/api/v1/me", headers=bearer, trust_env=False, timeout=60.0
            ).status_code
            == 401
        )
        refused = admin.put("/api/v1/users/admin/role", json={"role": "viewer"})
        assert refused.status_code == 409 and "last admin" in refused.text
        assert viewer.get("/api/v1/me").status_code == 200
        own = {"present": PASSWORD, "password": "another long one"}
        assert (
            viewer.put("/api/v1/me/password", json={**own, "present": "wrong"}).status_code == 409
        )
        assert viewer.put("/api/v1/me/password", json=own).status_code == 204
        assert viewer.get("/api/v1/me").status_code == 401
        assert PASSWORD not in admin.get("/api/v1/audit").text


def test_a_socket_is_cut_off_when_its_user_may_no_longer_come_in(
    locked: ConsoleServer, accounts: Accounts
) -> None:
    headers = {"Authorization": f"Bearer {accounts.tokens['viewer']}"}
    with connect(
        locked.url.replace("http", "ws") + "/api/v1/events", proxy=None, additional_headers=headers
    ) as socket:
        socket.recv(timeout=60)
        accounts.store.users.remove("viewer")
        with pytest.raises(ConnectionClosed):
            for _ in range(1000):
                socket.recv(timeout=60)


def test_a_viewer_of_the_3d_view_moves_the_camera_and_clicks_nothing(
    locked: ConsoleServer, accounts: Accounts, operations: FakeOperations
) -> None:
    click: dict[str, Any] = {
        "type": "ScenePointerMessage",
        "event_type": "click",
        "modifier": None,
        "screen_pos": [[0.5, 0.5]],
    }
    click |= {"ray_origin": [0.0, 0.0, 10.0], "ray_direction": [0.1, 0.2, -1.0]}
    heard: dict[str, dict[str, Any] | None] = {}
    for name in ("operator", "viewer"):
        headers = {"Authorization": f"Bearer {accounts.tokens[name]}"}
        link = locked.url.replace("http", "ws") + f"/api/v1/viewer/{PAGE}"
        with (
            connect(link, proxy=None, additional_headers=headers) as page,
            viewer_of(locked, f"/viewer/{PAGE}", additional_headers=headers) as viewer,
        ):
            viewer.send(camera())
            while not json.loads(page.recv(timeout=60)).get("connected"):
                pass  # the one before has the same page and may leave it only now
            scene(viewer, {"/floor/0_0"})
            page.send(json.dumps({"type": "draft", "mode": "goal", "corners": [], "path": []}))
            time.sleep(0.2)
            viewer.send(msgspec.msgpack.encode(click))
            heard[name] = _next_or_none(page)
    assert heard["operator"] is not None and heard["operator"]["type"] == "click"
    assert heard["viewer"] is None


def _next_or_none(page: Any) -> dict[str, Any] | None:
    try:
        message: dict[str, Any] = json.loads(page.recv(timeout=1.5))
    except TimeoutError:
        return None
    return message


def test_every_change_is_logged_with_its_visitor_and_its_outcome(locked: ConsoleServer) -> None:
    ring = [[4, -1], [5, -1], [5, 1]]
    with browser(locked, "operator") as operator, browser(locked, "viewer") as viewer:
        zone = {"name": "wet floor", "geometry": {"type": "Polygon", "coordinates": [ring]}}
        viewer.post("/api/v1/stop?by=test")
        operator.post("/api/v1/zones", json=zone)
        viewer.post("/api/v1/zones", json=zone)
        operator.get("/api/v1/state")
        entries = operator.get("/api/v1/audit").json()
        assert viewer.get("/api/v1/audit").status_code == 403
        said = [
            (entry["who"], entry["method"], entry["path"], entry["status"])
            for entry in reversed(entries)
        ]
        assert said[2:] == [
            ("viewer", "POST", "/api/v1/stop?by=test", 200),
            ("operator", "POST", "/api/v1/zones", 201),
            ("viewer", "POST", "/api/v1/zones", 403),
        ]
        assert next(entry for entry in entries if entry["status"] == 201)["detail"] == zone
        older = operator.get(f"/api/v1/audit?count=1&before={entries[0]['id']}").json()
        assert [entry["id"] for entry in older] == [entries[1]["id"]]


def test_the_audit_is_asked_by_name_and_by_time(locked: ConsoleServer) -> None:
    with browser(locked, "operator") as operator, browser(locked, "viewer") as viewer:
        for program in (operator, viewer, operator):
            program.post("/api/v1/control/ask")

        def ids(**asked: str) -> list[int]:
            return [entry["id"] for entry in operator.get("/api/v1/audit", params=asked).json()]

        entries = operator.get("/api/v1/audit").json()
        hers = [entry for entry in entries if entry["who"] == "viewer"]
        assert len(hers) == 2 and ids(who="viewer") == [entry["id"] for entry in hers]
        at = hers[0]["at"]
        assert ids(since=at, until=at) == [entry["id"] for entry in entries if entry["at"] == at]
        assert ids(since=at) + ids(until=at) == [
            *(entry["id"] for entry in entries if entry["at"] >= at),
            *ids(until=at),
        ]
        assert (
            ids(since="2020-01-01T02:00:00+02:00") == ids()
            and ids(until="2020-01-01T00:00:00Z") == ids(who="unknown") == []
        )
        for wrong in ({"since": "yesterday"}, {"until": "2020-01-01T00:00:00"}, {"who": "x" * 61}):
            assert operator.get("/api/v1/audit", params=wrong).status_code == 422


def test_what_drives_needs_control_and_what_is_not_listed_needs_an_operator() -> None:
    drives = [
        ("POST", "/api/v1/goals"),
        ("PUT", "/api/v1/goals/3"),
        ("POST", "/api/v1/mission/start"),
    ]
    drives += [("POST", "/api/v1/stop/reset"), ("POST", "/api/v1/missions/night/load")]
    drives += [("POST", "/api/v1/sites/hall/choose"), ("POST", "/api/v1/localisation/search")]
    drives += [("POST", "/api/v1/pose")]
    assert all(requirement_of(*request).control for request in drives)
    for query in ("check=false", "check=true&check=0", "check=yeah", "force=true", "checks=true"):
        assert requirement_of("POST", "/api/v1/pose", query).control, query
    for query in ("check=true", "check=1", "force=1&check=On", "check=no&check=yes"):
        assert not requirement_of("POST", "/api/v1/pose", query).control, query
    frees = [
        ("POST", "/api/v1/mission/pause"),
        ("POST", "/api/v1/stop"),
        ("POST", "/api/v1/zones"),
        ("GET", "/api/v1/goals"),
    ]
    assert not any(requirement_of(*request).control for request in frees)
    assert requirement_of("POST", "/api/v1/something/new").role is Role.OPERATOR
    assert requirement_of("POST", "/api/v1/stop").role is Role.VIEWER
    for method, path in (*drives, *frees, ("PUT", "/api/v1/me/language"), ("GET", "/api/v1/audit")):
        assert requirement_of(method, f"{path}/") == requirement_of(method, path), path
    assert requirement_of("GET", "/api/v1/teach/frames.zip").role is Role.OPERATOR
    assert requirement_of("GET", "/api/v1/teach/frames").role is Role.VIEWER
    assert requirement_of("GET", "/api/v1/sites/a hall/export").role is Role.OPERATOR


def test_json_nested_too_deep_is_logged_as_such_and_the_audit_stays_readable(
    locked: ConsoleServer,
) -> None:
    with browser(locked, "operator") as operator:
        for depth in (5, 300, 900):
            headers = {"Content-Type": "application/json"}
            body = "[" * depth + "]" * depth
            operator.post("/api/v1/control/take", content=body, headers=headers)
        audit = operator.get("/api/v1/audit")
        assert audit.status_code == 200
        details = [
            entry["detail"] for entry in audit.json() if entry["path"] == "/api/v1/control/take"
        ]
        assert details == ["1800 bytes, nested too deep", "600 bytes, nested too deep", [[[[[]]]]]]


def test_an_admins_change_is_not_undone_by_one_that_began_before_it(accounts: Accounts) -> None:
    users = accounts.store.users
    (before,) = (user for user in users.all() if user.name == "operator")
    users.change("operator", role=Role.VIEWER)
    after = users.change(
        "operator", password_hash=hash_password("another password"), instead_of=before.password_hash
    )
    assert after.role is Role.VIEWER and after.token_hash == before.token_hash
    with pytest.raises(Refused, match="meanwhile"):
        users.change(
            "operator", password_hash=before.password_hash, instead_of=before.password_hash
        )
    assert users.change("operator", token_hash="f" * 64).password_hash == after.password_hash


def test_a_page_has_the_name_of_its_cookie_and_no_two_have_the_same(
    server: ConsoleServer,
) -> None:
    def name_of(cookie: str | None) -> str:
        with httpx.Client(base_url=server.url, trust_env=False, timeout=60.0) as page:
            page.get("/")
            if cookie is not None:
                page.cookies.set("bewarenav-name", cookie)
            assert page.get("/api/v1/me").json()["name"] == page.get("/api/v1/me").json()["name"]
            return str(page.get("/api/v1/me").json()["name"])

    assert name_of("V%C3%A9ra") == "Véra"
    assert name_of("V%C3%A9ra") == "Véra (2)"
    assert name_of("V%C3%A9ra%20(4)") == "Véra (4)"
    assert name_of("V%C3%A9ra") == "Véra (5)"
    assert name_of("a%20program") == "a program (5)"
    with httpx.Client(base_url=server.url, trust_env=False, timeout=60.0) as page:
        page.get("/")
        headers = {"Cookie": "; ".join(f"{k}={v}" for k, v in page.cookies.items())}
        named = {"Cookie": headers["Cookie"] + "; bewarenav-name=Ana"}
        with connect(
            server.url.replace("http", "ws") + "/api/v1/events",
            proxy=None,
            additional_headers=headers,
        ) as socket:
            socket.recv(timeout=60)
            assert httpx.get(f"{server.url}/api/v1/me", headers=named).json()["name"] == "Ana"
            for _ in range(5):
                socket.recv(timeout=60)  # the connection outlives a change of name
    for refused in (None, "", "a" * 41, "%00", "in%0Ajected"):
        assert name_of(refused).startswith("console ")
