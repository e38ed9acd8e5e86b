"""`bewarenav plan`: one path on a stored map, as figures, as JSON and as a picture."""

from __future__ import annotations

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import finite_point, prepare
from navcore.errors import BadConfiguration
from navcore.files import write_whole


class Unknown(StrEnum):
    """What cells count as of which the map knows nothing."""

    FREE = "free"
    BLOCKED = "blocked"


PointOption = typer.Option(metavar="X,Y", help="Metres (Nav2) or column,row (MovingAI).")


def plan(
    map_file: Annotated[
        Path,
        typer.Option("--map", metavar="MAP.yaml|MAP.map", help="A Nav2 map or a MovingAI map."),
    ],
    start: Annotated[str, PointOption],
    goal: Annotated[str, PointOption],
    width: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="Width of the robot; else the Husky's 0.7, on a MovingAI map 0."
        ),
    ] = None,
    margin: Annotated[
        float | None,
        typer.Option(metavar="M", help="Beyond half the width; else 0.15, on a MovingAI map 0."),
    ] = None,
    unknown: Annotated[
        Unknown, typer.Option(help="What unknown cells of a Nav2 map count as.")
    ] = Unknown.FREE,
    nearest: Annotated[
        bool,
        typer.Option("--nearest", help="If the goal cannot be reached, go as near as one can."),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the plan here.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw map and path here.")
    ] = None,
) -> None:
    """Plan the shortest path on a stored map; exit code 0 with a path, 1 without one."""
    from app.map_planner.query import as_report, ask, in_words
    from app.map_planner.stored_map import open_map

    ends = finite_point(start, "--start"), finite_point(goal, "--goal")
    for file in (out, picture):
        if file is not None:
            prepare(file.parent)
    plan_map = open_map(
        map_file, width=width, margin=margin, unknown_blocked=unknown is Unknown.BLOCKED
    )
    if plan_map.unit == "cells" and not all(number.is_integer() for end in ends for number in end):
        raise BadConfiguration("--start and --goal on a MovingAI map are column,row: whole numbers")
    answer = ask(plan_map, *ends, nearest=nearest)
    if out is not None:
        write_whole(out, json.dumps(as_report(plan_map, answer), indent=1).encode())
    words = in_words(plan_map, answer)
    if picture is not None:
        from app.map_planner.plot import draw_plan

        write_whole(picture, draw_plan(plan_map, answer, title=words[-1]))
    typer.echo("\n".join(words))
    sys.exit(0 if answer.reached is not None else 1)
