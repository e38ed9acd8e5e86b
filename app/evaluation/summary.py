"""Summary of many episodes: rates and means with 95 % confidence intervals, as JSON and tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from scipy import stats

from app.episode.failure_causes import count_causes
from app.evaluation.origin import SETUP, Report
from navcore.errors import BadConfiguration
from navcore.robot.camera_stream import CameraStream

Measure = Callable[[Report], float]
Interval = tuple[float, float]
"""Lower and upper bound of a 95 % confidence interval."""

RESAMPLES = 4000
"""Number of bootstrap resamples."""

ZONE_RATE = "zone_rate"
"""The rate that is one of the episodes with zones alone."""
RATES: dict[str, tuple[str, Callable[[Report], bool]]] = {
    "success_rate": ("success", lambda report: report["success"]),
    "goals_rate": (
        "all goals reached",
        lambda report: report["goals_reached"] == len(report["goals"]),
    ),
    "collision_rate": ("drove into something", lambda report: report["collisions"] > 0),
    "struck_rate": (
        "walked into while standing",
        lambda report: report["struck_while_standing"] > 0,
    ),
    "beware_rate": ("over an item or a marking", lambda report: report["beware_intrusions"] > 0),
    ZONE_RATE: ("over a zone", lambda report: report["zone_intrusions"] > 0),
    "ground_rate": (
        "over an edge or a steep slope, or fell",
        # Reports of earlier versions do not judge the ground.
        lambda report: report.get("ground_intrusions", 0) > 0 or report.get("fell", False),
    ),
}
"""Shares of the episodes: title in the tables, and whether a report counts."""
MEANS: dict[str, tuple[str, Measure]] = {
    # Reports of earlier versions weight by all goals that were reached, also over violations.
    "spl": ("SPL", lambda report: report["spl"] if report["success"] else 0.0),
    "ideal_spl": ("SPL of an ideal driver with this view", lambda report: _ideal_spl(report)),
    "distance_m": ("driven, m", lambda report: report["distance_m"]),
    "sim_time_s": ("time, s", lambda report: report["sim_time_s"]),
    "beware_intrusion_m2s": (
        "over items and markings, m²·s",
        lambda report: report["beware_intrusion_m2s"],
    ),
    "zone_intrusion_m2s": ("over zones, m²·s", lambda report: report["zone_intrusion_m2s"]),
    "explored_share": ("share of the floor seen", lambda report: report["explored_share"]),
    "explored_m3": ("explored volume, m³", lambda report: report["series"]["explored_m3"][-1]),
    "tick_ms_p99": ("p99 of a tick, ms", lambda report: report["tick_ms"]["p99"]),
    "real_time_factor": (
        "simulated by real time",
        lambda report: report["sim_time_s"] / report["wall_time_s"],
    ),
}
"""Means over the episodes: title in the tables, and the value of a report."""
TOTALS = (
    "collisions",
    "struck_while_standing",
    "beware_intrusions",
    "zone_intrusions",
    "ground_intrusions",
    "goals_reached",
)
ITEM_COUNTS = ("there", "seen", "not_passed", "missed", "false")
"""Counts of the objects of a class in a report."""
SAME = ("scenario", *SETUP)
"""Keys of a summary that say what was driven."""


def summarise(reports: Sequence[Report]) -> dict[str, Any]:
    """Return rates, means and totals as a JSON object.

    Each rate (Wilson interval) and mean (bootstrap interval, null for a single episode) has its
    interval under `…_ci95`.
    """
    summary: dict[str, Any] = {}
    with_zones = [report for report in reports if report["zones"]]
    for key, (_, holds) in RATES.items():
        # Where there is no zone none can be driven over.
        judged = with_zones if key == ZONE_RATE else reports
        number = sum(holds(report) for report in judged)
        summary |= {
            key: round(number / len(judged), 4) if judged else None,
            f"{key}_ci95": _rounded(rate_interval(number, len(judged)) if judged else None),
        }
    for key, (_, measure) in MEANS.items():
        values = [float(measure(report)) for report in reports]
        summary |= {
            key: round(sum(values) / len(values), 4),
            f"{key}_ci95": _rounded(mean_interval(values)),
        }
    clear = [
        report["min_clearance_m"] for report in reports if report["min_clearance_m"] is not None
    ]
    summary |= {key: sum(report.get(key, 0) for report in reports) for key in TOTALS}
    return summary | {
        "goals": sum(len(report["goals"]) for report in reports),
        "zones": sum(len(report["zones"]) for report in reports),
        "zone_episodes": len(with_zones),
        "goal_errors_m": _goal_errors_m(reports),
        "min_clearance_m": min(clear, default=None),
        "items": _items(reports),
        "failures": count_causes(reports),
        **({"first_days": _first_days(reports)} if reports[0]["map"] == "kept" else {}),
    }


def _first_days(reports: Sequence[Report]) -> dict[str, Any]:
    """Return how the kept maps were made, and in which the operator had to show the place."""
    days = {report["seed"]: report["first_day"] for report in reports}
    return {
        "came_back": sum(day["goals_reached"] == day["goals"] for day in days.values()),
        "map_error_m": [day["map_error_m"] for day in days.values()],
        "distance_m": round(sum(day["distance_m"] for day in days.values()), 1),
        "place_shown_seeds": [seed for seed, day in days.items() if day.get("place_shown")],
    }


def rate_interval(successes: int, trials: int) -> Interval:
    """Return Wilson's score interval of a rate, sound for few trials and for rates of 0 and 1."""
    interval = stats.binomtest(successes, trials).proportion_ci(
        confidence_level=0.95, method="wilson"
    )
    return float(interval.low), float(interval.high)


