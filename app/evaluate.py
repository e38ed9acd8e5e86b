"""Many seeded episodes, over several workers, resumable: what is in `episodes.jsonl` is not driven again."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import statistics
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from rich.console import Console as Terminal
from rich.table import Table

from app.episode import Episode
from app.segmenter import Perception, colour_perception, compose
from app.segmenter_choice import SegmenterChoice
from navcore.beware import BewareList
from navcore.config import NavigatorConfig
from navcore.errors import BadConfiguration
from sim.scenario import load_scenario


def evaluate_scenario(
    scenario: str,
    *,
    seeds: Iterable[int],
    workers: int,
    out: Path,
    max_time_s: float,
    beware: BewareList,
    perception: Perception | None = None,
) -> dict[str, Any]:
    """Drive one episode a seed, keep each as it ends, print a table, write `summary.json`; returns the summary."""
    perception = perception or colour_perception()
    # What an episode depends on beside its seed; kept episodes of anything else are not this campaign's.
    rules = repr((load_scenario(scenario), beware.classes, max_time_s, NavigatorConfig(), perception.identity))
    campaign = hashlib.sha256(rules.encode()).hexdigest()[:16]
    wanted = list(seeds)
    kept = out / "episodes.jsonl"
    text = kept.read_text(encoding="utf-8") if kept.exists() else ""
    torn = bool(text) and not text.endswith("\n")
    done = {report["seed"]: report for report in _read(text, campaign, kept)}
    todo = [seed for seed in wanted if seed not in done]
    try:
        out.mkdir(parents=True, exist_ok=True)
        with kept.open("a", encoding="utf-8") as file:
            if torn:
                file.write("\n")
            for report in _driven(scenario, todo, workers, max_time_s, beware, perception):
                done[report["seed"]] = report
                file.write(json.dumps({**report, "campaign": campaign}) + "\n")
                file.flush()
        reports = [done[seed] for seed in wanted]
        summary = summarise(scenario, reports)
        (out / "summary.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    except OSError as error:
        raise BadConfiguration(f"{out} cannot be written: {error}") from None
    _print(reports, summary)
    return summary


def summarise(scenario: str, reports: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of a campaign."""

    def mean(value: Callable[[dict[str, Any]], float]) -> float:
        return round(statistics.fmean(value(report) for report in reports), 4)

    return {
        "scenario": scenario,
        "episodes": len(reports),
        "success_rate": mean(lambda report: float(report["success"])),
        "goals_reached": sum(report["goals_reached"] for report in reports),
        "goals": sum(len(report["goals"]) for report in reports),
        "collisions": sum(report["collisions"] for report in reports),
        "beware_intrusions": sum(report["beware_intrusions"] for report in reports),
        "zone_intrusions": sum(report["zone_intrusions"] for report in reports),
        "min_clearance_m": min(report["min_clearance_m"] for report in reports),
        "spl": mean(lambda report: report["spl"]),
        "sim_time_s": mean(lambda report: report["sim_time_s"]),
        "real_time_factor": mean(lambda report: report["sim_time_s"] / report["wall_time_s"]),
        "tick_ms_p99": mean(lambda report: report["tick_ms"]["p99"]),
    }


def _driven(
    scenario: str, seeds: list[int], workers: int, max_time_s: float, beware: BewareList, perception: Perception
) -> Iterator[dict[str, Any]]:
    if workers == 1:
        yield from (_drive(scenario, seed, max_time_s, beware, perception) for seed in seeds)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        # Each worker makes the same segmenter again, with the engine that was found, and keeps to one thread.
        choice = dataclasses.replace(perception.choice, threads=1)
        jobs = [pool.submit(_drive_alone, scenario, seed, max_time_s, beware, choice) for seed in seeds]
        yield from (job.result() for job in as_completed(jobs))


def _drive_alone(scenario: str, seed: int, max_time_s: float, beware: BewareList, choice: SegmenterChoice) -> dict[str, Any]:
    return _drive(scenario, seed, max_time_s, beware, compose(choice))


def _drive(scenario: str, seed: int, max_time_s: float, beware: BewareList, perception: Perception) -> dict[str, Any]:
    episode = Episode(load_scenario(scenario), seed=seed, beware=beware, max_time_s=max_time_s, perception=perception)
    try:
        return episode.run()
    finally:
        episode.close()


def _read(text: str, campaign: str, path: Path) -> Iterator[dict[str, Any]]:
    """The episodes kept before; a line that a kill cut short is driven again."""
    for line in text.splitlines():
        try:
            report = json.loads(line)
        except json.JSONDecodeError:
            continue
        if report.get("campaign") != campaign:
            raise BadConfiguration(
                f"{path} holds episodes of another world, beware list, segmenter or time limit; give another --out"
            )
        yield report


def _print(reports: list[dict[str, Any]], summary: dict[str, Any]) -> None:
    columns = (
        *("seed", "success", "goals_reached", "collisions", "beware_intrusions", "zone_intrusions", "min_clearance_m"),
        *("distance_m", "spl", "sim_time_s", "wall_time_s", "replans"),
    )
    table = Table(*columns, title=summary["scenario"])
    for report in reports:
        table.add_row(*(f"{report[column]}" for column in columns))
    terminal = Terminal(width=None if sys.stdout.isatty() else 160)
    terminal.print(table)
    terminal.print_json(data=summary)
