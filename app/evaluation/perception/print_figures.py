"""Figures of the benchmark of prints as they stand in tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

DISTANCES_M = (0.8, 1.2, 1.6, 2.0, 2.5, 3.0, 4.0)
"""Distances along the floor from the camera to a print or a thing, metres."""
COLUMNS = (
    *("class", "prints that the network claims", "that come through", "their views refuted"),
    *("views of things claimed", "wrongly refuted", "outlines of prints refuted"),
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
        by_distance(sheets["refuted"], sheets["claimed"]),
        by_distance(things["claimed"], things["in_view"]),
        by_distance(things["refuted"], things["claimed"]),
        by_distance(sheets["outlines_refuted"], sheets["in_view"]),
        by_distance(things["outlines_refuted"], things["in_view"]),
        _limit(found),
    )


def by_distance(part: Sequence[int], whole: Sequence[int]) -> str:
    """Return how many of how many at each distance at which there is any."""
    shown = [
        f"{away_m:g} m {some}/{all_of}"
        for away_m, some, all_of in zip(DISTANCES_M, part, whole, strict=True)
        if all_of
    ]
    return ", ".join(shown) or "none"


def _limit(found: Mapping[str, Any]) -> str:
    if found["min_height_m"] is None:
        return "never: the class may be flat"
    limit_m = found["decides_up_to_m"]
    return "never" if limit_m is None else f"{limit_m:g} m"
