"""Kinds of results, by their suites and by what sets them apart from the usual robot."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from app.evaluation.suites import Suite
from app.evaluation.tables.table import Result
from app.runtime.record.provenance import shipped_sha256
from navcore.robot.camera_stream import CameraStream
from navcore.robot.profile import HUSKY
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.load import load_scenario, scenario_names

USUAL = {
    "robot": HUSKY.name,
    "ablation": "none",
    "odometry": str(OdometryGrade.TYPICAL),
    "latency": "live",
    "camera": str(CameraStream()),
    "people": "walk on",
    "scanner": "none",
}
"""Values that a campaign has without options."""
TOLD = ("zones", "max-time", "navigation", "beware")
"""Options that change what is driven and that only the command of a campaign tells."""
COLOUR = "colour rules"
"""What begins the segmenter of missions that no network sees."""


def is_of(*suites: Suite) -> Callable[[Result], bool]:
    """Return what tells whether a result is of one of some suites."""
    return lambda result: result["suite"] in suites


def is_before(result: Result) -> bool:
    """Return whether a result is of a network before the one that ships, which it shall be compared
    with."""
    shipped = f"network sha256 {shipped_sha256()},"
    return result["suite"] == Suite.LIGHT and shipped not in result["segmenter"]


def is_paper(result: Result) -> bool:
    """Return whether a result is of a mission of the paper."""
    return result["suite"] == Suite.GIVEN and "experiment" in _options(result)


def _options(result: Result) -> dict[str, str]:
    """Return the options of a result's command with their values, the names of files without their
    folders."""
    words = shlex.split(result.get("command", "").replace("=", " "))
    return {
        word.removeprefix("--"): Path(value).name.removesuffix(".toml")
        for word, value in pairwise(words)
        if word.startswith("--")
    }


def is_second_day(result: Result) -> bool:
    """Return whether a result is of missions in a kept map."""
    return result.get("map") == "kept"


def departures(result: Result) -> dict[str, str]:
    """Return by key the values in which a campaign departs from one without options: people who
    yield, another receiver than that of the world, missions without a network, what differs from
    `USUAL`, and the options of `TOLD`."""
    people = result.get("people", "none")
    told = {**result, "people": people if "yield" in people else USUAL["people"]}
    usual = USUAL | {"gnss": _gnss_of(result["scenario"])}
    own = {key: told[key] for key, value in usual.items() if told.get(key, value) != value}
    if result["suite"] in (Suite.RANDOM, Suite.GIVEN) and result["segmenter"].startswith(COLOUR):
        own["segmenter"] = COLOUR
    return own | {key: value for key, value in _options(result).items() if key in TOLD}


def _gnss_of(world: str) -> str:
    """Return the GNSS receiver that a shipped world gives its robot; `none` for other worlds."""
    receiver = load_scenario(world).gnss if world in scenario_names() else None
    return "none" if receiver is None else receiver.kind


def file_name(result: Result) -> str:
    """Return the name of the file of a result, without its suffix."""
    own, is_localisation = departures(result), result["suite"] == Suite.LOCALISATION
    if is_localisation:
        own.pop("odometry", None)
    size = tuple(result.get("images", CameraStream().size))
    kinds = (
        "paper" if is_paper(result) else "given" if result["suite"] == Suite.GIVEN else "",
        "second-day" if is_second_day(result) else "",
        *("scanner" if key == "scanner" else f"{key}-{value}" for key, value in own.items()),
        "before" if is_before(result) else "",
        f"localisation-{result['odometry']}" if is_localisation else "",
        "" if size == CameraStream().size else "{}x{}".format(*size),
    )
    return "-".join(filter(None, (result["scenario"], *kinds))).replace(" ", "-")
