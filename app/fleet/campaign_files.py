"""Files of a campaign in its folder: `campaign.json` and `episodes.jsonl`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from navcore.errors import BadConfiguration

Report = dict[str, Any]
EPISODES = "episodes.jsonl"
CARD = "campaign.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignCard:
    """Identity of a campaign, the same in each of its shards but for `shard`."""

    suite: str
    """Name of what is driven."""
    campaign: str
    """Hash of everything an episode depends on besides its key."""
    command: str
    """Command without the options that say where episodes are driven and stored."""
    key: str
    """Report field that identifies an episode."""
    keys: tuple[int, ...]
    """Keys of all episodes, of all shards."""
    shard: str | None
    """Share of these keys that was driven here, as `i/n`; None for all."""
    earlier: tuple[int, ...] = ()
    """Keys that were asked for before, and are not among those of all episodes now."""
    planned: int = 0
    """Largest number of episodes that was ever asked for, of all shards: a campaign that was ended
    early is not one that was planned so."""

    def write(self, folder: Path) -> None:
        """Write the file; raises `OSError`."""
        text = json.dumps(msgspec.to_builtins(self), indent=1)
        (folder / CARD).write_text(text, encoding="utf-8")


def read_card(folder: Path) -> CampaignCard:
    """Read the card of a folder; raises `BadConfiguration`."""
    try:
        return msgspec.json.decode((folder / CARD).read_bytes(), type=CampaignCard)
    except (OSError, msgspec.DecodeError) as error:
        raise BadConfiguration(f"{folder} is no folder of a campaign: {error}") from None


def recorded(text: str) -> Iterator[tuple[str, Report]]:
    """Yield each line of `episodes.jsonl` with its report, without those that a kill cut short."""
    for line in text.splitlines():
        try:
            yield line, json.loads(line)
        except json.JSONDecodeError:
            continue
