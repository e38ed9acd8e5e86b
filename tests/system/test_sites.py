"""Sites of the whole console: changed while it runs, kept over a restart and a kill."""

from __future__ import annotations

import io
import os
import socket
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from app.console.application import ConsoleOptions, console
from navcore.config.mapping import MappingConfig
from navcore.errors import BadConfiguration
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage import map_file
from tests.system.conftest import BY_COLOUR, state_when
from tests.system.test_http import square

PROMISED_S = 10.0
"""The most of a map that a kill may lose, seconds."""
START_S = 240.0


def options(data: Path, **more: Any) -> ConsoleOptions:
    return ConsoleOptions(scenario="empty_room", port=0, data=data, choice=BY_COLOUR, **more)


def client(url: str) -> httpx.Client:
    return httpx.Client(base_url=f"{url}/api/v1/", trust_env=False, timeout=60.0)


def zone_names(program: httpx.Client) -> list[str]:
    features = program.get("zones").json()["features"]
    return [feature["properties"]["name"] for feature in features]


def choose(program: httpx.Client, site: str) -> None:
    """Choose a site as soon as the wheels have come to rest, which the state tells a tick late."""
    for _ in range(100):
        answer = program.post(f"sites/{site}/choose")
        if "the robot moves" not in answer.text:
            break
        time.sleep(0.05)
    assert answer.is_success, answer.text


def test_another_site_has_its_own_map_zones_goals_and_list_and_the_first_comes_back(
    tmp_path: Path,
) -> None:
    with console(options(tmp_path)) as running, client(running.url) as program:
        assert program.get("state").json()["site"] == "default"
        program.post("zones", json=square(2.0, -3.0)).raise_for_status()
        for goal in ({"x_m": -2.5, "y_m": 2.0}, {"x_m": 2.0, "y_m": 2.0}):
            program.post("goals", json=goal).raise_for_status()
        standing = _when(program, lambda state: state["explored_m2"] > 0)
        program.post("mission/start").raise_for_status()
        # Far enough round that what it saw at first is out of view where it stops.
        _when(program, lambda state: state["pose"]["yaw_rad"] > standing["pose"]["yaw_rad"] + 0.8)
        program.post("sites", json={"name": "hall"}).raise_for_status()
        refused = program.post("sites/hall/choose")
        assert refused.status_code == 409 and "pause or cancel" in refused.text
        assert zone_names(program) == ["wet floor"]
        program.post("mission/pause").raise_for_status()
        before = program.get("state").json()
        program.patch("beware/cup", json={"margin_m": 0.4}).raise_for_status()
        version = program.get("beware").json()["version"]

        choose(program, "hall")
        at_hall = _when(program, lambda state: state["explored_m2"] < before["explored_m2"])
        assert (at_hall["site"], at_hall["queue"], at_hall["phase"]) == ("hall", [], "idle")
        assert at_hall["zones_version"] != before["zones_version"]
        assert zone_names(program) == []
        beware = program.get("beware").json()
        assert beware["version"] > version
        assert {e["name"]: e["margin_m"] for e in beware["classes"]}["cup"] != 0.4

        program.post("sites/default/choose").raise_for_status()
        back = _when(program, lambda state: state["explored_m2"] >= before["explored_m2"] - 0.5)
        assert zone_names(program) == ["wet floor"] and back["phase"] == "paused"
        assert len(back["queue"]) == 2 and "from before" in back["summary"]
        classes = program.get("beware").json()["classes"]
        assert {entry["name"]: entry["margin_m"] for entry in classes}["cup"] == 0.4
        # Its odometry has gone on meanwhile: it knows its place though it stands in mid-turn.
        _when(program, lambda state: state["place"]["state"] in ("located", "dead reckoning"))
        assert program.post("mission/resume").is_success


@pytest.mark.long
def test_a_site_survives_export_import_and_a_restart_and_its_nav2_map_has_no_zones(
    tmp_path: Path,
) -> None:
    with console(options(tmp_path, site="Ward 3")) as running, client(running.url) as program:
        program.post("zones", json=square(1.0, 1.5)).raise_for_status()
        program.post("goals", json={"x_m": -2.5, "y_m": 2.0}).raise_for_status()
        program.put("missions/round").raise_for_status()
        program.put("zone-sets/night").raise_for_status()
        seen = _when(program, lambda state: state["explored_m2"] > 1)["explored_m2"]
        archive = program.get("sites/Ward 3/export").content
        program.post("sites/import?name=Ward 4", content=archive).raise_for_status()
        nav2 = zipfile.ZipFile(io.BytesIO(program.get("sites/Ward 3/nav2").content))
        assert sorted(nav2.namelist()) == [
            "keepout_mask.pgm",
            "keepout_mask.yaml",
            "map.pgm",
            "map.yaml",
        ]
        plain, mask = (nav2.read(f"{name}.pgm")[-180 * 180 :] for name in ("map", "keepout_mask"))
        closed = np.frombuffer(mask, np.uint8) == 0
        assert closed.any() and not (np.frombuffer(plain, np.uint8)[closed] == 0).any()
    with console(options(tmp_path, site="ward 4")) as running, client(running.url) as program:
        state = _when(program, lambda state: state["explored_m2"] >= seen - 0.5)
        assert state["site"] == "Ward 4" and zone_names(program) == ["wet floor"]
        assert [one["name"] for one in program.get("missions").json()] == ["round"]
        assert [one["name"] for one in program.get("zone-sets").json()] == ["night"]
    with console(options(tmp_path)) as running, client(running.url) as program:
        # Without a name the site of the last session is used again.
        assert program.get("state").json()["site"] == "Ward 4"


