"""The emergency stop holds over a restart."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from app.console.stop_latch import StopLatch, read_latch
from app.runtime.control.operator_state import OperatorState
from navcore.errors import StorageFailed
from navcore.mission.beware_list import BewareList
from navcore.mission.mission import Mission
from tests.app.console.state import PlainHolder


@pytest.fixture
def holder() -> PlainHolder:
    return PlainHolder(OperatorState(mission=Mission(), beware=BewareList(classes=())))


def stopped_by(holder: PlainHolder, who: str | None) -> None:
    holder.change(lambda intent: dataclasses.replace(intent, stopped_by=who))


def test_a_stop_is_latched_until_it_is_reset_over_any_restart(
    holder: PlainHolder, tmp_path: Path
) -> None:
    file = tmp_path / "stopped"
    latch = StopLatch(file, holder)
    latch.keep()
    assert read_latch(file) is None
    stopped_by(holder, "Zoë at the door")
    latch.keep()
    assert read_latch(file) == "Zoë at the door"
    (tmp_path / ".stopped.bewarenav-draft-x7_kq0ab").touch()  # as a kill leaves it
    again = StopLatch(file, holder)  # the next session, in which it is reset
    assert list(tmp_path.iterdir()) == [file]
    again.keep()
    assert read_latch(file) == "Zoë at the door"
    stopped_by(holder, None)
    again.keep()
    assert read_latch(file) is None


def test_a_stop_that_cannot_be_stored_is_tried_again(
    holder: PlainHolder, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "data"
    latch = StopLatch(folder / "stopped", holder)
    stopped_by(holder, "key")
    latch.keep()
    latch.keep()
    assert caplog.text.count("cannot be stored") == 1
    assert latch.warning is not None and "No such file or directory" in latch.warning
    folder.mkdir()
    latch.keep()
    assert read_latch(folder / "stopped") == "key" and latch.warning is None


def test_what_may_lie_in_the_file_after_a_failure_is_removed_with_the_reset(
    holder: PlainHolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    latch = StopLatch(tmp_path / "stopped", holder)

    def written_but_not_synced(file: Path, data: bytes) -> None:
        file.write_bytes(data)
        raise StorageFailed("the folder cannot be synchronised")

    monkeypatch.setattr("app.console.stop_latch.write_whole", written_but_not_synced)
    stopped_by(holder, "key")
    latch.keep()
    stopped_by(holder, None)
    latch.keep()
    assert latch.warning is None and read_latch(tmp_path / "stopped") is None


def test_a_reset_that_cannot_be_stored_says_what_a_restart_does(
    holder: PlainHolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    latch = StopLatch(tmp_path / "stopped", holder)
    stopped_by(holder, "key")
    latch.keep()
    stopped_by(holder, None)
    with monkeypatch.context() as read_only:
        read_only.setattr(
            Path,
            "unlink",
            lambda *_, **__: (_ for _ in ()).throw(OSError(30, "Read-only file system")),
        )
        latch.keep()
    assert latch.warning is not None and "after a restart the robot stands again" in latch.warning
    stopped_by(holder, "key")  # what is stored holds
    latch.keep()
    assert latch.warning is None


def test_a_file_that_cannot_be_read_counts_as_a_stop(tmp_path: Path) -> None:
    (tmp_path / "stopped").write_bytes(b"\xff")
    assert read_latch(tmp_path / "stopped") == "an operator"
    (tmp_path / "stopped").write_bytes(b"")
    assert read_latch(tmp_path / "stopped") == "an operator"
