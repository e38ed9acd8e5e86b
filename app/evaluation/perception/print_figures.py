"""Figures of the benchmark of prints as they stand in tables."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

DISTANCES_M = (0.8, 1.2, 1.6, 2.0, 2.5, 3.0, 4.0)
"""Distances along the floor from the camera to a print or a thing, metres."""
COLUMNS = (
    *("class", "prints that the network claims", "that come through"),
    *(
        "prints taken for another class",
        "views of prints refuted",
        "views of things claimed",
        "wrongly refuted",
        "outlines of prints refuted",
    ),
    *("outlines of things wrongly refuted", "decides rightly up to"),
)
"""What the cells of a class are."""


def row_of(name: str, found: Mapping[str, Any], prints: int) -> tuple[str, ...]:
    """Return the figures of a class as the cells of a table, of so many prints of it."""
    sheets, things = found["prints"], found["things"]
    return (
        name,
        f"{len(found['claimed_seeds'])} of {prints}",
        f"{len(found['let_through_seeds'])} of {prints}",
        ", ".join(f"{other} {count}" for other, count in found["taken_for"].items()) or "none",
        by_distance(sheets["refuted"], sheets["claimed"]),
        by_distance(things["claimed"], things["in_view"]),
        by_distance(things["refuted"], things["claimed"]),
        by_distance(sheets["outlines_refuted"], sheets["in_view"]),
        by_distance(things["outlines_refuted"], things["in_view"]),
        limit(found),
    )


def by_distance(part: Sequence[int], whole: Sequence[int]) -> str:
    """Return how many of how many at each distance at which there is any; neighbouring distances
    with the same numbers stand together."""
    counts = [
        (away_m, f"{some}/{all_of}")
        for away_m, some, all_of in zip(DISTANCES_M, part, whole, strict=True)
        if all_of
    ]
    shown = []
    for share, together in itertools.groupby(counts, key=lambda count: count[1]):
        away_m = [f"{one:g}" for one, _ in together]
        span = away_m[0] if len(away_m) == 1 else f"{away_m[0]} to {away_m[-1]}"
        shown.append(f"{span} m {share}")
    return ", ".join(shown) or "none"


def limit(found: Mapping[str, Any]) -> str:
    """Return the distance up to which the checks decide rightly for a class."""
    if found["min_height_m"] is None:
        return "never: no least height"
    limit_m = found["decides_up_to_m"]
    return "never" if limit_m is None else f"{limit_m:g} m"
