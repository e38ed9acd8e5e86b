"""Causes for which episodes failed, as short texts to group episodes by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Report = Mapping[str, Any]
"""Episode report, a JSON object."""
GOAL_RADIUS_M = 0.3
"""Largest true distance to a reached goal, metres."""
STOPS_FROM_S = 2.0
"""Shortest stop at the end of an episode that counts as its cause, seconds."""
FREQUENT_SHARE = 0.25
"""Share of the episode's time above which the longest stop reason counts as its cause."""


def causes_of(report: Report) -> list[str]:
    """Return the causes of a failure, the most severe first; empty for a success."""
    found = ["fell"] if report.get("fell") else []
    found += [
        f"drove into {contact['what']}" for contact in report["contacts"] if contact["collided"]
    ]
    # Reports of earlier versions do not judge the ground.
    found += [f"over {name}" for name in (*report["intruded"], *report.get("ground_intruded", ()))]
    found += _over_zones(report)
    if report["goals_reached"] < len(report["goals"]):
        found.append(_why_not_there(report))
    return list(dict.fromkeys(found))


def count_causes(reports: Iterable[Report]) -> dict[str, list[int]]:
    """Return the seeds of the failed episodes by their most severe cause, most frequent first."""
    seeds: dict[str, list[int]] = {}
    for report in reports:
        if report["causes"]:
            seeds.setdefault(report["causes"][0], []).append(report["seed"])
    return dict(sorted(seeds.items(), key=lambda found: -len(found[1])))


def _over_zones(report: Report) -> list[str]:
    """Return whether the robot entered a zone, and whether it stayed out by its odometry."""
    zones = [
        intrusion
        for intrusion in report["intrusions"]
        if intrusion["what"] not in {*report["intruded"], *report.get("ground_intruded", ())}
    ]
    drifted = [
        "over a zone: odometry had drifted" if zone["gap_by_odometry_m"] > 0 else "over a zone"
        for zone in zones
    ]
    return sorted(drifted)


def _why_not_there(report: Report) -> str:
    """Return why a goal was not reached: a drifted position or one that was lost, the last stop or
    the longest one."""
    if report["ended"] == "all goals":
        by_estimate = report["goal_errors_by_estimate_m"]
        missed = [
            goal for goal, error_m in report["goal_errors_m"].items() if error_m > GOAL_RADIUS_M
        ]
        if missed and all(by_estimate[goal] <= GOAL_RADIUS_M for goal in missed):
            return "goal missed: the estimated position had drifted"
        return "goal missed: it stopped beside it"
    if report["ended"] == "position lost":
        return "goal not reached: the position was lost"
    stops: Sequence[Mapping[str, Any]] = report["stops"]
    if not stops:
        return "goal not reached: out of time"
    last = max(stops, key=lambda stop: stop["until_s"])
    if (
        last["duration_s"] >= STOPS_FROM_S
        and last["until_s"] >= report["sim_time_s"] - STOPS_FROM_S
    ):
        return f"goal not reached: {last['reason']}"
    held_s: Counter[str] = Counter()
    for stop in stops:
        held_s[stop["reason"]] += stop["duration_s"]
    reason, seconds = held_s.most_common(1)[0]
    share = seconds / max(report["sim_time_s"], 1e-9)
    return (
        f"goal not reached: {reason}, again and again"
        if share > FREQUENT_SHARE
        else "goal not reached: out of time"
    )
