"""What the commands share: options, points given as text, and places to write to. Imports nothing that takes a second."""

from __future__ import annotations

import math
import tempfile
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from navcore.beware import BewareList, default_beware_list, load_beware_list
from navcore.errors import BadConfiguration

PriorOption = Annotated[
    Path | None,
    typer.Option("--prior", metavar="MAP.yaml", help="A Nav2 map; its obstacles count until the camera sees their floor free."),
]
NavigationOption = Annotated[
    Path | None, typer.Option("--navigation", metavar="FILE.toml", help="How the navigation is set, where not as it comes.")
]
LevelOption = Annotated[
    bool, typer.Option("--level", help="The poses' world of a recording has z up and its floor at 0: look for none.")
]
KeptOption = Annotated[
    Path | None,
    typer.Option("--map", metavar="FILE", help="The map of an earlier session: loaded if it is there, kept there at the end."),
]

BewareOption = Annotated[Path | None, typer.Option("--beware", metavar="FILE.toml", help="Beware list to drive with.")]
RandomOption = Annotated[bool, typer.Option("--random", help="Each seed draws a start and a goal that can be reached.")]
ZonesOption = Annotated[
    int | None,
    typer.Option("--zones", min=0, max=8, help="The operator's zones that each seed draws across the way; 2 with --random."),
]


def beware_list(path: Path | None) -> BewareList:
    """Of a file, or the one that comes with the package."""
    return default_beware_list() if path is None else load_beware_list(path)


class Ablation(StrEnum):
    """What is different from the whole system."""

    NONE = "none"
    NO_SEMANTICS = "no-semantics"
    """Nothing of the beware list is ever seen: a robot with geometry alone."""
    NO_ZONES = "no-zones"
    """The operator's zones are not told to the robot; the referee judges by them all the same."""
    NO_LOCAL_PLANNER = "no-local-planner"
    """The path is followed directly, with no look at what stands near it; the gate before the wheels stays."""
    ORACLE = "oracle"
    """The simulator's own labels in the place of a segmenter's."""


AblationOption = Annotated[
    Ablation, typer.Option("--ablation", help="Leave a part of the navigation out, or give it the simulator's own labels.")
]


class BenchPart(StrEnum):
    """What `bench` can measure."""

    DRIVE = "drive"
    TICK = "tick"
    SEGMENT = "segment"
    PLAN = "plan"
    CONSOLE = "console"
    PAGE = "page"


def point(text: str, option: str) -> tuple[float, float]:
    """(x, y) of an `X,Y` argument; raises `BadConfiguration` with the option's name."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise BadConfiguration(f"{option} {text!r}: expected X,Y, e.g. 3.5,-2") from None
    return x, y


def finite_point(text: str, option: str) -> tuple[float, float]:
    """The same for a point that must be somewhere; NaN, infinity and more than 1000 km are nowhere."""
    x, y = point(text, option)
    if not (math.isfinite(x) and math.isfinite(y) and max(abs(x), abs(y)) <= 1e6):
        raise BadConfiguration(f"{option} {text!r}: expected two numbers from -1000000 to 1000000")
    return x, y


def prepare(folder: Path) -> None:
    """Refuse a place that cannot be written before the work is done, not after."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise BadConfiguration(f"{folder} cannot be written: {error.strerror or error}") from None
