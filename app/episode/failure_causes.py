"""Why an episode failed, in a few words that many episodes can be sorted by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Report = Mapping[str, Any]
GOAL_RADIUS_M = 0.3
"""The robot must finally stand this near to a goal, judged from the ground truth."""
STOPS_FROM_S = 2.0
"""A stop at the end of an episode that is shorter than this is not why it ended."""


def causes_of(report: Report) -> list[str]:
    """The causes of a failure, the gravest first; empty for a success.

    `report` is one of the contract, with `contacts`, `intruded` and `ended`.
    """
    found = [
        f"drove into {contact['what']}" for contact in report["contacts"] if contact["collided"]
    ]
    found += [f"over {name}" for name in report["intruded"]]
    found += _over_zones(report)
    if report["goals_reached"] < len(report["goals"]):
        found.append(_why_not_there(report))
    return list(dict.fromkeys(found))


def count_causes(reports: Iterable[Report]) -> dict[str, list[int]]:
    """Gravest cause → the seeds of the episodes that failed by it, the most frequent cause first."""
    seeds: dict[str, list[int]] = {}
    for report in reports:
        if report["causes"]:
            seeds.setdefault(report["causes"][0], []).append(report["seed"])
    return dict(sorted(seeds.items(), key=lambda found: -len(found[1])))


def _over_zones(report: Report) -> list[str]:
    """Whether the robot drove into a zone, or kept off it by its odometry, which is all that it
    knows of where it is."""
    zones = [
        intrusion
        for intrusion in report["intrusions"]
        if intrusion["what"] not in report["intruded"]
    ]
    drifted = [
        "over a zone: odometry had drifted" if zone["gap_by_odometry_m"] > 0 else "over a zone"
        for zone in zones
    ]
    return sorted(drifted)


def _why_not_there(report: Report) -> str:
    """By how the episode ended: where the robot believed to be there, what held it at the end, else
    what held it longest."""
    if report["ended"] == "all goals":
        # Nothing tells the robot where it is but its own odometry, so that after a long way it can
        # be right by that and wrong.
        by_odometry = report["goal_errors_by_odometry_m"]
        missed = [
            goal for goal, error_m in report["goal_errors_m"].items() if error_m > GOAL_RADIUS_M
        ]
        if missed and all(by_odometry[goal] <= GOAL_RADIUS_M for goal in missed):
            return "goal missed: odometry had drifted"
        return "goal missed: it stopped beside it"
    stops: Sequence[Mapping[str, Any]] = report["stops"]
    if not stops:
        return "goal not reached: out of time"
    last = stops[-1]
    if (
        last["duration_s"] >= STOPS_FROM_S
        and last["t_s"] + last["duration_s"] >= report["sim_time_s"] - STOPS_FROM_S
    ):
        return f"goal not reached: {last['reason']}"
    held_s: Counter[str] = Counter()
    for stop in stops:
        held_s[stop["reason"]] += stop["duration_s"]
    reason, seconds = held_s.most_common(1)[0]
    share = seconds / max(report["sim_time_s"], 1e-9)
    return (
        f"goal not reached: {reason}, again and again"
        if share > 0.25
        else "goal not reached: out of time"
    )
