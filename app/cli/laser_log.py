"""`bewarenav laser-log`: localisation follows a log of a real laser scanner."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import prepare
from navcore.files import write_whole


@dataclass(frozen=True, slots=True, kw_only=True)
class LaserLogSettings:
    """The argument and the options of the command."""

    log: Annotated[
        Path, typer.Argument(metavar="FILE", help="Log in CARMEN's format, FLASER and ODOM lines.")
    ]
    relations: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Relations between poses, to judge the poses by."),
    ] = None
    view: Annotated[
        float, typer.Option(min=20.0, max=180.0, help="Angle of view that is used, degrees.")
    ] = 180.0
    range_m: Annotated[
        float, typer.Option("--range", min=2.0, max=100.0, help="Largest range, metres.")
    ] = 15.0
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write laser-log.json and a picture of the map here."),
    ] = None


def laser_log(settings: LaserLogSettings) -> None:
    """Let localisation follow a log of a real laser scanner in a new map, and compare the poses
    with relations that people have measured."""
    import numpy as np
    from rich.console import Console as Terminal
    from rich.progress import Progress

    from app.evaluation.laser_log.carmen_log import load_carmen_log, load_relations
    from app.evaluation.laser_log.run import (
        drive_of,
        follow_log,
        laser_config,
        picture_of,
        relation_errors,
    )
    from app.runtime.record.provenance import command_line, machine, version

    if settings.out is not None:
        prepare(settings.out)
    log = load_carmen_log(settings.log)
    relations = () if settings.relations is None else load_relations(settings.relations, log)
    drive = drive_of(log, view_rad=math.radians(settings.view), range_m=settings.range_m)
    with Progress(console=Terminal(stderr=True)) as bar:
        task = bar.add_task("scans", total=len(drive))
        followed = follow_log(
            drive, laser_config(), on_progress=lambda done: bar.update(task, completed=done)
        )
    report = {
        "command": command_line(),
        "version": version(),
        "machine": machine(),
        "file": settings.log.name,
        "view_deg": settings.view,
        "range_m": settings.range_m,
        "scans": len(drive),
        "loops": followed.loops,
        "located_share": round(followed.located_share, 4),
        "p50_ms": round(1e3 * float(np.median(followed.durations_s)), 2),
        "p99_ms": round(1e3 * float(np.percentile(followed.durations_s, 99)), 2),
    }
    typer.echo(
        f"{len(drive)} scans, {followed.loops} loops closed, located at "
        f"{followed.located_share:.0%} of the scans, {report['p50_ms']} ms a scan"
    )
    if relations:
        report["relations"] = len(relations)
        for name, poses in (
            ("localisation", followed.poses), ("as logged", log.logged), ("odometry", log.odometry)
        ):  # fmt: skip
            report[name] = errors = relation_errors(poses, relations)
            typer.echo(
                f"{name:>12}: {errors['m_mean']:.3f} ± {errors['m_std']:.3f} m (median "
                f"{errors['m_median']:.3f}), {errors['deg_mean']:.2f} ± {errors['deg_std']:.2f}° "
                f"over {len(relations)} relations"
            )
    if settings.out is not None:
        write_whole(settings.out / "laser-log.json", json.dumps(report, indent=1).encode())
        write_whole(settings.out / "laser-log.png", picture_of(drive, followed.poses))
