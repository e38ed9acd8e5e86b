"""Counts of the detection benchmark over some drives: rates with their intervals, and a table."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console as Terminal
from rich.table import Table

from app.evaluation.summary import Interval, rate_interval
from navcore.learning.data.class_names import BEWARE_CLASSES

THIN = ("book", "cable", "keyboard")
"""Classes lower than 6 cm, of which the camera sees few rows of pixels."""
RESAMPLES = 2000
"""Number of resamples of the bootstrap."""


@dataclass(slots=True, kw_only=True)
class DetectionCounts:
    """Counts over one or more drives."""

    seen: Counter[str] = field(default_factory=Counter)
    """Objects in view within 4 m, by class."""
    found: Counter[str] = field(default_factory=Counter)
    """Objects in view that the map held in time as any class of the list."""
    named: Counter[str] = field(default_factory=Counter)
    """Objects in view that the map held in time as their own class."""
    false: Counter[str] = field(default_factory=Counter)
    """False items, by the class on the map."""
    walked_m: float = 0.0
    """Total length of the drives."""

    def __add__(self, other: DetectionCounts) -> DetectionCounts:
        return DetectionCounts(
            seen=self.seen + other.seen,
            found=self.found + other.found,
            named=self.named + other.named,
            false=self.false + other.false,
            walked_m=self.walked_m + other.walked_m,
        )


def summary(drives: Sequence[DetectionCounts]) -> dict[str, Any]:
    """Return the rates over some drives as a JSON object, with 95 % intervals: of shares by Wilson,
    of the rate of false items by a bootstrap over the drives, in which they come in groups."""
    total = sum(drives, DetectionCounts())
    found, seen = total.found, total.seen
    thin = sum(found[name] for name in THIN), sum(seen[name] for name in THIN)
    return {
        "drives": len(drives),
        "things_in_view": seen.total(),
        "found_in_time": _share(found.total(), seen.total()),
        "found_in_time_ci95": _found_interval(found.total(), seen.total()),
        "found_by_class": {
            name: f"{found[name]}/{seen[name]}" for name in BEWARE_CLASSES if seen[name]
        },
        "found_of_thin": f"{thin[0]}/{thin[1]}",
        "found_of_others": f"{found.total() - thin[0]}/{seen.total() - thin[1]}",
        "named_rightly": _share(total.named.total(), seen.total()),
        "false_items": total.false.total(),
        "false_items_by_class": dict(total.false),
        "false_items_per_10_m": round(10 * total.false.total() / max(total.walked_m, 1e-9), 3),
        "false_items_per_10_m_ci95": _false_interval(drives),
        "walked_m": round(total.walked_m, 1),
    }


def report(drives: Sequence[DetectionCounts], out: Path | None) -> dict[str, Any]:
    """Print a table, write `finding.json` into `out`, and return the summary."""
    told, total = summary(drives), sum(drives, DetectionCounts())
    table = Table(
        "class",
        "in view ≤ 4 m",
        "found ≥ 1.5 m away",
        "by its name",
        "false items",
        title="objects found in time",
    )
    for name in BEWARE_CLASSES[1:]:
        counters = (total.seen, total.found, total.named, total.false)
        table.add_row(name, *(str(counter[name]) for counter in counters))
    terminal = Terminal()
    terminal.print(table)
    least, most = told["found_in_time_ci95"]
    few, many = told["false_items_per_10_m_ci95"]
    terminal.print(
        f"{told['found_in_time']:.1%} ({least:.0%} to {most:.0%}) of {told['things_in_view']} "
        f"objects found in time: {told['found_of_thin']} thin ones ({', '.join(THIN)}), "
        f"{told['found_of_others']} others; {told['false_items_per_10_m']:.2f} "
        f"({few:.2f} to {many:.2f}) false items per 10 m, {told['walked_m']:g} m driven"
    )
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "finding.json").write_text(json.dumps(told, indent=1), encoding="utf-8")
    return told


def _share(part: int, whole: int) -> float:
    return round(part / max(whole, 1), 4)


def _found_interval(found: int, seen: int) -> Interval:
    low, high = rate_interval(found, seen) if seen else (0.0, 1.0)
    return round(low, 4), round(high, 4)


def _false_interval(drives: Sequence[DetectionCounts]) -> Interval:
    """Return the interval of the false items per 10 m over drives drawn with replacement."""
    false = np.array([drive.false.total() for drive in drives])
    walked_m = np.array([drive.walked_m for drive in drives])
    drawn = np.random.default_rng(0).integers(len(drives), size=(RESAMPLES, len(drives)))
    rates = 10 * false[drawn].sum(axis=1) / np.maximum(walked_m[drawn].sum(axis=1), 1e-9)
    low, high = np.percentile(rates, (2.5, 97.5))
    return round(float(low), 3), round(float(high), 3)
