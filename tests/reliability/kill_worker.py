"""Worker of row 14: saves one zone after the other and reports which are acknowledged, until it is
killed.

It is a process of its own that forks its savers, so that a thousand kills do not cost a thousand
starts of Python. `python -m tests.reliability.kill_worker FOLDER KILLS SEED store|file` prints the
number of acknowledged saves and of lost ones.
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
    """Kill `kills` savers at random moments; each continues in the folder of the one before."""
    save, ids = {"store": (_save_in_store, _ids_in_store), "file": (_save_in_file, _ids_in_file)}[
        kind
    ]
    rng, acknowledged = random.Random(seed), set[str]()
    folder.mkdir(parents=True, exist_ok=True)
    for kill in range(kills):
        work = functools.partial(save, folder, kill)
        acknowledged |= _save_until_killed(work, rng.uniform(0.002, LONGEST_S))
    lost = len(acknowledged - ids(folder))
    print(json.dumps({"acknowledged": len(acknowledged), "lost": lost}))


def _save_until_killed(work: Callable[[Callable[[str], None]], None], after_s: float) -> set[str]:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        try:
            work(lambda zone_id: _report(writing, zone_id))
        finally:
            os._exit(1)
    os.close(writing)
    with os.fdopen(reading, "rb") as output:
        first = output.readline()
        time.sleep(after_s)
        os.kill(child, signal.SIGKILL)
        rest = output.read()
    os.waitpid(child, 0)
    # # A truncated line was not reported.
    return {line.decode() for line in (first + rest).split(b"\n")[:-1]}


def _report(pipe: int, zone_id: str) -> None:
    os.write(pipe, f"{zone_id}\n".encode())


def _save_in_store(folder: Path, kill: int, report: Callable[[str], None]) -> None:
    store = Store(folder)
    for number in range(1_000_000):
        zone_id = f"{kill}-{number}"
        store.site.save_zone(Zone(id=zone_id, name="n", polygon=CORNERS))
        report(zone_id)


def _ids_in_store(folder: Path) -> set[str]:
    store = Store(folder)
    try:
        return {zone.id for zone in store.site.zones()}
    finally:
        store.close()


def _save_in_file(folder: Path, kill: int, report: Callable[[str], None]) -> None:
    """Save as the control of the row does: one JSON file, rewritten each time."""
    path = folder / "zones.json"
    zones = sorted(_ids_in_file(folder))
    for number in range(1_000_000):
        zones.append(f"{kill}-{number}")
        with path.open("w") as file:
            json.dump([{"id": zone_id, "corners": CORNERS * 20} for zone_id in zones], file)
        report(zones[-1])


def _ids_in_file(folder: Path) -> set[str]:
    try:
        return {zone["id"] for zone in json.loads((folder / "zones.json").read_text())}
    except (OSError, ValueError):
        return set()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
