"""Where the figures of a summary come from: its first keys, the same in every suite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.evaluation.suites import Suite
from app.runtime.record.provenance import command_line, machine, version

Report = Mapping[str, Any]
SETUP = (
    *("robot", "segmenter", "ablation", "odometry", "gnss", "latency", "people", "camera"),
    *("scanner", "map"),
)
"""Keys of an episode's report whose value all episodes of a campaign share."""


def origin_here(suite: Suite, *, segmenter: str, scenario: str | None = None) -> dict[str, Any]:
    """Return the origin of figures that this process makes by itself; `scenario` is the name of
    what is measured, by default that of the suite."""
    return _origin(suite, command_line(), scenario, segmenter, [version()], [machine()])


def origin_of(
    suite: Suite,
    command: str,
    reports: Sequence[Report],
    *,
    segmenter: str,
    scenario: str | None = None,
    key: str = "seed",
) -> dict[str, Any]:
    """Return the origin of a campaign whose command has made these reports; `key` is what tells
    its episodes apart."""
    versions, machines = (
        sorted({report[one] for report in reports}) for one in ("version", "machine")
    )
    episodes = {"episodes": len(reports), f"{key}s": [report[key] for report in reports]}
    return _origin(suite, command, scenario, segmenter, versions, machines) | episodes


def origin_of_drives(
    suite: Suite,
    command: str,
    reports: Sequence[Report],
    *,
    scenario: str | None = None,
    key: str = "seed",
) -> dict[str, Any]:
    """Return the origin of a campaign of episodes, with all that these share."""
    setup = {name: reports[0][name] for name in SETUP}
    segmenter = setup["segmenter"]
    origin = origin_of(suite, command, reports, segmenter=segmenter, scenario=scenario, key=key)
    return origin | setup


def _origin(
    suite: Suite,
    command: str,
    scenario: str | None,
    segmenter: str,
    versions: list[str],
    machines: list[str],
) -> dict[str, Any]:
    return {
        "command": command,
        "suite": str(suite),
        "scenario": scenario or str(suite),
        "segmenter": segmenter,
        "versions": versions,
        "machines": machines,
    }
