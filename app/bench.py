"""Figures of this machine: how long each stage of a tick takes, and how much faster than real time the whole loop runs.

Absolute times belong to the machine they were taken on; compare only figures of one run.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Sequence

from rich.console import Console as Terminal
from rich.table import Table

from app.arguments import BenchPart
from app.bench_console import console_table
from app.bench_page import NoBrowser, page_table
from app.bench_planning import run_planning_bench
from app.bench_tick import tick_table
from app.episode import Episode
from app.segmenter import measure_segmenter
from app.timing import STAGES
from navcore.beware import default_beware_list
from navcore.warmup import warm_up
from sim.scenario import load_scenario

TICKS = 300
WHAT = {
    "tick": "frame → twist, everything",
    "label": "segmentation",
    "remember": "points, map",
    "occupancy": "layers, inflation",
    "route": "path and waypoints, cached or planned",
    "plan": "… of these, the plans made in full",
    "move": "local planner",
}


def run_bench(parts: Sequence[BenchPart], scenario: str, seconds: float) -> None:
    """Measure these parts, one after the other, and print a table of each."""
    terminal = Terminal()
    if BenchPart.DRIVE in parts:
        _drive(terminal, scenario, seconds)
    if BenchPart.TICK in parts:
        terminal.print(tick_table(TICKS))
    if BenchPart.SEGMENT in parts:
        terminal.print(_engines())
    if BenchPart.PLAN in parts:
        run_planning_bench(terminal)
    if BenchPart.CONSOLE in parts:
        terminal.print(console_table())
    if BenchPart.PAGE in parts:
        try:
            terminal.print(page_table(scenario, seconds))
        except NoBrowser as missing:
            terminal.print(str(missing))


def _engines() -> Table:
    what, trials = measure_segmenter()
    table = Table("engine", "p50 ms", "p99 ms", "pixels as torch f32", title=what)
    for trial in trials:
        if trial.failure is not None:
            table.add_row(trial.name, "–", "–", trial.failure)
        else:
            table.add_row(trial.name, f"{trial.p50_ms:.1f}", f"{trial.p99_ms:.1f}", f"{trial.agreement:.3%}")
    return table


def _drive(terminal: Terminal, scenario: str, seconds: float) -> None:
    """Drive the scenario's own mission for some simulated seconds."""
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
    terminal.print(table)
    speed = report["sim_time_s"] / report["wall_time_s"]
    terminal.print(
        f"{speed:.2f} simulated seconds per second (physics, camera and navigation in one thread); built in {built_s:.1f} s"
    )
