"""`bewarenav plan`: one path on a stored map, printed, as JSON and as an image."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import finite_point, prepare
from navcore.errors import BadConfiguration
from navcore.files import write_whole


class Unknown(StrEnum):
    """What the unknown cells of a map count as."""

    FREE = "free"
    BLOCKED = "blocked"


PointOption = typer.Option(metavar="X,Y", help="Metres (Nav2) or column,row (MovingAI).")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSettings:
    """The options of the command."""

    map_file: Annotated[
        Path,
        typer.Option("--map", metavar="MAP.yaml|MAP.map", help="A Nav2 map or a MovingAI map."),
    ]
    start: Annotated[str, PointOption]
    goal: Annotated[str, PointOption]
    width: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="Width of the robot; 0.7 (Husky) if left out, 0 on a MovingAI map."
        ),
    ] = None
    margin: Annotated[
        float | None,
        typer.Option(metavar="M", help="Margin beyond half the width; 0.15, on a MovingAI map 0."),
    ] = None
    unknown: Annotated[Unknown, typer.Option(help="What unknown cells of a Nav2 map count as.")] = (
        Unknown.FREE
    )
    nearest: Annotated[
        bool,
        typer.Option(
            "--nearest", help="If the goal is unreachable, plan to the nearest reachable cell."
        ),
    ] = False
    out: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the plan here.")] = (
        None
    )
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw map and path here.")
    ] = None


def plan(settings: PlanSettings) -> None:
    """Plan the shortest path on a stored map; exit code 0 with a path, 1 without one."""
    from app.map_planner.query import as_report, ask, in_words
    from app.map_planner.stored_map import files_of, open_map

    ends = finite_point(settings.start, "--start"), finite_point(settings.goal, "--goal")
    for file in (settings.out, settings.picture):
        if file is not None:
            prepare(file.parent)
    plan_map = open_map(
        settings.map_file,
        width=settings.width,
        margin=settings.margin,
        unknown_blocked=settings.unknown is Unknown.BLOCKED,
    )
    inputs = {file.resolve() for file in files_of(settings.map_file)}
    for option, file in (("--out", settings.out), ("--picture", settings.picture)):
        if file is not None and file.resolve() in inputs:
            raise BadConfiguration(f"{option} {file}: is a file of the map; give another name")
    if plan_map.unit == "cells" and not all(number.is_integer() for end in ends for number in end):
        raise BadConfiguration("--start and --goal on a MovingAI map are column,row: whole numbers")
    answer = ask(plan_map, *ends, nearest=settings.nearest)
    if settings.out is not None:
        write_whole(settings.out, json.dumps(as_report(plan_map, answer), indent=1).encode())
    words = in_words(plan_map, answer)
    if settings.picture is not None:
        from app.map_planner.plot import draw_plan

        write_whole(settings.picture, draw_plan(plan_map, answer, title=words[-1]))
    typer.echo("\n".join(words))
    sys.exit(0 if answer.reached is not None else 1)
