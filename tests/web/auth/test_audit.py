"""Requests that are refused push none that were done out of the audit log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from web.auth.audit import MOST_REFUSED, PERIOD_S, Auditor


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
        auditor.note_later(entry).result()
    assert len(entries) == MOST_REFUSED
    assert "the last of" in entries[-1]["note"] and "note" not in entries[-2]
    others = [
        {**entry, "path": "/x", "status": 200},
        {**entry, "who": "bob"},
        {**entry, "path": "/api/v1/me/password", "status": 200},
        {**entry, "path": "/api/v1/stop?by=page", "status": 200},
        {**entry, "path": "/api/v1/stop?by=page", "status": 500},
        {"who": entry["who"], "role": "viewer", "method": "WS", "path": "stop?by=console"},
        {"who": entry["who"], "method": "POST", "path": "/login", "status": 401, "from": "::1"},
    ]
    for other in others:
        auditor.note_later(other).result()
    assert entries[-len(others) :] == others
    now = PERIOD_S
    auditor.note_later(entry).result()
    assert entries[-1] == entry
