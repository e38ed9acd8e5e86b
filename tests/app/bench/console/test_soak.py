"""The soak test's figures: what a process holds, and what grows."""

from __future__ import annotations

import os
import socket
import sys
import threading

import httpx
import pytest

from app.bench.console.process_use import process_use
from app.bench.console.soak import NotMeasured, console_pids, growth_per_hour, set_off_again

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="reads /proc, which only Linux has"
)


def test_threads_files_sockets_and_memory_that_a_process_takes_are_counted() -> None:
    before, ended = process_use(os.getpid()), threading.Event()
    waiting = threading.Thread(target=ended.wait)
    waiting.start()
    with socket.socket():
        held = b"\1" * 50_000_000
        during = process_use(os.getpid())
    ended.set()
    waiting.join()
    assert during.threads == before.threads + 1
    assert during.files == before.files + 1
    assert during.sockets == before.sockets + 1
    assert during.pss_mb - before.pss_mb >= 0.9 * len(held) / 1e6
    assert during.pss_mb <= during.rss_mb


def test_growth_is_the_slope_of_the_samples_and_not_the_difference_of_two_of_them() -> None:
    times_s = [10.0 * number for number in range(61)]
    leaking = [500 + 36 * t_s / 3600 for t_s in times_s]
    assert growth_per_hour(times_s, leaking) == pytest.approx(36.0)
    steady = [500.0] * 60 + [506.0]
    assert growth_per_hour(times_s, steady) < 6 / (600 / 3600)
    assert growth_per_hour([10.0], [500.0]) == 0.0


def test_without_a_console_among_its_children_nothing_is_measured() -> None:
    with pytest.raises(NotMeasured, match="the console did not start"):
        console_pids(os.getpid())


def test_a_console_that_refuses_to_set_off_is_asked_again_later_and_does_not_end_the_test(
    caplog: pytest.LogCaptureFixture,
) -> None:
    goals = {3: (1.0, 2.0)}

    def console(request: httpx.Request) -> httpx.Response:
        path = request.url.path.removeprefix("/api/v1/")
        if path == "state":
            return httpx.Response(200, json={"phase": "idle"})
        if request.method == "DELETE":
            del goals[int(path.removeprefix("goals/"))]
            return httpx.Response(204)
        if path == "goals":
            return httpx.Response(200, json={"queue": [{"id": number} for number in goals]})
        refused = path == "mission/start"
        return httpx.Response(409 if refused else 200, json={"detail": "stopped by a person"})

    transport = httpx.MockTransport(console)
    with httpx.Client(transport=transport, base_url="http://console") as program:
        set_off_again(program, ((1.0, 2.0),))
    assert not goals
    assert "stopped by a person" in caplog.text
