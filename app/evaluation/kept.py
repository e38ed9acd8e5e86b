"""Campaigns that are kept with the project, so that they can grow over days of work.

    python -m app.evaluation.kept keep runs/doors           # and rewrite the tables of results
    python -m app.evaluation.kept resume doors runs/doors   # drive on with the same command

`results/NAME.json` is the summary of a campaign, `results/episodes/NAME.jsonl.xz` its card and the
reports of its episodes, without the series over time.
"""

from __future__ import annotations

import json
import lzma
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from app.evaluation.tables.kinds import file_name
from app.evaluation.tables.pages import RESULTS, rewrite
from app.fleet.campaign_files import EPISODES, CampaignCard, Report, read_card, recorded
from navcore.errors import BadConfiguration, BewareNavError

FOLDER = "episodes"
SUFFIX = ".jsonl.xz"
cli = typer.Typer(
    help="Campaigns that are kept with the project.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@cli.command()
def keep(folder: Path) -> None:
    """Keep the summary and the episodes of a campaign's folder, and rewrite the tables."""
    typer.echo(f"kept as {keep_campaign(folder)}")
    rewrite()


@cli.command()
def resume(name: Annotated[str, typer.Argument(metavar="NAME")], folder: Path) -> None:
    """Unpack the episodes of a kept campaign into a folder, in which the same command with more
    `--episodes` drives those that are left."""
    card = resume_campaign(name, folder)
    typer.echo(f"{folder} holds {len(card.keys)} episodes of: {card.command}")


def keep_campaign(folder: Path, results: Path = RESULTS) -> str:
    """Copy the summary and the episodes of a campaign into `results`; return its name there.

    Raises `BadConfiguration` for a folder without a summary, whose summary is of other episodes, or
    of a suite whose episodes have no seeds.
    """
    card = read_card(folder)
    try:
        text = (folder / "summary.json").read_text(encoding="utf-8")
        lines = (folder / EPISODES).read_text(encoding="utf-8")
        summary = json.loads(text)
    except (OSError, ValueError) as error:
        raise BadConfiguration(f"{folder} holds no ended campaign: {error}") from None
    by_key = {report[card.key]: report for _, report in recorded(lines)}
    keys = [key for key in card.keys if key in by_key]
    if card.key != "seed":
        raise BadConfiguration(
            f"{folder}: episodes of {card.suite} have no seeds, and are not kept"
        )
    if summary["seeds"] != keys:
        raise BadConfiguration(f"{folder}: the summary is not of the episodes that are recorded")
    name = file_name(summary)
    (results / FOLDER).mkdir(exist_ok=True)
    (results / FOLDER / f"{name}{SUFFIX}").write_bytes(_packed(card, map(by_key.__getitem__, keys)))
    (results / f"{name}.json").write_text(text, encoding="utf-8")
    return name


def resume_campaign(name: str, folder: Path, results: Path = RESULTS) -> CampaignCard:
    """Write `campaign.json` and `episodes.jsonl` of a kept campaign into a new folder; return its
    card. Raises `BadConfiguration` where it is not kept, or the folder holds episodes."""
    if (folder / EPISODES).exists():
        raise BadConfiguration(f"{folder} holds episodes already; give another folder")
    try:
        packed = (results / FOLDER / f"{name}{SUFFIX}").read_bytes()
    except OSError:
        raise BadConfiguration(f"the episodes of {name!r} are not kept") from None
    head, _, lines = lzma.decompress(packed).decode().partition("\n")
    card = msgspec.json.decode(head, type=CampaignCard)
    folder.mkdir(parents=True, exist_ok=True)
    card.write(folder)
    (folder / EPISODES).write_text(lines, encoding="utf-8")
    return card


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
