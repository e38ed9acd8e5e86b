"""Campaigns that draw one mission from each seed: doors and crossings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

from app.episode.latency import Latency
from app.evaluation.campaign import Campaign, Fleet
from app.runtime.record.provenance import command_line
from navcore.config.navigator import NavigatorConfig
from navcore.mission.beware_list import BewareList
from navcore.robot.camera_stream import CameraStream
from sim.robot.odometry_grade import OdometryGrade


def drive_drawn(
    suite: str,
    example: object,
    drive_one: Callable[..., dict[str, Any]],
    *,
    seeds: Iterable[int],
    fleet: Fleet,
    out: Path,
    beware: BewareList,
    max_time_s: float,
    config: NavigatorConfig | None,
    odometry: OdometryGrade,
    latency: Latency,
    camera: CameraStream | None,
) -> list[dict[str, Any]]:
    """Return the reports of `drive_one(seed, …)`, one a seed; those kept in `out` are not driven
    again if they were driven by the same rules. `example` is a drawn mission, one of the rules."""
    config = config or NavigatorConfig()
    drive = partial(
        drive_one,
        beware=beware,
        max_time_s=max_time_s,
        config=config,
        odometry=odometry,
        latency=latency,
        camera=camera,
    )
    campaign = Campaign(
        suite=suite,
        key="seed",
        rules=(suite, example, beware.classes, max_time_s, config, odometry, latency, camera),
        holds="another campaign, beware list, odometry, latency, camera or time limit",
        drive=drive,
        drive_alone=drive,
    )
    return campaign.run(list(seeds), fleet=fleet, out=out)


def origin_of(suite: str, reports: list[dict[str, Any]]) -> dict[str, Any]:
    """Return how the reports came about, as a JSON object."""
    return {
        "command": command_line(),
        "scenario": suite,
        **{key: reports[0][key] for key in ("segmenter", "odometry", "gnss", "latency", "people")},
        "versions": sorted({report["version"] for report in reports}),
        "machines": sorted({report["machine"] for report in reports}),
        "episodes": len(reports),
        "seeds": [report["seed"] for report in reports],
    }
