"""The lock of a data folder."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from app.storage import folder_lock
from app.storage.folder_lock import lock_folder


def test_a_lock_that_is_held_for_a_moment_is_waited_for(tmp_path: Path) -> None:
    """As by a command that converts the folder of an earlier version."""
    first = lock_folder(tmp_path)
    timer = threading.Timer(0.3, first.close)
    timer.start()
    lock_folder(tmp_path).close()
    timer.join()


def test_one_that_stays_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_lock, "WAITS_S", 0.2)
    with lock_folder(tmp_path), pytest.raises(BlockingIOError):
        lock_folder(tmp_path)
