"""Kinds of results, by their suites and by what sets them apart from the usual robot."""

from __future__ import annotations

from collections.abc import Callable

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


def is_of(*suites: Suite) -> Callable[[Result], bool]:
    """Return what tells whether a result is of one of some suites."""
    return lambda result: result["suite"] in suites


def is_before(result: Result) -> bool:
    """Return whether a result is of a network before the one that ships, which it shall be compared
    with."""
    shipped = f"network sha256 {shipped_sha256()},"
    return result["suite"] == Suite.LIGHT and shipped not in result["segmenter"]


def is_second_day(result: Result) -> bool:
    """Return whether a result is of missions in a kept map."""
    return result.get("map") == "kept"


def departures(result: Result) -> dict[str, str]:
    """Return by key the values in which a campaign departs from one without options: people who
    yield, another receiver than that of the world, and what differs from `USUAL`."""
    people = result.get("people", "none")
    told = {**result, "people": people if "yield" in people else USUAL["people"]}
    usual = USUAL | {"gnss": _gnss_of(result["scenario"])}
    return {key: told[key] for key, value in usual.items() if told.get(key, value) != value}


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
        "paper" if result["suite"] == Suite.GIVEN else "",
        "second-day" if is_second_day(result) else "",
        *("scanner" if key == "scanner" else f"{key}-{value}" for key, value in own.items()),
        "before" if is_before(result) else "",
        f"localisation-{result['odometry']}" if is_localisation else "",
        "" if size == CameraStream().size else "{}x{}".format(*size),
    )
    return "-".join(filter(None, (result["scenario"], *kinds))).replace(" ", "-")
