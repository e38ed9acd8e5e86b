"""Merging the shards of a campaign into the folder that one run would have made."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

from app.evaluation.conclusions import conclusion_of
from app.fleet.campaign_files import (
    EPISODES,
    CampaignCard,
    Report,
    read_card,
    recorded,
)
from navcore.errors import BadConfiguration

SHOWN = 8
"""Number of episodes that a message names."""
Lines = dict[int, tuple[str, Report]]
"""Line and report of each recorded episode, by its key."""


class Allowance(StrEnum):
    """What is wrong with shards and may be accepted."""

    MISSING = "missing"
    REPEATED = "repeated"
    VERSIONS = "versions"


def merge_shards(
    folders: Sequence[Path], *, out: Path, allowed: Collection[Allowance] = ()
) -> dict[str, Any]:
    """Write `episodes.jsonl`, `campaign.json` and `summary.json` of the whole campaign into `out`;
    print and return the summary.

    Episodes stand in the order of their keys, as one worker writes them. Of an episode in several
    shards the first counts. Raises `BadConfiguration` for shards of different campaigns and, unless
    it is allowed, for missing and repeated episodes and different versions of the program.
    """
    if (out / EPISODES).exists():
        raise BadConfiguration(f"{out} holds episodes already; give another --out")
    cards = [read_card(folder) for folder in folders]
    lines = [_lines(folder, card) for folder, card in zip(folders, cards, strict=True)]
    conclusion = conclusion_of(cards[0])
    _check_same(folders, cards, lines, versions=Allowance.VERSIONS not in allowed)
    keys = cards[0].keys
    if Allowance.REPEATED not in allowed:
        _check_repeated(folders, cards[0], lines)
    missing = [key for key in keys if not any(key in found for found in lines)]
    if missing and Allowance.MISSING not in allowed:
        raise BadConfiguration(
            f"no shard holds {cards[0].key} {_listed(missing)}; "
            "--allow missing merges what is there"
        )
    merged: Lines = {}
    for found in reversed(lines):
        merged |= found
    if not merged:
        raise BadConfiguration("the shards hold no episodes")
    ordered = [merged[key] for key in keys if key in merged]
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / EPISODES).write_text("".join(f"{line}\n" for line, _ in ordered), encoding="utf-8")
        planned = max(card.planned for card in cards)
        dataclasses.replace(cards[0], shard=None, planned=planned).write(out)
    except OSError as error:
        raise BadConfiguration(f"{out} cannot be written: {error}") from None
    return conclusion.write(cards[0].command, [report for _, report in ordered], out)


def _lines(folder: Path, card: CampaignCard) -> Lines:
    """Return the episodes of a shard; raises `BadConfiguration`."""
    try:
        text = (folder / EPISODES).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadConfiguration(f"{folder} is no folder of a campaign: {error}") from None
    found = [one for one in recorded(text) if one[1].get("campaign") == card.campaign]
    return {one[1][card.key]: one for one in found if one[1][card.key] in card.keys}


def _check_same(
    folders: Sequence[Path],
    cards: Sequence[CampaignCard],
    lines: Sequence[Lines],
    *,
    versions: bool,
) -> None:
    """Raise `BadConfiguration` with the first difference between the shards."""
    for what in ("segmenter", "version") if versions else ("segmenter",):
        owners: dict[str, Path] = {}
        for folder, found in zip(folders, lines, strict=True):
            for _, report in found.values():
                owners.setdefault(report[what], folder)
        if len(owners) > 1:
            (first, owner), (other, folder) = list(owners.items())[:2]
            raise BadConfiguration(
                f"{folder} has episodes of {what} {other!r}, and {owner} of {first!r}"
                + ("; --allow versions merges them" if what == "version" else "")
            )
    planned = max(card.planned for card in cards)
    whole = dataclasses.replace(cards[0], shard=None, planned=planned)
    for folder, card in zip(folders, cards, strict=True):
        if card.command != whole.command:
            raise BadConfiguration(
                f"{folder} was made by {card.command!r}, and {folders[0]} by {whole.command!r}"
            )
        if dataclasses.replace(card, shard=None, planned=planned) != whole:
            raise BadConfiguration(
                f"{folder} is of another campaign than {folders[0]}: a file that the command "
                "names, the configuration or the beware list differs"
            )


def _check_repeated(folders: Sequence[Path], card: CampaignCard, lines: Sequence[Lines]) -> None:
    for key in card.keys:
        holders = [
            str(folder) for folder, found in zip(folders, lines, strict=True) if key in found
        ]
        if len(holders) > 1:
            raise BadConfiguration(
                f"{card.key} {key} is in several shards, {' and '.join(holders)}; "
                "--allow repeated takes the first"
            )


def _listed(keys: Sequence[int]) -> str:
    return ", ".join(map(str, keys[:SHOWN])) + (
        f" and {len(keys) - SHOWN} more" if len(keys) > SHOWN else ""
    )
