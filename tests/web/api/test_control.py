"""Control of the robot as pages and programs see it, and teleoperation."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import httpx
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from navcore.errors import Refused
from navcore.geometry.transform import Twist
from navcore.mission.mission import Phase
from tests.web.conftest import Accounts
from tests.web.fake_operations import FakeOperations
from web.api.mission.control import MAX_DELAY_S, MAX_LATE, MAX_TEXT, TeleopSession
from web.auth.access import Access
from web.auth.authenticator import AnonymousAuthenticator
from web.auth.control_lease import PAGE_LEASE_S, ControlLeases
from web.auth.presence import PresenceMonitor
from web.auth.roles import Role, Visitor
from web.interface.operations import MissionAction
from web.schemas.mission.teleop import DriveMessage
from web.server import ConsoleServer

AHEAD = {"type": "drive", "v_mps": 0.3, "w_radps": 0.0}


def live(server: ConsoleServer, **headers: str) -> Connection:
    """Send a page's sign of life."""
    return connect(
        server.url.replace("http", "ws") + "/api/v1/control/live",
        proxy=None,
        additional_headers=headers,
    )


def news(socket: Connection, **wanted: Any) -> dict[str, Any]:
    """Return the next message with these values."""
    for _ in range(200):
        message: dict[str, Any] = json.loads(socket.recv(timeout=60))
        if all(message.get(key) == value for key, value in wanted.items()):
            return message
    raise AssertionError(f"it was never said that {wanted}")


def push(socket: Connection, at_ms: float, **changes: Any) -> None:
    """Return a velocity, sent at a time of the page's clock."""
    socket.send(json.dumps({**AHEAD, "t_ms": at_ms, **changes}))


