"""Campaigns: many episodes on several workers, resumable from `episodes.jsonl`."""

from __future__ import annotations

import hashlib
import json
import logging
import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console as Terminal
from rich.table import Table

from app.fleet.campaign_files import EPISODES, CampaignCard, Report, read_card, recorded
from app.fleet.campaign_progress import Driven, shown
from app.fleet.engine import Engine, Lost, run
from app.fleet.local import ThisProcess
from app.fleet.shard import Shard
from app.runtime.record.provenance import command_line, version
from navcore.errors import BadConfiguration, BewareNavError

SUMMARY = "summary.json"
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """Which episodes of a campaign are driven, and where."""

    engine: Engine = field(default_factory=ThisProcess)
    """Where the episodes are driven."""
    shard: Shard | None = None
    """Share of the episodes; None for all."""


HERE = Fleet()
"""All episodes, one after the other in this process."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """How the episodes of a campaign are driven and recognised."""

    suite: str
    """Name of what is driven, by which its `Conclusion` is found."""
    key: str
    """Report field with the whole number that identifies an episode, e.g. `seed`."""
    rules: object
    """Everything an episode depends on besides its key; the hash of its `repr` identifies the
    campaign, and episodes of another campaign are refused."""
    holds: str
    """The contents of a refused file, in words, for the error message."""
    drive: Callable[[int], Any]
    """Drives the episode of a key in this process."""
    drive_alone: Callable[[int], Any]
    """Drives the episode of a key in a worker process; can be pickled."""
    report_of: Callable[[Any], Report] = lambda report: report
    """Returns the report of what came of an episode."""
    after: Callable[[Any], None] = lambda driven: None
    """Called with what came of an episode once its report is recorded, to write its figures."""

    def run(self, keys: Sequence[int], *, fleet: Fleet, out: Path) -> list[Report]:
        """Drive the episodes of the fleet's share that are not recorded yet and record each when it
        ends.

        An episode fails that raises an error, or whose worker is killed or hangs twice. Returns the
        reports in the order of the keys; raises `BadConfiguration`, and `EpisodesFailed` after all
        others are recorded.
        """
        name = hashlib.sha256(repr(self.rules).encode()).hexdigest()[:16]
        wanted = list(keys) if fleet.shard is None else fleet.shard.of(keys)
        if not wanted:
            raise BadConfiguration(f"--shard {fleet.shard}: there are only {len(keys)} episodes")
        before = _card_of(out)
        is_same = before is not None and before.campaign == name
        asked = {*before.keys, *before.earlier} if before is not None and is_same else set[int]()
        card = CampaignCard(
            suite=self.suite,
            campaign=name,
            command=command_line(),
            key=self.key,
            keys=tuple(keys),
            shard=None if fleet.shard is None else str(fleet.shard),
            earlier=tuple(sorted(asked - set(keys))),
            planned=max(len(asked | set(keys)), _planned(before) if is_same else 0),
        )
        kept = out / EPISODES
        with writing(out):
            text = kept.read_text(encoding="utf-8") if kept.exists() else ""
            reports = [report for _, report in recorded(text)]
        if any(report.get("campaign") != name for report in reports):
            raise BadConfiguration(f"{kept} holds episodes of {self.holds}; give another --out")
        done = {report[self.key]: report for report in reports}
        with writing(out):
            out.mkdir(parents=True, exist_ok=True)
            card.write(out)
            _append(kept, "\n" if text and not text.endswith("\n") else "")
        left = [key for key in wanted if key not in done]
        known = [done[key] for key in wanted if key in done]
        _tell_older(known, len(wanted))
        for report in shown(self._driven(left, fleet.engine), known, len(wanted)):
            done[report[self.key]] = report
            with writing(out):
                _append(kept, json.dumps({**report, "campaign": name}) + "\n")
        return [done[key] for key in wanted]

    def _driven(self, keys: list[int], engine: Engine) -> Iterator[Driven]:
        if not keys:
            return
        causes: dict[int, str] = {}
        drive = partial(_tried, self.drive if engine.alone else self.drive_alone)
        with closing(run(engine, drive, keys)) as ended:
            for key, outcome in ended:
                if isinstance(outcome, Lost):
                    causes[key] = f"twice: {outcome.cause}"
                elif isinstance(outcome.result, _Raised):
                    causes[key] = outcome.result.cause
                else:
                    yield Driven(self.report_of(outcome.result), outcome.node, outcome.pid)
                    self.after(outcome.result)  # recorded by the reader of this, which goes on
        if causes:
            raise EpisodesFailed(self.key, causes)


@dataclass(frozen=True, slots=True)
class _Raised:
    """An error that an episode has raised."""

    cause: str
    """What it says."""


def _tried(drive: Callable[[int], Any], key: int) -> Any:
    """Drive an episode; return `_Raised` for an error, that of the program with its traceback on
    stderr."""
    try:
        return drive(key)
    except BewareNavError as error:
        return _Raised(str(error))
    except Exception as error:
        _log.exception("an episode failed")
        return _Raised(f"{type(error).__name__}: {error}")


def _append(path: Path, text: str) -> None:
    """Append to a file and close it, so that it holds the text or this raises the `OSError`."""
    with path.open("a", encoding="utf-8") as file:
        file.write(text)


def _tell_older(kept: Sequence[Report], wanted: int) -> None:
    """Say which kept episodes another version has driven: they are not driven again."""
    own = version()
    others = [other for report in kept if (other := report.get("version", own)) != own]
    if others:
        Terminal(stderr=True).print(
            f"{len(others)} of {wanted} episodes are kept, driven by version "
            f"{' and '.join(sorted(set(others)))}; this is {own}, and another --out drives them "
            "again",
            highlight=False,
            soft_wrap=True,
        )


@contextmanager
def writing(out: Path) -> Iterator[None]:
    """Raise `BadConfiguration` where a file of the folder cannot be read or written; an error of an
    episode is none of these."""
    try:
        yield
    except OSError as error:
        raise BadConfiguration(f"{out} cannot be written: {error}") from None


def _card_of(out: Path) -> CampaignCard | None:
    """Return the card of a folder; None where it has none, or one that a kill cut short, which is
    written again."""
    with suppress(BadConfiguration):
        return read_card(out)
    return None


def _planned(card: CampaignCard | None) -> int:
    """Return how many episodes were ever asked for; 0 without a card."""
    return 0 if card is None else max(card.planned, len(card.keys))


class EpisodesFailed(BadConfiguration):
    """Some episodes failed; all others are recorded."""

    def __init__(self, key: str, causes: dict[int, str]) -> None:
        self.causes = causes
        """Why each episode failed, by its key."""
        numbers: dict[str, list[int]] = {}
        for number, cause in sorted(causes.items()):
            numbers.setdefault(cause, []).append(number)
        said = "; ".join(
            f"{key} {', '.join(map(str, failed))} ({cause})" for cause, failed in numbers.items()
        )
        super().__init__(
            f"these episodes failed: {said}. All others are recorded, and the same command tries "
            "these again"
        )


def mean_of(reports: Sequence[Report], value: Callable[[Report], float]) -> float:
    """Return the mean of a value over reports, rounded to four decimals."""
    return round(statistics.fmean(value(report) for report in reports), 4)


def write_summary(summary: Report, out: Path) -> None:
    """Write `summary.json`, with the number of episodes that were planned if there were more;
    raises `BadConfiguration` when the folder cannot be written."""
    note_planned(summary, _planned(_card_of(out)))
    with writing(out):
        (out / SUMMARY).write_text(json.dumps(summary, indent=1), encoding="utf-8")


def note_planned(summary: Report, planned: int) -> None:
    """Note in a summary how many episodes were planned, if there were more than it has."""
    if planned > summary.get("episodes", planned):
        summary["planned"] = planned


@dataclass(frozen=True, slots=True, kw_only=True)
class Conclusion:
    """What is made of the reports of a campaign, by the process that drove it or a later one."""

    summarise: Callable[[str, Sequence[Report]], Report]
    """Returns the summary of the reports that a command has made."""
    show: Callable[[Sequence[Report], Report], None]
    """Prints reports and their summary."""

    def write(self, command: str, reports: Sequence[Report], out: Path) -> Report:
        """Write `summary.json` and print it; return the summary."""
        summary = self.summarise(command, reports)
        write_summary(summary, out)
        self.show(reports, summary)
        Terminal(width=None if sys.stdout.isatty() else 140).print(f"the results are in {out}")
        return summary


def show_reports(
    reports: Sequence[Report], summary: Report, *, columns: Sequence[str], title: str
) -> None:
    """Print a table of the reports, and the summary as JSON."""
    table = Table(*columns, title=title)
    for report in reports:
        # Reports of earlier versions lack some.
        table.add_row(*(f"{report.get(column, '–')}" for column in columns))
    terminal = Terminal(width=None if sys.stdout.isatty() else 160)
    terminal.print(table)
    terminal.print_json(data=summary)