def test_changes_of_the_running_map_are_accepted(tmp_path: Path) -> None:
    with console(options(tmp_path)) as running, client(running.url) as program:
        _when(program, lambda state: state["explored_m2"] > 1)
        assert program.get("map/changes").json()["accepted"] is False
        accepted = program.post("map/changes/accept", json={}).json()
        assert accepted["accepted"] is True
        (site,) = program.get("sites").json()["sites"]
        assert site["accepted"] and site["world"] == "empty_room"


@pytest.mark.long
def test_a_site_of_another_world_is_not_used_by_itself_and_refused_by_name(
    tmp_path: Path,
) -> None:
    with console(options(tmp_path)) as running, client(running.url) as program:
        _when(program, lambda state: state["explored_m2"] > 1)
    other = ConsoleOptions(scenario="indoor", port=0, data=tmp_path, choice=BY_COLOUR)
    with console(other) as running, client(running.url) as program:
        assert program.get("state").json()["site"] == "indoor"
    wrong = ConsoleOptions(
        scenario="indoor", port=0, data=tmp_path, choice=BY_COLOUR, site="default"
    )
    with pytest.raises(BadConfiguration, match=r"'default'.*--site"), console(wrong):
        pass


@contextmanager
def console_process(data: Path) -> Iterator[tuple[subprocess.Popen[bytes], httpx.Client]]:
    """A console as a user starts it, in a process of its own, which is killed at the end."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "app", "console", "--scenario", "empty_room"]
    command += ["--data", str(data), "--port", str(port), "--segmenter", "colour"]
    process = subprocess.Popen(command, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    try:
        with client(f"http://127.0.0.1:{port}") as program:
            deadline = time.monotonic() + START_S
            while True:
                try:
                    program.get("state").raise_for_status()
                    break
                except httpx.HTTPError:
                    assert process.poll() is None and time.monotonic() < deadline
                    time.sleep(0.2)
            yield process, program
    finally:
        process.kill()
        process.wait()


@pytest.mark.long
def test_after_a_kill_the_map_lacks_ten_seconds_at_most_and_goals_come_back_paused(
    tmp_path: Path,
) -> None:
    seen: list[tuple[float, float]] = []
    queues: list[tuple[float, list[float]]] = []
    with console_process(tmp_path) as (process, program):
        for goal in ({"x_m": -2.5, "y_m": 2.0}, {"x_m": 2.0, "y_m": 2.5}, {"x_m": 2.5, "y_m": -2}):
            program.post("goals", json=goal).raise_for_status()
        program.put("mission/loop", json={"loop": True}).raise_for_status()
        program.post("mission/start").raise_for_status()

        def long_enough(state: dict[str, Any]) -> bool:
            seen.append((state["stamp_s"], state["explored_m2"]))
            queues.append((state["stamp_s"], [goal["x_m"] for goal in state["queue"]]))
            return bool(state["stamp_s"] - seen[0][0] > 1.5 * PROMISED_S)

        last = _when(program, long_enough, patience_s=300.0)
        process.kill()
    promised_m2 = max(
        (area for stamp_s, area in seen if stamp_s <= last["stamp_s"] - PROMISED_S), default=0.0
    )
    (kept_map,) = tmp_path.glob("sites/*/map.npz")
    stored = map_file.load(kept_map).state
    kept = PointMap(stored.spec, MappingConfig())
    assert kept.explored.area_m2 < promised_m2  # control: an empty map is not enough
    kept.restore(stored)
    assert kept.explored.area_m2 >= promised_m2
    with console_process(tmp_path) as (_, program):
        state = program.get("state").json()
        assert state["phase"] == "paused" and not state["moving"] and state["loop"]
        # The robot may have reached a goal since the queue was written, which moved it to the end.
        lately = [queue for stamp_s, queue in queues if stamp_s > last["stamp_s"] - PROMISED_S]
        assert [goal["x_m"] for goal in state["queue"]] in lately
        told = _when(program, lambda state: state["reasons"])
        assert "from before" in told["reasons"][-1]["text"]
        assert _when(program, lambda state: state["explored_m2"] >= promised_m2)


def _when(program: httpx.Client, holds: Any, patience_s: float = 120.0) -> dict[str, Any]:
    """Return the first state for which a condition holds."""
    with httpx.Client(
        base_url=str(program.base_url).removesuffix("/api/v1/"), trust_env=False, timeout=60.0
    ) as outer:
        return state_when(outer, holds, patience_s)
