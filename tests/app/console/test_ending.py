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
    console,
    run_console,
)
from app.runtime.control.loop import ControlLoop
from app.runtime.record.map_keeper import MapKeeper
from app.runtime.record.recorder import Recorder
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.storage import Store
from app.teaching.networks.live_networks import LiveNetworks
from web.server import ConsoleServer


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


def test_what_is_stored_at_the_end_waits_for_no_network_and_the_robot_stands_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []

    def watched(owner: type, name: str) -> None:
        end = getattr(owner, name)

        def noted(self: Any, *args: Any) -> None:
            steps.append(owner.__name__)
            end(self, *args)

        monkeypatch.setattr(owner, name, noted)

    watched(ControlLoop, "stop")
    watched(ConsoleServer, "stop")
    watched(Recorder, "close")
    watched(MapKeeper, "finish")
    watched(LiveNetworks, "close")
    with console(options_of(tmp_path)):
        pass
    assert steps == ["ControlLoop", "ConsoleServer", "Recorder", "MapKeeper", "LiveNetworks"]


def test_a_start_that_fails_leaves_no_account_whose_password_was_never_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(server: ConsoleServer) -> None:
        raise SystemExit(128 + signal.SIGTERM)

    monkeypatch.setattr(ConsoleServer, "start", fail)
    with pytest.raises(SystemExit), console(options_of(tmp_path)):
        pass
    store = Store(tmp_path)
    assert store.users.all() == ()
    store.close()


def options_of(data: Path) -> ConsoleOptions:
    """Return the options of a console that starts quickly and asks for a login."""
    choice = SegmenterChoice(kind="colour")
    return ConsoleOptions(scenario="empty_room", data=data, port=0, login=True, choice=choice)
