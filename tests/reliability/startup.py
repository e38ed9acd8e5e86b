"""Rows 18 and 19: an impossible start is refused at once, with its cause."""

from __future__ import annotations

import copy
import socket
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from navcore.errors import BadConfiguration
from navcore.mission.beware_list import as_toml, default_beware_list, load_beware_list
from navcore.robot.profile import ROBOTS, load_profile
from sim.scenario.load import load_scenario
from tests.reliability.result import Measurement

Table = dict[str, Any]
LONGEST_S = 2.0
BAD_VALUES: tuple[object, ...] = ("nonsense", -1e12, {"nonsense": 1})


def busy_ports(trials: int) -> Measurement:
    """Row 18: duration and output of a start on a port that is taken; the first start, which fills
    caches, is not counted."""
    said, slowest_s = 0, 0.0
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = str(busy.getsockname()[1])
        for number in range(trials + 1):
            began_s = time.monotonic()
            command = [sys.executable, "-m", "app", "console", "--port", port]
            ended = subprocess.run(command, capture_output=True, text=True, check=False)
            if number:
                slowest_s = max(slowest_s, time.monotonic() - began_s)
                said += ended.returncode == 2 and port in ended.stderr and "--port" in ended.stderr
    return Measurement(
        trials=trials,
        measured=f"ended with code 2, port and remedy in {said}; at most {slowest_s:.1f} s",
        met=said == trials and slowest_s <= LONGEST_S,
    )


def bad_values(trials: int) -> Measurement:
    """Row 19: every key of the shipped world, robot and beware list gets a value of another type,
    one out of range, or an unknown neighbour. `trials` is the least number of such files; there are
    as many as there are keys."""
    count, accepted = 0, []
    with tempfile.TemporaryDirectory() as folder:
        for name, text, load in _files():
            load(_write(folder, text))
            for key, invalid in _invalid_variants(tomllib.loads(text)):
                count += 1
                try:
                    load(_write(folder, _toml(invalid)))
                    accepted.append(f"{name}: {key}")
                except BadConfiguration as refusal:
                    if key.split(".")[-1] not in str(refusal):
                        accepted.append(f"{name}: {key} is not named in: {refusal}")
    return Measurement(
        trials=count,
        measured=f"refused by name: {count - len(accepted)} of {count}"
        + (f"; not {accepted[0]}" if accepted else ""),
        met=not accepted and count >= trials,
    )


def _files() -> Iterator[tuple[str, str, Callable[[Path], object]]]:
    yield "robot", (ROBOTS / "husky.toml").read_text(), load_profile
    yield "beware list", as_toml(default_beware_list()), load_beware_list
    worlds = Path(sys.modules[load_scenario.__module__].__file__ or "").parent / "worlds"
    yield "world", (worlds / "office.toml").read_text(), load_scenario


def _invalid_variants(document: Table) -> Iterator[tuple[str, Table]]:
    """Yield (key, document) with one error in each."""
    for path in _paths(document):
        for bad in BAD_VALUES:
            if isinstance(_at(document, path), str) and isinstance(bad, str):
                continue
            changed = copy.deepcopy(document)
            _at(changed, path[:-1])[path[-1]] = bad
            yield ".".join(str(part) for part in path if isinstance(part, str)), changed
    changed = copy.deepcopy(document)
    changed["no_such_key"] = 1
    yield "no_such_key", changed


def _paths(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield the path of every key of every table; of an array of tables only of the first."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield (*path, key)
            yield from _paths(inner, (*path, key))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        yield from _paths(value[0], (*path, 0))


def _at(value: Any, path: tuple[str | int, ...]) -> Any:
    for part in path:
        value = value[part]
    return value


def _write(folder: str, text: str) -> Path:
    path = Path(folder) / "file.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _toml(table: Table) -> str:
    """Return TOML with every table written inline."""
    return "".join(f"{key} = {_value(value)}\n" for key, value in table.items())


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return (
        '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        if isinstance(value, str)
        else repr(value)
    )
