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


@pytest.mark.parametrize(
    "entry",
    [
        {"who": "eve", "role": "viewer", "method": "POST", "path": "/api/v1/goals", "status": 403},
        {
            "who": "eve",
            "role": "viewer",
            "method": "POST",
            "path": "/api/v1/explain",
            "status": 200,
        },
        {"who": "eve", "role": "operator", "method": "POST", "path": "/x", "status": 404},
        {"who": "unknown", "method": "POST", "path": "/login", "status": 401},
    ],
)
def test_so_many_are_logged_within_an_hour_and_the_last_says_so(entry: dict[str, Any]) -> None:
    entries, now = Entries(), 0.0
    auditor = Auditor(entries, clock=lambda: now)
    for _ in range(3 * MOST_REFUSED):
        auditor.note_later(entry).result()
    assert len(entries) == MOST_REFUSED
    assert "the last of" in entries[-1]["detail"] and "detail" not in entries[-2]
    done = {"who": entry["who"], "role": "operator", "method": "POST", "path": "/x", "status": 200}
    other = {**entry, "who": "bob"}
    stop = {**done, "role": "viewer", "path": "/api/v1/stop"}
    by_socket = {"who": entry["who"], "role": "viewer", "method": "WS", "path": "stop?by=console"}
    for one in (done, other, stop, by_socket):
        auditor.note_later(one).result()
    assert entries[-4:] == [done, other, stop, by_socket]
    now = PERIOD_S
    auditor.note_later(entry).result()
    assert entries[-1] == entry
