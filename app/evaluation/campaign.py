"""Campaigns: many episodes on several workers, resumable from `episodes.jsonl`."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import statistics
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any

from pebble import ProcessExpired, ProcessPool
from rich.console import Console as Terminal
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from navcore.errors import BadConfiguration

Report = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """How the episodes of a campaign are driven and recognised."""

    key: str
    """Report field with the whole number that identifies an episode, e.g. `seed`."""
    rules: object
    """Everything an episode depends on besides its key; the hash of its `repr` identifies the
    campaign, and episodes of another campaign are refused."""
    holds: str
    """The contents of a refused file, in words, for the error message."""
    drive: Callable[[int], Report]
    """Drives the episode of a key in this process."""
    drive_alone: Callable[[int], Report]
    """Drives the episode of a key in a worker process; can be pickled."""
    limit_s: float = 3600.0
    """Real time in seconds after which an episode in a worker counts as hung."""

    def run(self, wanted: Sequence[int], *, workers: int, out: Path) -> list[Report]:
        """Drive the episodes that are not recorded yet and record each when it ends.

        A worker that is killed or hangs fails its own episode only, which is tried once more.
        Returns the reports in the order of `wanted`; raises `BadConfiguration`, and
        `EpisodesFailed` after all others are recorded.
        """
        name = hashlib.sha256(repr(self.rules).encode()).hexdigest()[:16]
        kept = out / "episodes.jsonl"
        try:
            text = kept.read_text(encoding="utf-8") if kept.exists() else ""
            done = {report[self.key]: report for report in self._read(text, name, kept)}
            out.mkdir(parents=True, exist_ok=True)
            with kept.open("a", encoding="utf-8") as file:
                if text and not text.endswith("\n"):
                    file.write("\n")
                left = [key for key in wanted if key not in done]
                for report in _shown(
                    self._driven(left, workers),
                    [done[key] for key in wanted if key in done],
                    len(wanted),
                ):
                    done[report[self.key]] = report
                    file.write(json.dumps({**report, "campaign": name}) + "\n")
                    file.flush()
        except OSError as error:
            raise BadConfiguration(f"{out} cannot be written: {error}") from None
        return [done[key] for key in wanted]

    def _driven(self, keys: list[int], workers: int) -> Iterator[Report]:
        if workers == 1:
            yield from map(self.drive, keys)
            return
        pool = ProcessPool(workers, context=get_context("spawn"), initializer=_end_with_parent)
        failed: dict[int, str] = {}
        try:
            waiting = {self._scheduled(pool, key): key for key in keys}
            tried = set[int]()
            while waiting:
                ended, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for job in ended:
                    key = waiting.pop(job)
                    cause = _failure_of(job, self.limit_s)
                    if cause is None:
                        yield job.result()
                    elif key not in tried:
                        tried.add(key)
                        waiting[self._scheduled(pool, key)] = key
                    else:
                        failed[key] = cause
            pool.close()  # type: ignore[no-untyped-call]
        finally:
            # Episodes in progress are not recorded: do not let the operator wait for them.
            pool.stop()  # type: ignore[no-untyped-call]
            pool.join()
        if failed:
            raise EpisodesFailed(self.key, failed)

    def _scheduled(self, pool: ProcessPool, key: int) -> Future[Report]:
        job: Future[Report] = pool.schedule(self.drive_alone, args=[key], timeout=self.limit_s)
        return job

    def _read(self, text: str, name: str, path: Path) -> Iterator[Report]:
        """Yield the recorded episodes; a line that was cut short by a kill is driven again."""
        for line in text.splitlines():
            try:
                report = json.loads(line)
            except json.JSONDecodeError:
                continue
            if report.get("campaign") != name:
                raise BadConfiguration(f"{path} holds episodes of {self.holds}; give another --out")
            yield report


class EpisodesFailed(BadConfiguration):
    """Some episodes failed twice; all others are recorded."""

    def __init__(self, key: str, causes: dict[int, str]) -> None:
        self.causes = causes
        """Why each episode failed, by its key."""
        said = ", ".join(f"{key} {number} ({cause})" for number, cause in sorted(causes.items()))
        super().__init__(
            f"these episodes failed twice: {said}; all others are recorded, and the same command "
            "tries these again"
        )


def _failure_of(job: Future[Report], limit_s: float) -> str | None:
    """Return why an episode has no report although no error of the program was raised."""
    error = job.exception()
    if error is None:
        return None
    if isinstance(error, ProcessExpired):
        return f"its worker ended with exit code {error.exitcode}"
    if isinstance(error, TimeoutError):
        return f"it took longer than {limit_s:g} s"
    raise error


def _shown(driven: Iterator[Report], kept: list[Report], total: int) -> Iterator[Report]:
    """Yield the driven reports and show a progress bar."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Terminal(stderr=True)) as bar:
        succeeded = sum(bool(report["success"]) for report in kept)
        task = bar.add_task(_progress_text(succeeded, len(kept)), total=total, completed=len(kept))
        for number, report in enumerate(driven, start=len(kept) + 1):
            yield report
            succeeded += bool(report["success"])
            bar.update(task, completed=number, description=_progress_text(succeeded, number))


def _progress_text(succeeded: int, ended: int) -> str:
    return f"{succeeded} of {ended} succeeded" if ended else "driving"


def _end_with_parent() -> None:
    """End this worker when its parent is killed; Ctrl-C is left to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def mean_of(reports: Sequence[Report], value: Callable[[Report], float]) -> float:
    """Return the mean of a value over reports, rounded to four decimals."""
    return round(statistics.fmean(value(report) for report in reports), 4)


def write_summary(summary: Report, out: Path) -> None:
    """Write `summary.json`; raises `BadConfiguration` when the folder cannot be written."""
    try:
        (out / "summary.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    except OSError as error:
        raise BadConfiguration(f"{out} cannot be written: {error}") from None


def conclude(
    reports: Sequence[Report], summary: Report, *, columns: Sequence[str], title: str, out: Path
) -> None:
    """Write `summary.json` and print a table of the reports."""
    write_summary(summary, out)
    table = Table(*columns, title=title)
    for report in reports:
        table.add_row(*(f"{report[column]}" for column in columns))
    terminal = Terminal(width=None if sys.stdout.isatty() else 160)
    terminal.print(table)
    terminal.print_json(data=summary)