def eventually(holds: Any) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture
def unhurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Prolong the leases: a slow machine is not a silent operator."""
    monkeypatch.setattr("web.auth.control_lease.PAGE_LEASE_S", 60.0)


@contextmanager
def page_of(server: ConsoleServer) -> Iterator[httpx.Client]:
    """Return a browser that has opened the page of a console without users."""
    with httpx.Client(base_url=server.url, trust_env=False, timeout=60) as page:
        assert page.get("/").status_code == 200 and len(page.cookies) == 1
        yield page


@pytest.mark.usefixtures("unhurried")
def test_on_loopback_the_first_page_to_act_drives_and_the_others_see_its_name(
    server: ConsoleServer,
) -> None:
    with page_of(server) as first, page_of(server) as second:
        assert second.get("/api/v1/control").json()["holder"] is None
        assert first.post("/api/v1/goals", json={"x_m": 3, "y_m": 0}).status_code == 201
        refused = second.post("/api/v1/mission/start")
        assert refused.status_code == 409 and refused.json()["error"]["code"] == "not_in_control"
        assert "console" in refused.json()["error"]["message"]
        ring = [[4, -1], [5, -1], [5, 1]]
        zone = {"name": "wet floor", "geometry": {"type": "Polygon", "coordinates": [ring]}}
        assert second.post("/api/v1/zones", json=zone).status_code == 201
        assert second.post("/api/v1/control/take").json()["yours"]
        lost = first.get("/api/v1/control").json()
        assert (lost["yours"], lost["was_yours"], lost["taken"]) == (False, True, True)
        assert second.post("/api/v1/mission/start").status_code == 200
        assert first.post("/api/v1/stop").json()["stop_latched"]


@pytest.mark.usefixtures("unhurried")
def test_the_holder_sees_who_asks_and_giving_passes_control_on(
    locked: ConsoleServer, accounts: Accounts
) -> None:
    bearer = {
        name: {"Authorization": f"Bearer {accounts.tokens[name]}"} for name in ("admin", "operator")
    }
    with live(locked, **bearer["admin"]) as admin, live(locked, **bearer["operator"]) as operator:
        assert news(admin, yours=False)["holder"] is None
        httpx.post(
            f"{locked.url}/api/v1/control/take",
            headers=bearer["admin"],
            trust_env=False,
            timeout=60.0,
        )
        assert news(operator, yours=False, serial=1)["holder"]["name"] == "admin"
        httpx.post(
            f"{locked.url}/api/v1/control/ask",
            headers=bearer["operator"],
            trust_env=False,
            timeout=60.0,
        )
        assert news(admin, serial=2)["asking"]["name"] == "operator"
        httpx.post(
            f"{locked.url}/api/v1/control/give",
            headers=bearer["admin"],
            trust_env=False,
            timeout=60.0,
        )
        assert news(operator, yours=True)["taken"] is False
        assert news(admin, yours=False, was_yours=True)["holder"]["name"] == "operator"


def test_a_hand_moves_the_robot_and_lets_go_when_the_page_goes(
    server: ConsoleServer, operations: FakeOperations
) -> None:
    with live(server) as page:
        push(page, 0.0)
        eventually(lambda: operations.hand == Twist(v_mps=0.3, w_radps=0.0))
        push(page, 80.0, v_mps=0.0)
        eventually(lambda: operations.hand is None)
        push(page, 160.0)
        eventually(lambda: operations.hand is not None)
    eventually(lambda: operations.hand is None)


def test_a_viewer_cannot_drive_by_hand(
    locked: ConsoleServer, accounts: Accounts, operations: FakeOperations
) -> None:
    with live(locked, Authorization=f"Bearer {accounts.tokens['viewer']}") as page:
        push(page, 0.0)
        push(page, 10.0)
        news(page, type="control")
        news(page, type="control")
    assert operations.hands == []


@pytest.mark.usefixtures("unhurried")
def test_teleoperation_without_control_is_refused(
    server: ConsoleServer, operations: FakeOperations
) -> None:
    with page_of(server) as other, live(server) as page:
        other.post("/api/v1/control/take")
        push(page, 0.0)
        assert "is in control" in news(page, type="refused")["message"]
    assert operations.hands == []


def test_velocities_that_were_held_up_on_the_way_are_not_driven() -> None:
    operations = FakeOperations()
    visitor = Visitor(name="anna", role=Role.OPERATOR, client_id="page anna")
    hand, sent_s = TeleopSession(operations, ControlLeases(), visitor), time.monotonic()
    assert hand.move(DriveMessage(**AHEAD, t_ms=sent_s * 1000))  # type: ignore[arg-type]
    late_s = sent_s - MAX_DELAY_S - 0.05
    assert not hand.move(DriveMessage(**AHEAD, t_ms=late_s * 1000))  # type: ignore[arg-type]
    assert len(operations.hands) == 1
    hand.release()
    assert operations.hands[-1] is None


def test_an_operator_whose_velocities_all_come_too_late_is_told_so_once() -> None:
    visitor = Visitor(name="anna", role=Role.OPERATOR, client_id="page anna")
    hand, sent_s = TeleopSession(FakeOperations(), ControlLeases(), visitor), time.monotonic()
    on_time = DriveMessage(**AHEAD, t_ms=sent_s * 1000)  # type: ignore[arg-type]
    late = DriveMessage(**AHEAD, t_ms=(sent_s - MAX_DELAY_S - 0.1) * 1000)  # type: ignore[arg-type]
    for _ in range(2):
        assert hand.move(on_time)
        assert not any(hand.move(late) for _ in range(MAX_LATE - 1))
    with pytest.raises(Refused, match="connection is too slow"):
        hand.move(late)
    assert not any(hand.move(late) for _ in range(2 * MAX_LATE))


@pytest.mark.parametrize(
    "message",
    [
        "",
        "[]",
        '{"type":"drive","v_mps":NaN,"w_radps":0,"t_ms":0}',
        '{"type":"drive","v_mps":99,"w_radps":0,"t_ms":0}',
        '{"type":"here"}' + " " * MAX_TEXT,
    ],
)
def test_a_hand_that_speaks_nonsense_is_cut_off(
    server: ConsoleServer, operations: FakeOperations, message: str
) -> None:
    with live(server) as page:
        page.send(message)
        with pytest.raises(ConnectionClosed):
            for _ in range(20):
                page.recv(timeout=60)
    assert operations.hands == []


@pytest.mark.parametrize(
    "message",
    [
        json.dumps({"type": "stop", "by": "x" * MAX_TEXT}),
        '{"by":"' + "x" * MAX_TEXT + '", "type" : "stop"}',
        r'{"type":"stop","by":"\ud83d"}',
        '{"type":"stop","by":"a\tb"}',
        '{"type":"stop","by":' + "[" * 250 + "]" * 250 + "}",
        '{"type":"stop","by":',
    ],
)
def test_a_stop_on_the_connection_is_not_refused_for_its_label(
    server: ConsoleServer, operations: FakeOperations, message: str
) -> None:
    with live(server) as page:
        page.send(message)
        eventually(lambda: operations.stops)
        news(page, type="stopped")
    assert operations.stops == ["console"]


def test_one_visitor_has_so_many_connections_and_takes_none_from_another(
    locked: ConsoleServer, accounts: Accounts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("web.gateway.guard.MAX_SOCKETS", 2)

    def connected(who: str) -> Connection:
        return live(locked, Authorization=f"Bearer {accounts.tokens[who]}")

    def is_refused() -> bool:
        try:
            with connected("viewer"):
                return False
        except InvalidStatus:
            return True

    with connected("viewer"):
        with connected("viewer"):
            assert is_refused()
            with connected("operator"):
                pass
        eventually(lambda: not is_refused())


def test_a_page_takes_no_connections_from_one_that_has_its_former_name(
    server: ConsoleServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("web.gateway.guard.MAX_SOCKETS", 1)

    with page_of(server) as first, page_of(server) as second:
        cookies = [
            "; ".join(f"{key}={value}" for key, value in page.cookies.items())
            for page in (first, second)
        ]
        with live(server, Cookie=f"{cookies[0]}; bewarenav-name=Vera"):
            named = {"Cookie": f"{cookies[0]}; bewarenav-name=Ana"}
            assert first.get("/api/v1/me", headers=named).json()["name"] == "Ana"
            with live(server, Cookie=f"{cookies[1]}; bewarenav-name=Vera"):
                pass


@pytest.mark.parametrize("action", ["start", "leave"])
@pytest.mark.parametrize("unattended", ["pause", "go on"])
def test_when_the_operator_goes_silent_the_mission_does_as_configured(
    unattended: Any, action: MissionAction
) -> None:
    now_s = [0.0]
    operations, control = FakeOperations(), ControlLeases(clock=lambda: now_s[0])
    presence = PresenceMonitor(operations, Access(control=control), unattended)
    control.claim(Visitor(name="anna", role=Role.OPERATOR, client_id="page anna"))
    operations.goals.add(3, 0)
    operations.mission(action)
    driving = operations.state().phase
    presence.check()
    now_s[0] += PAGE_LEASE_S - 0.1
    presence.check()
    assert operations.state().phase is driving
    now_s[0] += 0.2
    for _ in range(2):
        presence.check()
        phase = Phase.PAUSED if unattended == "pause" else driving
        assert operations.state().phase is phase


@pytest.mark.parametrize("is_hanging", [True, False])
def test_the_mission_of_a_silent_operator_is_paused_whatever_becomes_of_the_accounts(
    is_hanging: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("web.auth.presence.JOIN_S", 0.1)
    released = threading.Event()

    class Accounts(AnonymousAuthenticator):
        """Accounts on a disk that fails, or does not answer."""

        def refresh(self) -> None:
            if is_hanging:
                released.wait(60)
            raise OSError("no disk")

    now_s = [0.0]
    operations, control = FakeOperations(), ControlLeases(clock=lambda: now_s[0])
    access = Access(authenticator=Accounts(), control=control)
    presence = PresenceMonitor(operations, access, "pause")
    presence.check()
    control.claim(Visitor(name="anna", role=Role.OPERATOR, client_id="page anna"))
    operations.goals.add(3, 0)
    operations.mission("start")
    presence.check()
    presence.start()
    try:
        now_s[0] += PAGE_LEASE_S + 0.1
        eventually(lambda: operations.state().phase is Phase.PAUSED)
    finally:
        released.set()
        presence.stop()


def test_a_page_that_lost_control_does_not_end_what_its_successor_does() -> None:
    operations, control = FakeOperations(), ControlLeases()
    anna = Visitor(name="anna", role=Role.OPERATOR, client_id="page anna")
    hand = TeleopSession(operations, control, anna)
    assert hand.move(DriveMessage(**AHEAD, t_ms=time.monotonic() * 1000))  # type: ignore[arg-type]
    control.take(Visitor(name="bob", role=Role.OPERATOR, client_id="page bob"))
    hand.release()
    assert operations.hands == [Twist(v_mps=0.3, w_radps=0.0)]


def test_a_page_whose_control_has_lapsed_still_stops_the_robot_that_it_drives() -> None:
    now_s = [0.0]
    operations, control = FakeOperations(), ControlLeases(clock=lambda: now_s[0])
    anna = Visitor(name="anna", role=Role.OPERATOR, client_id="page anna")
    hand = TeleopSession(operations, control, anna)
    assert hand.move(DriveMessage(**AHEAD, t_ms=time.monotonic() * 1000))  # type: ignore[arg-type]
    now_s[0] += PAGE_LEASE_S + 0.1
    hand.release()
    assert operations.hands == [Twist(v_mps=0.3, w_radps=0.0), None]


@pytest.mark.parametrize("who", ["viewer", "operator"])
def test_the_stop_is_heard_on_the_sign_of_life_too_and_from_everybody(
    who: str, locked: ConsoleServer, accounts: Accounts, operations: FakeOperations
) -> None:
    def logged() -> int:
        return sum(entry["path"].startswith("stop?") for entry in accounts.store.audit.newest())

    with live(locked, Authorization=f"Bearer {accounts.tokens[who]}") as page:
        for _ in range(2):
            page.send(json.dumps({"type": "stop", "by": "console key"}))
        eventually(lambda: len(operations.stops) == 2 and logged() == 1)
    assert set(operations.stops) == {f"{who} (console key)"}


def test_a_stop_on_the_sign_of_life_is_answered(
    server: ConsoleServer, operations: FakeOperations
) -> None:
    with live(server) as page:
        page.send(json.dumps({"type": "stop", "by": "console key"}))
        assert news(page, type="stopped") == {"type": "stopped"}
        assert operations.stops == ["console key"]


@pytest.mark.parametrize("by", ["", "\n", 7, "x" * 500])
def test_no_label_refuses_a_stop_on_the_sign_of_life(
    server: ConsoleServer, operations: FakeOperations, by: object
) -> None:
    with live(server) as page:
        page.send(json.dumps({"type": "stop", "by": by, "pressed": "twice"}))
        eventually(lambda: operations.stops)
        news(page, type="control")
    assert operations.stops == ["x" * 80 if by == "x" * 500 else "console"]


def test_a_stop_waits_neither_for_the_log_nor_for_the_state(
    operations: FakeOperations, monkeypatch: pytest.MonkeyPatch
) -> None:
    written, entries = threading.Event(), list[str]()

    class SlowLog:
        newest: Any = None

        def add(self, entry: Mapping[str, Any]) -> int:
            assert written.wait(60)
            entries.append(entry["path"])
            return len(entries)

    access = Access(audit_log=SlowLog())
    stopping = ConsoleServer(operations, port=0, access=access)
    stopping.start()
    try:
        with live(stopping) as page:
            monkeypatch.setattr(operations, "state", written.wait)
            push(page, 0.0)
            page.send(json.dumps({"type": "stop", "by": "console key"}))
            eventually(lambda: operations.stops)
            assert not entries
            written.set()
            eventually(lambda: len(entries) == 3)
            assert entries == ["by hand: begins", "stop?by=console key", "by hand: ends"]
    finally:
        written.set()
        stopping.stop()


def test_of_a_drive_key_that_is_pressed_again_and_again_one_drive_a_second_is_logged(
    locked: ConsoleServer, accounts: Accounts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("web.auth.audit.REPEAT_PERIOD_S", 60.0)

    def logged() -> list[str]:
        return [entry["path"] for entry in reversed(accounts.store.audit.newest())]

    with live(locked, Authorization=f"Bearer {accounts.tokens['operator']}") as page:
        for _ in range(20):
            push(page, 0.0)
            push(page, 0.0, v_mps=0.0)
        page.send(json.dumps({"type": "stop", "by": "console key"}))
        eventually(lambda: len(logged()) >= 3)
        assert logged() == ["by hand: begins", "by hand: ends", "stop?by=console key"]


def test_the_end_of_a_drive_by_a_page_that_is_closed_is_logged(
    locked: ConsoleServer, accounts: Accounts
) -> None:
    with live(locked, Authorization=f"Bearer {accounts.tokens['operator']}") as page:
        push(page, 0.0)
        eventually(lambda: len(accounts.store.audit.newest()) == 1)
    eventually(lambda: len(accounts.store.audit.newest()) == 2)
    assert accounts.store.audit.newest()[0]["path"] == "by hand: ends"
