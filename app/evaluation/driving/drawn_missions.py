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

EXAMPLES = range(100)
"""Seeds whose missions tell two ways of drawing apart."""


def drive_drawn(
    suite: Suite,
    missions: object,
    drive_one: Callable[..., dict[str, Any]],
    settings: EpisodeSettings,
    *,
    seeds: Iterable[int],
    fleet: Fleet,
    out: Path,
) -> list[dict[str, Any]]:
    """Return the reports of `drive_one(seed, settings)`, one a seed; those kept in `out` are not
    driven again if they were driven by the same rules. `missions` is one of the rules: what
    `EXAMPLES` draw, so that no constant is missed by which they do, their world, and how they are
    judged."""
    settings = replace(settings, config=settings.config or config_for(settings.robot))
    drive = partial(drive_one, settings=settings)
    campaign = Campaign(
        suite=suite,
        key="seed",
        rules=(
            str(suite),
            missions,
            settings.beware.classes,
            settings.max_time_s,
            settings.robot,
            settings.config,
            settings.odometry,
            settings.latency,
            settings.camera,
        ),
        holds="another campaign, other missions, another robot, beware list, configuration, "
        "odometry, latency, camera or time limit",
        drive=drive,
        drive_alone=drive,
    )
    return campaign.run(list(seeds), fleet=fleet, out=out)
