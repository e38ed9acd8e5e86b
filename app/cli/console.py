"""`bewarenav console`: the operator console."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import typer

from app.cli.options import (
    LevelOption,
    NavigationOption,
    PriorOption,
    SavedMapOption,
    ScenarioOption,
    SeedOption,
    SegmenterOptions,
    prepare,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsoleSettings:
    """The options of the command."""

    scenario: ScenarioOption = "office"
    recording: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Play a recording, as for `replay`, instead of the simulated robot."
        ),
    ] = None
    level: LevelOption = False
    host: Annotated[
        str, typer.Option(help="Address to listen on; any but loopback requires a login.")
    ] = "127.0.0.1"
    port: Annotated[int, typer.Option(min=1, max=65535, help="TCP port to listen on.")] = 8000
    data: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the zones, the beware list and the runs.")
    ] = Path("data")
    seed: SeedOption = 0
    segmentation: SegmenterOptions = field(default_factory=SegmenterOptions)
    prior: PriorOption = None
    kept: SavedMapOption = None
    navigation: NavigationOption = None
    login: Annotated[bool, typer.Option("--login", help="Require a login on loopback too.")] = False
    unattended: Annotated[
        Literal["go on", "pause"],
        typer.Option(help="What a mission does when the operator in control has gone silent."),
    ] = "go on"


def console(settings: ConsoleSettings) -> None:
    """Start the operator console with the simulated robot, or with a recording."""
    from web.port import reserve

    listener = reserve(settings.host, settings.port)  # before the slow imports
    from app.console.application import ConsoleOptions, run_console

    if settings.kept is not None:
        prepare(settings.kept.parent)
    options = ConsoleOptions(
        scenario=settings.scenario,
        recording=settings.recording,
        level=settings.level,
        host=settings.host,
        port=settings.port,
        data=settings.data,
        seed=settings.seed,
        choice=settings.segmentation.choice(live=True),
        prior=settings.prior,
        kept=settings.kept,
        navigation=settings.navigation,
        login=settings.login,
        unattended=settings.unattended,
    )
    run_console(options, listener=listener)
