"""What the bench of a console's ticks says where there is nothing to measure."""

from __future__ import annotations

from types import SimpleNamespace

import httpx
import pytest

from app.bench.console.latency import watch_drive
from navcore.errors import BewareNavError

IDLE = {"phase": "idle", "reasons": [{"code": "no_goal", "text": "There is no goal."}]}


def test_only_the_time_in_which_the_robot_drives_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now_s
        now_s += seconds

    def state(_: httpx.Request) -> httpx.Response:
        seen = {"phase": "driving" if now_s < 2.0 else "paused", "picture_serial": int(10 * now_s)}
        ages = {"frame_age_s": 0.1, "map_age_s": 0.2}
        return httpx.Response(200, json={**IDLE, **seen, **ages, "tick_ms": 50.0})

    clock = SimpleNamespace(monotonic=lambda: now_s, sleep=sleep)
    monkeypatch.setattr("app.bench.console.latency.time", clock)
    with httpx.Client(transport=httpx.MockTransport(state), base_url="http://console") as program:
        watch = watch_drive(program, seconds=4.0)
    assert watch.driving_s == pytest.approx(2.0, abs=0.05)
    assert len(watch.ticks_ms) == 20
    assert set(watch.ages_s) == {0.1} and set(watch.map_ages_s) == {0.2}


def test_a_robot_that_never_drives_is_told_with_its_reasons() -> None:
    console = httpx.MockTransport(lambda _: httpx.Response(200, json=IDLE))
    with (
        httpx.Client(transport=console, base_url="http://console") as program,
        pytest.raises(BewareNavError, match=r"the mission is idle\. There is no goal\."),
    ):
        watch_drive(program, seconds=0.05)
