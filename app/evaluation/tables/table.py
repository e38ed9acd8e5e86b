"""A table of results in Markdown, and the cells that several have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.evaluation.summary import ZONE_RATE, rate_interval

Result = Mapping[str, Any]
"""A kept summary of a campaign, or report of a recording."""
Row = Sequence[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of the results of one kind."""

    shows: Callable[[Result], bool]
    """Whether it shows a result."""
    columns: Row
    """Names of the columns."""
    rows: Callable[[Result], Sequence[Row]]
    """The rows of a result."""
    always: bool = False
    """Whether it stands on the page without any result, too."""

    def of(self, results: Sequence[Result]) -> str:
        """Return the table in Markdown; nothing without results, unless it stands `always`."""
        shown = [result for result in results if self.shows(result)]
        if not (shown or self.always):
            return ""
        lines = [
            self.columns,
            ["---"] * len(self.columns),
            *(row for result in shown for row in self.rows(result)),
        ]
        return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def single(row: Callable[[Result], Row]) -> Callable[[Result], Sequence[Row]]:
    """Return the rows of results that have one row each."""
    return lambda result: (row(result),)


def listed(by_name: Mapping[str, object]) -> str:
    """Return names with their numbers."""
    return ", ".join(f"{name} {count}" for name, count in by_name.items()) or "none"


def failures(result: Result) -> str:
    """Return the causes of failures with their seeds."""
    causes = result["failures"].items()
    return "; ".join(f"{cause}: {', '.join(map(str, seeds))}" for cause, seeds in causes) or "none"


def seeds(result: Result) -> str:
    """Return the first and the last seed."""
    return f"{min(result['seeds'])} to {max(result['seeds'])}"


def percent(share: float, digits: int = 0) -> str:
    """Return a share in per cent."""
    return f"{share:.{digits}%}".replace("%", " %")


def count(result: Result, key: str) -> str:
    """Return how many episodes a rate stands for, of how many that it is judged by."""
    episodes = _judged(result, key)
    return f"{round((result[key] or 0.0) * episodes)} of {episodes}"


def interval(result: Result, key: str) -> str:
    """Return the 95 % interval of a rate over the episodes that it is judged by (Wilson); a dash
    without one."""
    episodes = _judged(result, key)
    return share_interval(round(result[key] * episodes), episodes) if episodes else "–"


def _judged(result: Result, key: str) -> int:
    """Return how many episodes a rate is judged by: into a zone only those can drive that have
    one. Summaries of earlier versions do not tell how many do."""
    episodes: int = result["episodes"]
    return int(result.get("zone_episodes", episodes)) if key == ZONE_RATE else episodes


def share_interval(number: int, trials: int) -> str:
    """Return the 95 % interval of `number` of `trials` (Wilson)."""
    low, high = rate_interval(number, trials)
    return f"{percent(low)} to {percent(high)}"
