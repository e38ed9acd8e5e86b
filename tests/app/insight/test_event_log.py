"""The event log outlives the console, and no disk blocks its writers."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Collection, Sequence
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.insight.event_log import EventLog
from app.insight.labelling import LabellingFolder
from app.insight.service import LiveInsight
from app.runtime.control.robot_controller import RobotController
from app.runtime.record.recorder import Recorder
from app.storage import Store
from app.storage.database import Database
from app.storage.events import EventTable
from navcore.config.navigator import NavigatorConfig
from navcore.errors import StorageFailed
from navcore.geometry.transform import STANDSTILL
from navcore.mission.zone import Zone
from navcore.safety.gate import Cause, GateDecision, StopReason
from tests.navcore.scene import picture
from tests.reliability.fault_runs import standing_controller
from web.interface.insight import Entry, Kind

FENCE = Zone(id="z", name="fence", polygon=((2.0, 0.0), (3.0, 0.0), (3.0, 1.0)))


def filled(event_log: EventLog, *kinds: Kind) -> EventLog:
    for number, kind in enumerate(kinds):
        event_log.note(
            float(number), kind, f"{kind} {number}", (0.5, -1.25) if number % 2 else None
        )
    return event_log


def ids(
    event_log: EventLog, *kinds: Kind, since: int = 0, before: int | None = None, limit: int = 100
) -> list[int]:
    return [
        entry.id
        for entry in event_log.page(kinds=kinds, since=since, before=before, limit=limit).entries
    ]


def test_a_restart_goes_on_counting_and_tells_what_is_from_earlier(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = filled(EventLog(store.events), "mission", "seen")
    first.write()
    said = first.page(kinds=(), since=0, limit=9).entries
    store.close()
    store = Store(tmp_path)
    second = EventLog(store.events)
    assert second.page(kinds=(), since=0, limit=9).entries == said
    filled(second, "goal").write()
    page = second.page(kinds=(), since=0, limit=9)
    assert [(entry.id, entry.start) for entry in page.entries] == [(1, 1), (2, 1), (3, 2)]
    assert (page.oldest, page.newest, page.start) == (1, 3, 2)
    store.close()


class StoppedClock:
    """A clock that always shows zero."""

    def now_ns(self) -> int:
        return 0


def insight_of(
    store: Store, folder: Path, controller: RobotController | None = None
) -> LiveInsight:
    controller = controller or standing_controller()
    return LiveInsight(
        controller=controller,
        recorder=Recorder(controller=controller, store=store, referee=None, scenario="bench"),
        labelling=LabellingFolder(folder),
        config=NavigatorConfig(),
        clock=StoppedClock(),
        store=store.events,
    )


def test_what_the_console_has_said_by_its_end_is_said_by_the_next(tmp_path: Path) -> None:
    store = Store(tmp_path / "data")
    insight = insight_of(store, tmp_path)
    insight.start()
    insight.note_verdict(
        GateDecision(twist=STANDSTILL, reasons=(StopReason(cause=Cause.PAUSED, text="Paused."),))
    )
    while not insight.event_log.page(kinds=(), since=0, limit=1).entries:
        time.sleep(0.01)
    insight.stop()
    store.close()
    store = Store(tmp_path / "data")
    asked: tuple[Kind, ...] = ("stopped",)
    page = insight_of(store, tmp_path).event_log.page(kinds=asked, since=0, limit=9)
    assert [(entry.text, entry.start) for entry in page.entries] == [
        ("Paused.", 1)
    ] and page.start == 2
    store.close()


def test_an_edit_that_is_taken_back_at_once_is_told(tmp_path: Path) -> None:
    store, controller = Store(tmp_path / "data"), standing_controller()
    insight = insight_of(store, tmp_path, controller)
    insight.start()
    controller.change(lambda intent: dataclasses.replace(intent, zones=(FENCE,)))
    controller.change(lambda intent: dataclasses.replace(intent, zones=()))
    controller.change(lambda intent: dataclasses.replace(intent, stopped_by="test"))
    controller.change(lambda intent: dataclasses.replace(intent, stopped_by=None))
    insight.stop()
    said = insight.event_log.page(kinds=(), since=0, limit=9).entries
    assert [entry.text for entry in said] == [
        "Zone “fence” was drawn.",
        "Zone “fence” was deleted.",
        "Emergency stop by test; it holds until it is reset.",
    ]
    store.close()


@settings(max_examples=60, deadline=None)
@given(
    kinds=st.lists(st.sampled_from(["zone", "goal", "seen"]), max_size=30),
    writes=st.integers(1, 7),
    most=st.integers(8, 12),
    limit=st.integers(1, 9),
)
def test_paging_back_gives_every_entry_once_wherever_it_lies(
    tmp_path_factory: pytest.TempPathFactory, kinds: list[Kind], writes: int, most: int, limit: int
) -> None:
    database = Database(tmp_path_factory.mktemp("paging"))
    event_log = EventLog(EventTable(database), max_entries=most)
    for number, kind in enumerate(kinds):
        event_log.note(float(number), kind, "")
        if number % writes == 0:
            event_log.write()
    wanted = [number + 1 for number, kind in enumerate(kinds) if kind != "goal"]
    found: list[int] = []
    before: int | None = None
    while part := ids(event_log, "zone", "seen", before=before, limit=limit):
        assert len(part) <= limit
        found = part + found
        before = part[0]
    assert found == wanted
    database.close()


def test_the_oldest_on_disk_give_way(tmp_path: Path) -> None:
    database = Database(tmp_path)
    event_log = EventLog(EventTable(database, max_entries=10), max_entries=5)
    for _ in range(8):
        filled(event_log, "seen", "zone", "goal").write()
    assert ids(event_log) == list(range(15, 25))
    assert event_log.page(kinds=(), since=0, limit=1).oldest == 15
    database.close()


class Disk:
    """A store that refuses while it is full, and hangs while it is `stuck`."""

    def __init__(self) -> None:
        self.full, self.stuck = False, threading.Event()
        self.stuck.set()
        self.entries: list[Entry] = []

    def last(self) -> tuple[int, int]:
        return 7, 1

    def oldest(self) -> int:
        return 1

    def append(self, entries: Sequence[Entry]) -> None:
        self.stuck.wait(10.0)
        if self.full:
            raise StorageFailed("no space left")
        self.entries.extend(entries)

    def between(
        self, since: int, before: int, *, kinds: Collection[Kind], limit: int
    ) -> tuple[Entry, ...]:
        raise StorageFailed("it cannot be read")


def test_a_disk_that_refuses_loses_nothing_and_says_so_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    disk = Disk()
    event_log = filled(EventLog(disk), "seen", "zone")
    disk.full = True
    for _ in range(5):
        event_log.write()
    assert disk.entries == [] and len(caplog.records) == 1 and "no space left" in caplog.text
    filled(event_log, "goal")
    disk.full = False
    event_log.write()
    event_log.write()
    assert [entry.id for entry in disk.entries] == [8, 9, 10]


def test_what_is_in_memory_is_shown_though_the_disk_cannot_be_read() -> None:
    event_log = filled(EventLog(Disk()), "seen", "zone")
    assert ids(event_log) == [8, 9]
    with pytest.raises(StorageFailed):
        ids(event_log, before=8)


def test_a_disk_that_hangs_blocks_neither_notes_nor_pages() -> None:
    disk = Disk()
    event_log = filled(EventLog(disk), "seen")
    disk.stuck.clear()
    writer = threading.Thread(target=event_log.write, daemon=True)
    writer.start()
    noting = threading.Thread(target=lambda: filled(event_log, "zone", "goal"), daemon=True)
    noting.start()
    noting.join(5.0)
    assert not noting.is_alive() and writer.is_alive()
    assert ids(event_log, since=7) == [8, 9, 10]
    disk.stuck.set()
    writer.join(5.0)
    event_log.write()
    assert [entry.id for entry in disk.entries] == [8, 9, 10]


def driven(controller: RobotController, recorder: Recorder, *, from_s: float, to_s: float) -> None:
    """Ticks of a standing robot, one a second, as the recorder hears of them."""
    for second in range(int(from_s), int(to_s)):
        frame = picture(stamp_ns=(second + 1) * 1_000_000_000)
        decision = controller.tick_state.decision or controller.think(
            frame, clock=partial(int, frame.stamp_ns)
        )
        assert decision is not None
        recorder.note_decision(dataclasses.replace(decision, frame=frame))


def test_the_report_of_an_endless_run_is_bounded_and_kept_when_the_console_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.runtime.record.run_report.MAX_ROWS", 16)
    store, controller = Store(tmp_path), standing_controller()
    controller.change_mission(
        lambda mission: mission.cancel().add(3.0, 0.0, controller.navigator.map.spec).start()
    )
    recorder = Recorder(controller=controller, store=store, referee=None, scenario="bench")
    driven(controller, recorder, from_s=0, to_s=100)
    controller.change_mission(lambda mission: mission.add(2.0, 1.0, controller.navigator.map.spec))
    driven(controller, recorder, from_s=100, to_s=200)
    assert not store.runs()
    recorder.close()
    recorder.close()
    (run,) = store.runs()
    assert run["goals"] == [[3.0, 0.0], [2.0, 1.0]]
    series = store.run(run["id"])["series"]
    times = series["t_s"]
    assert (
        8 <= len(times) <= 16
        and times[-1] > 180.0
        and all(len(column) == len(times) for column in series.values())
    )
    store.close()
