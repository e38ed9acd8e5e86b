"""Benchmark of this machine: durations of the stages of a tick, and the real-time factor.

Absolute times belong to the machine they were taken on; compare only values of one run.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console as Terminal
from rich.table import Table

from app.bench.compare import comparison_table
from app.bench.console.chromium import NoBrowser
from app.bench.console.latency import latency_table
from app.bench.console.page import page_tables
from app.bench.console.soak import NotMeasured, soak_table
from app.bench.console.view_3d import console_table
from app.bench.parts import BenchPart
from app.bench.planning.queries import run_planning_bench
from app.bench.stages.correction import correction_table
from app.bench.stages.tick import SIZE, tick_table
from app.bench.stages.training import training_table
from app.episode.episode import Episode, EpisodeSettings
from app.runtime.control.stage_timer import STAGES, TICK
from app.runtime.start.segmentation import measure_segmenter
from app.runtime.start.segmenter_choice import Kind
from navcore.robot.camera_stream import CameraStream
from navcore.warmup import warm_up
from sim.scenario.beware import starting_beware_list
from sim.scenario.load import load_scenario

TICKS = 300
"""Number of measured ticks on the large map."""
DESCRIPTIONS = {
    "tick": "frame → twist, everything",
    "segment": "segmentation",
    "estimate_ground": "ground heights",
    "track": "people",
    "localise": "scan, pose in the map",
    "update_map": "points, map",
    "update_costmap": "layers, inflation",
    "plan": "path and waypoints, cached or planned",
    "replan": "of these, the plans made in full",
    "control": "local planner",
    "supervise": "behaviours",
}


def run_bench(
    parts: Sequence[BenchPart],
    scenario: str,
    seconds: float,
    *,
    maps: Path | None = None,
    ticks: Path | None = None,
    samples: Path | None = None,
    segmenter: Kind = "network",
    camera: CameraStream | None = None,
) -> None:
    """Measure the given parts one after the other and print a table of each.

    `seconds` is the simulated time of the drive, `maps` a folder of published maps to plan on,
    `ticks` the file that keeps the times of the part `latency`, `samples` that of the part `soak`,
    which segments with `segmenter`. `camera`: images of the parts `drive`, `tick` and
    `latency`, instead of 424 × 240 at 10 Hz, 640 × 480, and those that the console chooses.
    """
    terminal = Terminal()
    if BenchPart.DRIVE in parts:
        _drive(terminal, scenario, seconds, camera)
    if BenchPart.TICK in parts:
        terminal.print(tick_table(TICKS, SIZE if camera is None else camera.size))
    if BenchPart.CORRECTION in parts:
        terminal.print(correction_table())
    if BenchPart.SEGMENT in parts:
        terminal.print(_engines())
    if BenchPart.PLAN in parts:
        run_planning_bench(terminal, maps)
    if BenchPart.CONSOLE in parts:
        terminal.print(console_table())
    if BenchPart.TRAIN in parts:
        terminal.print(training_table())
    if BenchPart.PAGE in parts:
        try:
            for table in page_tables(scenario, seconds):
                terminal.print(table)
        except NoBrowser as missing:
            terminal.print(str(missing))
    if BenchPart.LATENCY in parts:
        terminal.print(latency_table(scenario, seconds, camera=camera, ticks=ticks))
    if BenchPart.SOAK in parts:
        try:
            terminal.print(soak_table(scenario, seconds, segmenter=segmenter, record=samples))
        except NotMeasured as failure:
            terminal.print(str(failure))


def print_comparison(revision: str, arguments: Sequence[str]) -> None:
    """Print the ratios of the figures of this benchmark in the present files and in a revision."""
    Terminal().print(comparison_table(revision, arguments))


def _engines() -> Table:
    title, trials = measure_segmenter()
    table = Table("engine", "p50 ms", "p99 ms", "pixels as torch f32", title=title)
    for trial in trials:
        if trial.failure is not None:
            table.add_row(trial.name, "–", "–", trial.failure)
        else:
            table.add_row(
                trial.name, f"{trial.p50_ms:.1f}", f"{trial.p99_ms:.1f}", f"{trial.agreement:.3%}"
            )
    return table


def _drive(terminal: Terminal, scenario: str, seconds: float, camera: CameraStream | None) -> None:
    """Drive the scenario's own mission for `seconds` of simulated time."""
    warm_up()
    start = time.perf_counter()
    world = load_scenario(scenario)
    episode = Episode(
        world,
        EpisodeSettings(beware=starting_beware_list(world), max_time_s=seconds, camera=camera),
        seed=0,
    )
    built_s = time.perf_counter() - start
    try:
        report = episode.run()
        table = Table(
            "stage",
            "what",
            "n",
            "p50 ms",
            "p99 ms",
            "max ms",
            title=f"{scenario}, camera {episode.simulator.profile.stream}, {platform.machine()}",
        )
        for stage in (TICK, *STAGES):
            durations = episode.timer.summary(stage)
            count = len(episode.timer.ms[stage])
            table.add_row(
                stage,
                DESCRIPTIONS[stage],
                str(count),
                *(f"{durations[key]:.2f}" for key in ("p50", "p99", "max")),
            )
    finally:
        episode.close()
    terminal.print(table)
    speed = report["sim_time_s"] / report["wall_time_s"]
    terminal.print(
        f"{speed:.2f} simulated seconds per second (physics, camera and navigation in one thread); "
        f"built in {built_s:.1f} s"
    )
