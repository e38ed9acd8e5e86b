"""Row 14's worker: saves one zone after the other and says which are acknowledged, until it is
killed.

A process of its own that forks its savers, so that a thousand kills do not cost a thousand starts
of Python. `python -m tests.reliability.kill_worker FOLDER KILLS SEED store|file` prints how many were acknowledged
and how many of those were lost.
"""

from __future__ import annotations

import functools
import json
import os
import random
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

from app.storage import Store
from navcore.mission.zone import Zone

CORNERS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
LONGEST_S = 0.03


def main(folder: Path, kills: int, seed: int, kind: str) -> None:
    """Kill `kills` savers at random moments; each goes on in the folder of the one before."""
    save, ids = {"store": (_in_the_store, _stored), "file": (_in_a_file, _filed)}[kind]
    chance, acknowledged = random.Random(seed), set[str]()
    folder.mkdir(parents=True, exist_ok=True)
    for kill in range(kills):
        work = functools.partial(save, folder, kill)
        acknowledged |= _saved_until_killed(work, chance.uniform(0.002, LONGEST_S))
    lost = len(acknowledged - ids(folder))
    print(json.dumps({"acknowledged": len(acknowledged), "lost": lost}))


def _saved_until_killed(work: Callable[[Callable[[str], None]], None], after_s: float) -> set[str]:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        try:
            work(lambda zone_id: _say(writing, zone_id))
        finally:
            os._exit(1)
    os.close(writing)
    with os.fdopen(reading, "rb") as said:
        first = said.readline()
        time.sleep(after_s)
        os.kill(child, signal.SIGKILL)
        rest = said.read()
    os.waitpid(child, 0)
    # What is cut off in the middle of a line was not said.
    return {line.decode() for line in (first + rest).split(b"\n")[:-1]}


def _say(pipe: int, zone_id: str) -> None:
    os.write(pipe, f"{zone_id}\n".encode())


def _in_the_store(folder: Path, kill: int, say: Callable[[str], None]) -> None:
    store = Store(folder)
    for number in range(1_000_000):
        zone_id = f"{kill}-{number}"
        store.save_zone(Zone(id=zone_id, name="n", polygon=CORNERS))
        say(zone_id)


def _stored(folder: Path) -> set[str]:
    store = Store(folder)
    try:
        return {zone.id for zone in store.zones()}
    finally:
        store.close()


def _in_a_file(folder: Path, kill: int, say: Callable[[str], None]) -> None:
    """What many consoles do, and the control of the row: one JSON file, written anew each time."""
    path = folder / "zones.json"
    zones = sorted(_filed(folder))
    for number in range(1_000_000):
        zones.append(f"{kill}-{number}")
        with path.open("w") as file:
            json.dump([{"id": zone_id, "corners": CORNERS * 20} for zone_id in zones], file)
        say(zones[-1])


def _filed(folder: Path) -> set[str]:
    try:
        return {zone["id"] for zone in json.loads((folder / "zones.json").read_text())}
    except (OSError, ValueError):
        return set()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