def mean_interval(values: Sequence[float]) -> Interval | None:
    """Return the seeded percentile bootstrap interval of a mean; None for fewer than two values."""
    if len(values) < 2:
        return None
    interval = stats.bootstrap(
        (values,),
        np.mean,
        n_resamples=RESAMPLES,
        confidence_level=0.95,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(interval.low), float(interval.high)


def tables_of(summary: Report) -> list[Table]:
    """Return the tables to print: measures, missed and false detections, and failure causes."""
    title = (
        f"{summary['scenario']}, {summary['robot']}, {summary['episodes']} episodes, "
        f"ablation {summary['ablation']}, latency {summary['latency']}, "
        f"people {summary['people']}, {summary['map']} map"
    )
    measures = Table("", "figure", "95 % interval", title=title)
    for key, (name, _) in [*RATES.items(), *MEANS.items()]:
        measures.add_row(name, _value(summary, key), _interval(summary, key))
    measures.add_row("least clearance, m", f"{summary['min_clearance_m']}", "")
    tables = [measures]
    if summary["items"]:
        found = Table(
            "class",
            "there",
            "seen ≤ 4 m",
            "of these missed",
            "false on the map",
            title="things to beware of",
        )
        for name, counts in summary["items"].items():
            found.add_row(name, *(str(counts[key]) for key in ITEM_COUNTS))
        tables.append(found)
    if summary["failures"]:
        causes = Table("cause, the gravest of each episode", "episodes", "seeds", title="failures")
        for cause, seeds in summary["failures"].items():
            causes.add_row(
                cause,
                str(len(seeds)),
                ", ".join(map(str, seeds[:12])) + (" …" if len(seeds) > 12 else ""),
            )
        tables.append(causes)
    return tables


def compare(folders: Sequence[Path]) -> Table:
    """Return a table with a column for each folder's `summary.json`; raises `BadConfiguration` for
    a folder without one."""
    summaries = [_read(folder) for folder in folders]
    table = Table(
        "", *(str(folder) for folder in folders), title="mean or share, and 95 % interval"
    )
    for key in (*SAME, "episodes"):
        table.add_row(key, *(str(summary[key]) for summary in summaries))
    for key, (name, _) in [*RATES.items(), *MEANS.items()]:
        table.add_row(
            name, *(f"{_value(summary, key)}  {_interval(summary, key)}" for summary in summaries)
        )
    table.add_row("failures", *(_causes(summary) for summary in summaries))
    if len({(summary["scenario"], str(summary["seeds"])) for summary in summaries}) > 1:
        table.caption = "Not the same episodes: worlds or seeds differ."
    return table


def _causes(summary: Report) -> str:
    return (
        "\n".join(f"{len(seeds)} × {cause}" for cause, seeds in summary["failures"].items())
        or "none"
    )


def _goal_errors_m(reports: Sequence[Report]) -> dict[str, list[float]]:
    """Return by goal the true distances at which the robot reported it reached."""
    errors_m: dict[str, list[float]] = {}
    for report in reports:
        for goal, error_m in report["goal_errors_m"].items():
            errors_m.setdefault(goal, []).append(error_m)
    return errors_m


def _items(reports: Sequence[Report]) -> dict[str, dict[str, int]]:
    total: dict[str, dict[str, int]] = {}
    for report in reports:
        for name, counts in report["items"].items():
            sums = total.setdefault(name, dict.fromkeys(ITEM_COUNTS, 0))
            for key, number in counts.items():
                sums[key] += number
    return dict(sorted(total.items()))


def _read(folder: Path) -> dict[str, Any]:
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise BadConfiguration(
            f"{folder} holds no summary.json of an evaluation: {error}"
        ) from None
    if isinstance(summary, dict):
        # All that earlier versions had; they did not judge the ground.
        earlier = {
            "ground_rate": None,
            "ground_rate_ci95": None,
            "odometry": "ideal",
            "gnss": "none",
            "latency": "none",
            "people": "yield",
            "map": "new",
            "scanner": "none",
        }
        summary = {**earlier, "camera": str(CameraStream()), **summary}
    missing = {*SAME, "episodes", "seeds", "failures", *RATES, *MEANS} - set(
        summary if isinstance(summary, dict) else ()
    )
    if missing:
        raise BadConfiguration(
            f"{folder}/summary.json: is of another suite or version, "
            f"{sorted(missing)[0]!r} is missing"
        )
    return dict(summary)


def _ideal_spl(report: Report) -> float:
    """Return the SPL of the informed baseline, which makes no mistakes but knows only what the
    camera has seen; 0 without a path, and in reports older than this measure."""
    shortest_m, ideal_m = report["shortest_m"], report.get("ideal_m")
    return (
        0.0
        if shortest_m is None or ideal_m is None
        else float(shortest_m / max(ideal_m, shortest_m))
    )


def _rounded(interval: Interval | None) -> list[float] | None:
    return None if interval is None else [round(bound, 4) for bound in interval]


def _value(summary: Report, key: str) -> str:
    value = summary[key]
    return "–" if value is None else f"{value:.1%}" if key in RATES else f"{value:.3g}"


def _interval(summary: Report, key: str) -> str:
    interval = summary[f"{key}_ci95"]
    if interval is None:
        return ""
    low, high = (f"{bound:.1%}" if key in RATES else f"{bound:.3g}" for bound in interval)
    return f"{low} to {high}"
