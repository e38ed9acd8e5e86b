"""What a console that ends, or is killed, leaves to the next one."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any

import pytest

from app.console import application
from app.console.application import console
from app.console.site.sites import SESSION_PERIOD_S
from app.runtime.control.loop import ControlLoop
from app.runtime.record.map_keeper import MapKeeper
from navcore.errors import StorageFailed
from navcore.mapping.storage import map_file
from tests.system.test_sites import _when, client, options


@pytest.mark.long
def test_an_edit_of_the_map_after_the_last_tick_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, stop, finish = list[str](), ControlLoop.stop, MapKeeper.finish

    def stop_and_edit(loop: ControlLoop) -> None:
        stop(loop)
        loop._controller.edit_map(lambda _: steps.append("edited"))

    def kept(*given: Any) -> None:
        finish(*given)
        steps.append("kept")

    monkeypatch.setattr(ControlLoop, "stop", stop_and_edit)
    monkeypatch.setattr(MapKeeper, "finish", kept)
    with console(options(tmp_path / "data")):
        pass
    assert set(steps[:-1]) == {"edited"} and steps[-1] == "kept"


def test_a_map_that_cannot_be_written_is_told_until_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise StorageFailed("No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr(map_file, "save", full)
        with console(options(tmp_path / "data")) as running, client(running.url) as program:
            told = _when(program, lambda state: state["storage_warning"] is not None)
            assert "the map cannot be stored" in told["storage_warning"]
            assert "No space left" in told["storage_warning"]
            disk.undo()
            _when(program, lambda state: state["storage_warning"] is None)


def test_a_stop_holds_over_a_restart_and_the_run_that_it_interrupts_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(application, "RUN_PERIOD_S", 0.2)
    data, killed = tmp_path / "data", tmp_path / "killed"
    with console(options(data)) as running, client(running.url) as program:
        program.post("goals", json={"x_m": 2.0, "y_m": 2.0}).raise_for_status()
        program.post("mission/start").raise_for_status()
        _when(program, lambda state: state["moving"])
        program.post("stop", params={"by": "the test"}).raise_for_status()
        _when(program, lambda _: (data / "stopped").exists() and program.get("runs").json() != [])
        time.sleep(3 * SESSION_PERIOD_S)  # within which the phase of the mission is stored
        shutil.copytree(data, killed)  # as a kill would leave it
    for left in (data, killed):
        with console(options(left)) as running, client(running.url) as program:
            state = _when(program, lambda state: state["explored_m2"] > 0)
            assert state["stop_latched"] and state["phase"] == "paused"
            refused = program.post("mission/resume")
            assert refused.status_code == 409 and "the test is latched" in refused.text
            (run,) = program.get("runs").json()
            assert run["goals"] == [[2.0, 2.0]] and run["goals_reached"] == 0
            program.post("stop/reset").raise_for_status()
            _when(program, lambda state: not state["stop_latched"])
    assert not (data / "stopped").exists()
