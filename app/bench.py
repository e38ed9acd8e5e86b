"""Figures of this machine: how long each stage of a tick takes, and how much faster than real time the whole loop runs.

Absolute times belong to the machine they were taken on; compare only figures of one run.
"""

from __future__ import annotations

import platform
import time

from rich.console import Console as Terminal
from rich.table import Table

from app.episode import Episode
from app.timing import STAGES
from navcore.beware import default_beware_list
from navcore.warmup import warm_up
from sim.scenario import load_scenario

WHAT = {
    "tick": "frame → twist, everything",
    "label": "segmentation",
    "remember": "points, map",
    "occupancy": "layers, inflation",
    "route": "path and waypoints, cached or planned",
    "plan": "… of these, the plans made in full",
    "move": "local planner",
}


def run_bench(scenario: str, seconds: float) -> None:
    """Drive the scenario's own mission for some simulated seconds and print a table."""
    warm_up()
    start = time.perf_counter()
    episode = Episode(load_scenario(scenario), seed=0, beware=default_beware_list(), max_time_s=seconds)
    built_s = time.perf_counter() - start
    try:
        report = episode.run()
        table = Table("stage", "what", "n", "p50 ms", "p99 ms", "max ms", title=f"{scenario}, {platform.machine()}")
        for stage in STAGES:
            figures = episode.stopwatch.summary(stage)
            count = len(episode.stopwatch.ms[stage])
            table.add_row(stage, WHAT[stage], str(count), *(f"{figures[key]:.2f}" for key in ("p50", "p99", "max")))
    finally:
        episode.close()
    terminal = Terminal()
    terminal.print(table)
    speed = report["sim_time_s"] / report["wall_time_s"]
    terminal.print(
        f"{speed:.2f} simulated seconds per second (physics, camera and navigation in one thread); built in {built_s:.1f} s"
    )
