"""A share of a campaign, for batch systems that start many jobs and merge their results."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from navcore.errors import BadConfiguration

Key = TypeVar("Key")


@dataclass(frozen=True, slots=True)
class Shard:
    """One of several shares of equal size that together are the whole."""

    index: int
    """Number of the share, from 1."""
    count: int
    """Number of shares."""

    def of(self, keys: Sequence[Key]) -> list[Key]:
        """Return the keys of this share: every `count`-th one."""
        return list(keys[self.index - 1 :: self.count])

    def __str__(self) -> str:
        """Return the share as in the option."""
        return f"{self.index}/{self.count}"


def parse_shard(text: str) -> Shard:
    """Parse `i/n`; raises `BadConfiguration`."""
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    shard = Shard(int(found[1]), int(found[2])) if found else Shard(0, 0)
    if not 1 <= shard.index <= shard.count:
        raise BadConfiguration(f"--shard {text!r}: expected i/n with i from 1 to n, e.g. 2/8")
    return shard
