"""What the audit log keeps, and that neither refusals nor repeated stops push it out."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

import httpx
import pytest
from starlette.types import Message

from tests.reliability.routes import response_status
from tests.web.conftest import Accounts
from tests.web.fake_operations import FakeOperations
from web.auth.access import Access
from web.auth.audit import MAX_WAITING, MOST_REFUSED, PERIOD_S, REPEAT_PERIOD_S, Auditor
from web.auth.audit_text import describe_entry
from web.auth.permissions import RESET
from web.auth.roles import Role, Visitor
from web.gateway import guard
from web.schemas.fields import MAX_NAME
from web.server import ConsoleServer, create_app


class Entries(list[Mapping[str, Any]]):
    """An audit log in memory."""

    def add(self, entry: Mapping[str, Any]) -> int:
        self.append(entry)
        return len(self)

    def newest(self, count: int = 100, **_chosen: Any) -> tuple[dict[str, Any], ...]:
        return tuple(dict(entry) for entry in self[: -count - 1 : -1])


REFUSED = {"who": "eve", "role": "viewer", "method": "POST", "path": "/x", "status": 403}


@pytest.mark.parametrize(
    "entry",
    [
        REFUSED,
        {**REFUSED, "method": "PUT", "path": "/api/v1/me/language", "status": 200},
        {"who": "unknown", "method": "POST", "path": "/login", "status": 401, "from": "192.0.2.1"},
    ],
)
def test_so_many_are_logged_within_an_hour_and_the_last_says_so(entry: dict[str, Any]) -> None:
    entries, now = Entries(), 0.0
    auditor = Auditor(entries, clock=lambda: now)
    for _ in range(3 * MOST_REFUSED):
        asyncio.run(auditor.note(entry))
    assert len(entries) == MOST_REFUSED
    assert "the last of" in entries[-1]["note"] and "note" not in entries[-2]
    stops = [
        {**entry, "path": "/api/v1/stop?by=page", "status": 200},
        {**entry, "path": "/api/v1/stop?by=page", "status": 500},
        {"who": entry["who"], "role": "viewer", "method": "WS", "path": "stop?by=console"},
    ]
    others = [
        {**entry, "path": "/x", "status": 200},
        {**entry, "who": "bob"},
        {**entry, "path": "/api/v1/me/password", "status": 200},
        {"who": entry["who"], "method": "POST", "path": "/login", "status": 401, "from": "::1"},
    ]
    for stop in stops:
        auditor.note_stop(stop)
    for other in others:
        asyncio.run(auditor.note(other))
    assert entries[-len(stops + others) :] == stops + others
    now = PERIOD_S
    asyncio.run(auditor.note(entry))
    assert entries[-1] == entry


@pytest.mark.parametrize(
    ("path", "failing"),
    [
        ("/api/v1/stop", "stop"),
        ("/api/v1/mission/back-off", "back_off"),
        ("/api/v1/mission/back-off", "bounded_body"),
    ],
)
def test_a_request_whose_handler_or_guard_fails_is_logged_and_its_answer_has_the_headers(
    path: str, failing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise RuntimeError("a defect")

    operations, entries = FakeOperations(), Entries()
    monkeypatch.setattr(guard if failing == "bounded_body" else operations, failing, fails)
    server = ConsoleServer(operations, port=0, access=Access(audit_log=entries))
    server.start()
    try:
        answer = httpx.post(server.url + path, trust_env=False, timeout=60)
    finally:
        server.stop()
    assert answer.status_code == 500 and answer.json()["error"]["code"] == "internal_error"
    assert "Content-Security-Policy" in answer.headers
    assert [(entry["path"], entry["status"]) for entry in entries] == [(path, 500)]


def test_a_guard_that_fails_before_it_knows_the_visitor_answers_with_the_headers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    access = Access()
    server = ConsoleServer(FakeOperations(), port=0, access=access)
    server.start()
    try:
        monkeypatch.delattr(type(access.authenticator), "authenticate")
        answer = httpx.post(server.url + "/api/v1/stop", trust_env=False, timeout=60)
    finally:
        server.stop()
    assert answer.status_code == 500 and answer.json()["error"]["code"] == "internal_error"
    assert "Content-Security-Policy" in answer.headers


STOPPED = {"who": "eve", "role": "viewer", "method": "WS", "path": "stop?by=console"}


def test_of_repeated_stops_one_a_second_is_logged_until_the_next_reset() -> None:
    entries, now = Entries(), 0.0
    auditor = Auditor(entries, clock=lambda: now)
    for moment in (0.0, 0.5 * REPEAT_PERIOD_S, REPEAT_PERIOD_S):
        now = moment
        for number in range(100):
            auditor.note_stop({**STOPPED, "path": f"stop?by={number}"})

    def ask_reset(status: int) -> None:
        async def sent(_: Message) -> None:
            pass

        scope = {"method": "POST", "path": RESET, "query_string": b""}
        visitor = Visitor(name="eve", role=Role.VIEWER, client_id="page eve")
        send = auditor.watching(sent, scope, visitor)
        asyncio.run(send({"type": "http.response.start", "status": status}))  # type: ignore[arg-type]
        auditor.note_stop(STOPPED)

    ask_reset(403)
    assert [entry["path"] for entry in entries] == ["stop?by=0"] * 2 + [RESET]
    ask_reset(200)
    auditor.note_stop({**STOPPED, "who": "bob"})
    asyncio.run(auditor.note(REFUSED))  # once it is stored, all before it are
    assert entries[4:-1] == [STOPPED, {**STOPPED, "who": "bob"}]


DRIVEN = {"who": "anna", "role": "operator", "method": "WS", "path": "by hand: begins"}


def test_of_repeated_beginnings_of_driving_by_hand_one_a_second_is_logged() -> None:
    entries, now = Entries(), 0.0
    auditor = Auditor(entries, clock=lambda: now)
    taken = [auditor.note_driving(DRIVEN, begins=True) is not None for _ in range(3)]
    now = REPEAT_PERIOD_S
    taken.append(auditor.note_driving(DRIVEN, begins=True) is not None)
    assert taken == [True, False, False, True]


def test_no_more_entries_wait_for_a_slow_disk_than_their_limit_and_stops_have_their_own() -> None:
    written, entries, now = threading.Event(), Entries(), 0.0

    class SlowLog(Entries):
        def add(self, entry: Mapping[str, Any]) -> int:
            assert written.wait(60)
            return entries.add(entry)

    auditor = Auditor(SlowLog(), clock=lambda: now)
    for _ in range(2 * MAX_WAITING):
        auditor.note_driving(DRIVEN, begins=False)
    for number in range(2 * MAX_WAITING):
        auditor.note_stop({**STOPPED, "who": str(number)})
    missed = {**STOPPED, "who": str(2 * MAX_WAITING - 1)}
    written.set()
    asyncio.run(auditor.note(REFUSED))
    assert entries[:-1] == [DRIVEN] * MAX_WAITING + [
        {**STOPPED, "who": str(number)} for number in range(MAX_WAITING)
    ]
    auditor.note_stop(missed)  # what found no place is no stop that this one repeats
    asyncio.run(auditor.note(REFUSED))
    assert entries[-2] == missed


def test_the_whole_answer_to_a_stop_waits_for_no_disk(accounts: Accounts) -> None:
    answered, written, in_time = threading.Event(), threading.Event(), list[bool]()

    class SlowLog(Entries):
        def add(self, entry: Mapping[str, Any]) -> int:
            in_time.append(answered.wait(20))
            written.set()
            return 1

    access = Access(authenticator=accounts.access.authenticator, audit_log=SlowLog())
    app = create_app(FakeOperations(), allowed_hosts=["console"], access=access)
    assert response_status(app, "POST", "/api/v1/stop", accounts.headers("viewer")) == 200
    answered.set()
    assert written.wait(60) and in_time == [True]


@pytest.mark.parametrize("letter", ["z", "ж", "🤖"])
def test_what_was_done_is_logged_whatever_the_name(letter: str, accounts: Accounts) -> None:
    name = letter * MAX_NAME
    app = create_app(FakeOperations(), allowed_hosts=["console"], access=accounts.access)
    path = f"/api/v1/zone-sets/{name}/use"
    response_status(app, "POST", path, accounts.headers("operator"))
    (entry,) = accounts.store.audit.newest()
    assert entry["path"] == quote(path)
    assert describe_entry(entry) == f"put the set of zones “{name}” in force"
