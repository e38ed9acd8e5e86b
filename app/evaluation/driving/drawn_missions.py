"""Campaigns that draw one mission from each seed: doors and crossings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from app.episode.episode import EpisodeSettings
from app.evaluation.campaign import Campaign, Fleet
from app.evaluation.suites import Suite
from navcore.config.navigator import config_for


def drive_drawn(
    suite: Suite,
    example: object,
    drive_one: Callable[..., dict[str, Any]],
    settings: EpisodeSettings,
    *,
    seeds: Iterable[int],
    fleet: Fleet,
    out: Path,
) -> list[dict[str, Any]]:
    """Return the reports of `drive_one(seed, settings)`, one a seed; those kept in `out` are not
    driven again if they were driven by the same rules. `example` is a drawn mission, one of the
    rules."""
    settings = replace(settings, config=settings.config or config_for(settings.robot))
    drive = partial(drive_one, settings=settings)
    campaign = Campaign(
        suite=suite,
        key="seed",
        rules=(
            str(suite),
            example,
            settings.beware.classes,
            settings.max_time_s,
            settings.robot,
            settings.config,
            settings.odometry,
            settings.latency,
            settings.camera,
        ),
        holds="another campaign, robot, beware list, odometry, latency, camera or time limit",
        drive=drive,
        drive_alone=drive,
    )
    return campaign.run(list(seeds), fleet=fleet, out=out)
