"""Progress of a campaign: how many episodes succeeded, how long the rest takes, and the rate."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rich.console import Console as Terminal
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from app.fleet.campaign_files import Report

PERIOD_S = 7 * 86_400.0
"""Time over which the rate of the estimate is measured, seconds: episodes take minutes each."""


@dataclass(frozen=True, slots=True)
class Driven:
    """A driven episode."""

    report: Report
    """Report of the episode."""
    node: str
    """Machine on which it was driven."""
    pid: int
    """Process in which it was driven."""


def shown(driven: Iterator[Driven], kept: Sequence[Report], total: int) -> Iterator[Report]:
    """Yield the reports of driven episodes and show a progress bar with an estimate of the time
    left; a line for each episode where the output is no terminal. Print the rate at the end."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    terminal, began_s = Terminal(stderr=True), time.monotonic()
    by_node, workers = Counter[str](), set[tuple[str, int]]()
    with Progress(
        *columns,
        console=terminal,
        speed_estimate_period=PERIOD_S,
        disable=not terminal.is_terminal,
    ) as bar:
        succeeded = sum(bool(report["success"]) for report in kept)
        task = bar.add_task(_text(succeeded, len(kept)), total=total, completed=len(kept))
        for number, one in enumerate(driven, start=len(kept) + 1):
            yield one.report
            succeeded += bool(one.report["success"])
            by_node[one.node] += 1
            workers.add((one.node, one.pid))
            said = _text(succeeded, number)
            bar.update(task, completed=number, description=said)
            if not terminal.is_terminal:
                took_s = time.monotonic() - began_s
                left_s = took_s / by_node.total() * (total - number)
                terminal.print(f"{said}, {total} wanted, about {left_s / 60:.0f} min left")
    if by_node:
        took_s = time.monotonic() - began_s
        terminal.print(rate_of(by_node, len(workers), took_s), soft_wrap=True)


def rate_of(by_node: Counter[str], workers: int, took_s: float) -> str:
    """Return the episodes per hour with this number of workers, and those of each machine."""
    per_hour = {node: number * 3600 / took_s for node, number in sorted(by_node.items())}
    text = (
        f"{by_node.total()} episodes in {took_s / 60:.1f} min: "
        f"{sum(per_hour.values()):.1f} per hour, workers: {workers}, machines: {len(per_hour)}"
    )
    if len(per_hour) > 1:
        text += " (" + ", ".join(f"{node} {rate:.1f}" for node, rate in per_hour.items()) + ")"
    return text


def _text(succeeded: int, ended: int) -> str:
    return f"{succeeded} of {ended} succeeded" if ended else "driving"
