"""A console has the files that it needs, and ends when it is told to: at once while it starts, in
order when it runs."""

from __future__ import annotations

import resource
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.console import application
from app.console.application import (
    MOST_FILES,
    ConsoleOptions,
    allow_many_connections,
    run_console,
)


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """The handlers of the signals, put back."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


def test_many_files_may_be_open_where_the_system_allows_it() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (1000, before[1]))
        allow_many_connections()
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        allowed = MOST_FILES if hard == resource.RLIM_INFINITY else hard
        assert hard == before[1] and soft == min(MOST_FILES, allowed)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.parametrize("told", [signal.SIGINT, signal.SIGTERM])
def test_a_start_is_given_up_and_what_it_has_opened_is_closed(
    told: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []

    @contextmanager
    def starting(*_: Any, **__: Any) -> Iterator[None]:
        try:
            signal.raise_signal(told)
            steps.append("went on")
            yield
        finally:
            steps.append("closed")

    monkeypatch.setattr(application, "console", starting)
    with pytest.raises(SystemExit) as ended:
        run_console(ConsoleOptions(scenario="empty_room", data=tmp_path))
    assert ended.value.code == 128 + told
    assert steps == ["closed"]


def test_a_running_console_ends_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    steps: list[str] = []

    @contextmanager
    def running(*_: Any, **__: Any) -> Iterator[SimpleNamespace]:
        signalled = threading.Timer(0.1, signal.raise_signal, (signal.SIGTERM,))
        signalled.start()
        yield SimpleNamespace(url="http://127.0.0.1", admin=None)
        signalled.join()
        signal.raise_signal(signal.SIGTERM)  # one more does not break off the end
        steps.append("ended in order")

    monkeypatch.setattr(application, "console", running)
    run_console(ConsoleOptions(scenario="empty_room", data=tmp_path))
    assert steps == ["ended in order"]
