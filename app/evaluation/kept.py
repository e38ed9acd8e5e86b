"""Figures that are kept with the project, and campaigns that can grow over days of work.

    python -m app.evaluation.kept keep runs/doors           # and rewrite the tables of results
    python -m app.evaluation.kept resume doors runs/doors   # drive on with the same command

`results/NAME.json` is the summary of a campaign, `results/episodes/NAME.jsonl.xz` its card and the
reports of its episodes, without the series over time. Of suites that run as a whole there is the
summary alone.
"""

from __future__ import annotations

import json
import lzma
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from app.evaluation.campaign import SUMMARY, note_planned
from app.evaluation.conclusions import CONCLUSIONS
from app.evaluation.suites import BY_NAME
from app.evaluation.tables.kinds import file_name
from app.evaluation.tables.pages import RESULTS, rewrite
from app.fleet.campaign_files import CARD, EPISODES, CampaignCard, Report, read_card, recorded
from navcore.errors import BadConfiguration, BewareNavError

FOLDER = "episodes"
SUFFIX = ".jsonl.xz"
cli = typer.Typer(
    help="Campaigns that are kept with the project.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@cli.command()
def keep(
    folder: Path,
    replace: Annotated[
        bool, typer.Option("--replace", help="Overwrite what another campaign was kept as.")
    ] = False,
) -> None:
    """Keep the summary and the episodes of a folder of results, and rewrite the tables."""
    typer.echo(f"kept as {keep_results(folder, replace=replace)}")
    rewrite()


@cli.command()
def resume(name: Annotated[str, typer.Argument(metavar="NAME")], folder: Path) -> None:
    """Unpack the episodes of a kept campaign into a folder, in which the same command with more
    `--episodes` drives those that are left."""
    card = resume_campaign(name, folder)
    typer.echo(f"{folder} holds {len(card.keys)} episodes of: {card.command}")


def keep_results(folder: Path, results: Path = RESULTS, *, replace: bool = False) -> str:
    """Keep a folder of results in `results`; return its name there.

    The summary of a campaign that drives is made of its episodes again, by the rules of today; that
    of a suite that runs as a whole is copied. Raises `BadConfiguration` for a folder without a
    summary, whose summary is of other episodes or of no suite, or of worlds without seeds, and
    unless `replace` where something is kept under that name that does not grow by this: the
    campaign of other rules, other episodes, or a summary alone.
    """
    summary = _summary_in(folder)
    card = read_card(folder) if (folder / CARD).exists() else None
    reports: list[Report] = []
    if card is not None and card.suite in CONCLUSIONS:
        reports = _ended(folder, card, summary)
        summary = CONCLUSIONS[card.suite].summarise(card.command, reports)
        note_planned(summary, max(card.planned, len(card.keys)))
    elif "suite" not in summary:
        raise BadConfiguration(f"{folder}: neither its summary nor its command names a suite")
    name = file_name(summary)
    if not (replace or _grows(name, card, summary, results)):
        raise BadConfiguration(
            f"{name} is kept of another campaign; --replace overwrites it with that of {folder}"
        )
    episodes = results / FOLDER / f"{name}{SUFFIX}"
    if card is not None and reports:
        episodes.parent.mkdir(exist_ok=True)
        episodes.write_bytes(_packed(card, reports))
    else:
        episodes.unlink(missing_ok=True)  # of the campaign that is overwritten
    (results / f"{name}.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    return name


def _summary_in(folder: Path) -> dict[str, Any]:
    """Return the summary of a folder, with the suite that earlier versions did not name; raises
    `BadConfiguration`."""
    try:
        summary = dict(json.loads((folder / SUMMARY).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise BadConfiguration(f"{folder} holds no ended campaign: {error}") from None
    named = [word for word in summary.get("command", "").split() if word in BY_NAME]
    return {"suite": named[0], **summary} if named else summary


def _ended(folder: Path, card: CampaignCard, summary: Report) -> list[Report]:
    """Return the reports of a campaign in the order of its keys; raises `BadConfiguration`."""
    if card.key != "seed":
        raise BadConfiguration(
            f"{folder}: episodes of {card.suite} have no seeds, and are not kept"
        )
    try:
        lines = (folder / EPISODES).read_text(encoding="utf-8")
    except OSError as error:
        raise BadConfiguration(f"{folder} holds no ended campaign: {error}") from None
    by_key = {report[card.key]: report for _, report in recorded(lines)}
    keys = [key for key in card.keys if key in by_key]
    if summary["seeds"] != keys:
        raise BadConfiguration(f"{folder}: the summary is not of the episodes that are recorded")
    return [by_key[key] for key in keys]


def _grows(name: str, card: CampaignCard | None, summary: Report, results: Path) -> bool:
    """Return whether nothing is kept under a name, or a part of this campaign."""
    kept, episodes = results / f"{name}.json", results / FOLDER / f"{name}{SUFFIX}"
    if not kept.exists():
        return True
    if card is None or not episodes.exists():
        return False
    seeds = json.loads(kept.read_text(encoding="utf-8"))["seeds"]
    before, _ = _unpacked(episodes)
    return before.campaign == card.campaign and set(seeds) <= set(summary["seeds"])


def resume_campaign(name: str, folder: Path, results: Path = RESULTS) -> CampaignCard:
    """Write `campaign.json` and `episodes.jsonl` of a kept campaign into a new folder; return its
    card. Raises `BadConfiguration` where it is not kept, or the folder holds episodes."""
    if (folder / EPISODES).exists():
        raise BadConfiguration(f"{folder} holds episodes already; give another folder")
    kept = results / FOLDER / f"{name}{SUFFIX}"
    if not kept.exists():
        raise BadConfiguration(f"the episodes of {name!r} are not kept")
    card, lines = _unpacked(kept)
    folder.mkdir(parents=True, exist_ok=True)
    card.write(folder)
    (folder / EPISODES).write_text(lines, encoding="utf-8")
    return card


def _unpacked(path: Path) -> tuple[CampaignCard, str]:
    """Return the card of a kept campaign, and the lines of its episodes."""
    head, _, lines = lzma.decompress(path.read_bytes()).decode().partition("\n")
    return msgspec.json.decode(head, type=CampaignCard), lines


def _packed(card: CampaignCard, reports: Iterable[Report]) -> bytes:
    lines = [msgspec.json.encode(card).decode(), *map(json.dumps, map(_without_series, reports))]
    return lzma.compress("".join(f"{line}\n" for line in lines).encode(), preset=9)


def _without_series(report: Report) -> Report:
    """Return a report with the last value of each series only, which summaries use."""
    series = report.get("series", {})
    return {**report, "series": {name: values[-1:] for name, values in series.items()}}


if __name__ == "__main__":
    try:
        cli()
    except BewareNavError as error:
        typer.echo(f"kept: {error}", err=True)
        sys.exit(2)
