"""Counts of the suites that walk a camera past objects: rates with their intervals, a table, and
the campaign that records them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console as Terminal
from rich.table import Table
from scipy import stats

from app.evaluation.campaign import HERE, Campaign, write_summary
from app.evaluation.origin import origin_of
from app.evaluation.suites import Suite
from app.evaluation.summary import Interval, rate_interval
from app.runtime.record.provenance import command_line, machine, version
from app.runtime.start.segmentation import Perception
from navcore.mission.beware_list import BewareList
from navcore.robot.camera_stream import CameraStream

THIN = ("book", "cable", "keyboard")
"""Classes lower than 6 cm, of which the camera sees few rows of pixels."""
RESAMPLES = 2000
"""Number of resamples of the bootstrap."""
COUNTERS = ("seen", "found", "named", "false")
"""The counters of a drive."""


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
    first_m: list[tuple[str, float]] = field(default_factory=list)
    """Class and distance in metres at which the map first held each object that was found."""
    walked_m: float = 0.0
    """Total length of the drives."""
    refused: tuple[str, ...] = ()
    """Why a class could not be made, for each drive without it."""

    def __add__(self, other: DetectionCounts) -> DetectionCounts:
        return DetectionCounts(
            **{name: getattr(self, name) + getattr(other, name) for name in COUNTERS},
            first_m=self.first_m + other.first_m,
            walked_m=self.walked_m + other.walked_m,
            refused=self.refused + other.refused,
        )

    def report(self) -> dict[str, Any]:
        """Return the counts as a JSON object; a drive succeeds that finds all and nothing else."""
        counters = {name: dict(getattr(self, name)) for name in COUNTERS}
        all_found = self.found.total() == self.seen.total()
        return counters | {
            "first_m": [list(one) for one in self.first_m],
            "walked_m": self.walked_m,
            "refused": list(self.refused),
            "success": all_found and not self.false.total(),
        }

    @staticmethod
    def of(report: Mapping[str, Any]) -> DetectionCounts:
        """Return the counts of such an object."""
        return DetectionCounts(
            **{name: Counter(report[name]) for name in COUNTERS},
            first_m=[(name, away_m) for name, away_m in report.get("first_m", ())],
            walked_m=report["walked_m"],
            refused=tuple(report["refused"]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Walks:
    """A suite in which a camera is carried through the world of each seed."""

    suite: Suite
    """Name of the suite."""
    names: tuple[str, ...]
    """Classes that there are to find."""
    perception: Perception
    """What finds them."""
    beware: BewareList
    """Classes that count."""
    size: tuple[int, int] = CameraStream().size
    """Columns and rows of the images."""
    rules: object
    """What the counts of a drive depend on besides all these."""
    walk: Callable[[int], DetectionCounts]
    """Returns the counts of the drive that a seed makes."""

    def run(self, seeds: range, *, out: Path) -> dict[str, Any]:
        """Drive once for each seed that `out` does not hold yet, print the rates, write
        `summary.json`, and return the summary. Raises `BadConfiguration` for the folder of
        others."""

        origin = {"version": version(), "machine": machine()}

        def drive(seed: int) -> dict[str, Any]:
            return {"seed": seed} | origin | self.walk(seed).report()

        campaign = Campaign(
            suite=self.suite,
            key="seed",
            rules=(
                str(self.suite),
                "classes of the list",
                self.perception.identity,
                self.beware.classes,
                self.size,
                self.rules,
            ),
            holds="another suite, network, beware list or image size, or of other rules of mapping",
            drive=drive,
            drive_alone=drive,
        )
        reports = campaign.run(seeds, fleet=HERE, out=out)
        counts = [DetectionCounts.of(report) for report in reports]
        told = {
            **origin_of(self.suite, command_line(), reports, segmenter=self.perception.identity),
            "images": list(self.size),
            **summary(counts, self.names),
        }
        write_summary(told, out)
        show(counts, told, self.names)
        return told


def summary(drives: Sequence[DetectionCounts], names: Sequence[str]) -> dict[str, Any]:
    """Return the rates over some drives past objects of the classes `names` as a JSON object, with
    95 % intervals: of shares by Wilson, of the rate of false items by a bootstrap over the drives,
    in which they come in groups (exact Poisson where there are none)."""
    total = sum(drives, DetectionCounts())
    found, seen = total.found, total.seen
    thin = [name for name in THIN if name in names]
    told = {
        "things_in_view": seen.total(),
        "found": found.total(),
        "found_in_time": _share(found.total(), seen.total()),
        "found_in_time_ci95": _found_interval(found.total(), seen.total()),
        "found_by_class": {name: f"{found[name]}/{seen[name]}" for name in names if seen[name]},
        "first_found_m_by_class": _first_m(total, names),
        "named_rightly": _share(total.named.total(), seen.total()),
        "false_items": total.false.total(),
        "false_items_by_class": dict(total.false),
        "false_items_per_10_m": round(10 * total.false.total() / max(total.walked_m, 1e-9), 3),
        "false_items_per_10_m_ci95": _false_interval(drives),
        "walked_m": round(total.walked_m, 1),
        "refused": list(total.refused),
    }
    if thin:
        low = sum(found[name] for name in thin), sum(seen[name] for name in thin)
        told["found_of_thin"] = f"{low[0]}/{low[1]}"
        told["found_of_others"] = f"{found.total() - low[0]}/{seen.total() - low[1]}"
    return told


def show(drives: Sequence[DetectionCounts], told: Mapping[str, Any], names: Sequence[str]) -> None:
    """Print a table by class and the rates of a summary."""
    total = sum(drives, DetectionCounts())
    table = Table(
        "class",
        "in view ≤ 4 m",
        "found ≥ 1.5 m away",
        "by its name",
        "false items",
        "first found, m",
        title="objects found in time",
    )
    for name in names:
        first_m = told["first_found_m_by_class"].get(name, "–")
        counts = (str(getattr(total, counter)[name]) for counter in COUNTERS)
        table.add_row(name, *counts, str(first_m))
    terminal = Terminal()
    terminal.print(table)
    least, most = told["found_in_time_ci95"]
    few, many = told["false_items_per_10_m_ci95"]
    thin = (
        f": {told['found_of_thin']} thin ones ({', '.join(THIN)}), {told['found_of_others']} others"
        if "found_of_thin" in told
        else ""
    )
    terminal.print(
        f"{told['found_in_time']:.1%} ({least:.0%} to {most:.0%}) of {told['things_in_view']} "
        f"objects found in time{thin}; {told['false_items_per_10_m']:.2f} "
        f"({few:.2f} to {many:.2f}) false items per 10 m, {told['walked_m']:g} m driven"
    )
    for why in told["refused"]:
        terminal.print(f"no class: {why}")


def _first_m(total: DetectionCounts, names: Sequence[str]) -> dict[str, float]:
    """Return by class the median distance in metres at which found objects were first held."""
    by_class = {name: [m for one, m in total.first_m if one == name] for name in names}
    return {name: round(float(np.median(m)), 2) for name, m in by_class.items() if m}


def _share(part: int, whole: int) -> float:
    return round(part / max(whole, 1), 4)


def _found_interval(found: int, seen: int) -> Interval:
    low, high = rate_interval(found, seen) if seen else (0.0, 1.0)
    return round(low, 4), round(high, 4)


def _false_interval(drives: Sequence[DetectionCounts]) -> Interval:
    """Return the interval of the false items per 10 m over drives drawn with replacement."""
    false = np.array([drive.false.total() for drive in drives])
    walked_m = np.array([drive.walked_m for drive in drives])
    if not false.any():
        most = float(stats.chi2.ppf(0.975, 2)) / 2
        return 0.0, round(10 * most / max(float(walked_m.sum()), 1e-9), 3)
    drawn = np.random.default_rng(0).integers(len(drives), size=(RESAMPLES, len(drives)))
    rates = 10 * false[drawn].sum(axis=1) / np.maximum(walked_m[drawn].sum(axis=1), 1e-9)
    low, high = np.percentile(rates, (2.5, 97.5))
    return round(float(low), 3), round(float(high), 3)
