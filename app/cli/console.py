"""`bewarenav console`: the operator console."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import typer

from app.cli.options import (
    GnssOption,
    LevelOption,
    NavigationOption,
    OdometryOption,
    PriorOption,
    RobotOption,
    ScannerOption,
    ScenarioOption,
    SeedOption,
    SegmenterOptions,
    camera_stream,
    prepare,
    robot_profile,
)
from navcore.errors import BadConfiguration
from navcore.files import is_there
from navcore.robot.camera_stream import CameraStream
from sim.robot.odometry_grade import OdometryGrade

HOST = re.compile(r"[A-Za-z0-9][A-Za-z0-9.-]{0,251}|\[[0-9A-Fa-f:.]+\]")
"""Name or address of a host, as in the address of a page."""
OwnMapOption = Annotated[
    Path | None,
    typer.Option(
        "--map",
        metavar="FILE",
        help="Keep the map in this file instead of the folder of the site; loaded if it exists.",
    ),
]


OwnListOption = Annotated[
    Path | None,
    typer.Option(
        "--beware",
        metavar="office|indoor|outdoor|FILE.toml",
        help="Put this beware list in force at the site, as one edit, a ready-made one or a file; "
        "earlier lists are kept.",
    ),
]


ConsoleCameraOption = Annotated[
    str,
    typer.Option(
        "--camera",
        metavar="auto|WxH[@HZ][+colour]",
        help="Image size and rate of the simulated camera: 424x240, 640x480 or 848x480, at 10, 15, "
        "30 or 60 images a second, e.g. 848x480@15, and +colour for a colour lens of its own; "
        "`auto` takes 848x480 where the machine is fast enough, else 424x240.",
    ),
]


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
        Path, typer.Option(metavar="DIR", help="Folder of the sites, the users and the runs.")
    ] = Path("data")
    site: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Site to use, made if it is new; else the one last used in this world.",
        ),
    ] = None
    seed: SeedOption = 0
    camera: ConsoleCameraOption = "auto"
    robot: RobotOption = "husky"
    scanner: ScannerOption = False
    segmentation: SegmenterOptions = field(default_factory=SegmenterOptions)
    prior: PriorOption = None
    kept: OwnMapOption = None
    beware: OwnListOption = None
    navigation: NavigationOption = None
    odometry: OdometryOption = OdometryGrade.TYPICAL
    gnss: GnssOption = None
    login: Annotated[bool, typer.Option("--login", help="Require a login on loopback too.")] = False
    allow_host: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A further name or address by which browsers reach the console, e.g. that of a "
            "proxy; repeat for more. Requires a login.",
        ),
    ] = None
    proxy: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="IP address of a TLS proxy before the console: its X-Forwarded-Proto and "
            "X-Forwarded-For count. Requires a login.",
        ),
    ] = None
    unattended: Annotated[
        Literal["go on", "pause"],
        typer.Option(help="What a mission does when the operator in control has gone silent."),
    ] = "go on"


def console(settings: ConsoleSettings) -> None:
    """Start the operator console with the simulated robot, or with a recording."""
    from web.port import reserve
    from web.starting import StartingPage

    # Before the slow imports: the page is there within a second.
    with (
        reserve(settings.host, settings.port) as listener,
        StartingPage(listener) as starting,
    ):
        camera = _check(settings)
        from app.console.application import ConsoleOptions, run_console
        from navcore.mission.beware_sets import beware_list_of

        options = ConsoleOptions(
            scenario=settings.scenario,
            recording=settings.recording,
            level=settings.level,
            host=settings.host,
            port=settings.port,
            data=settings.data,
            site=settings.site,
            seed=settings.seed,
            camera=camera,
            robot=robot_profile(settings.robot, scanner=settings.scanner),
            choice=settings.segmentation.choice(live=True, camera=camera),
            prior=settings.prior,
            kept=settings.kept,
            beware=None if settings.beware is None else beware_list_of(settings.beware),
            navigation=settings.navigation,
            odometry=settings.odometry,
            gnss=settings.gnss,
            login=settings.login,
            allowed_hosts=tuple(settings.allow_host or ()),
            proxy=settings.proxy,
            unattended=settings.unattended,
        )
        run_console(options, listener=listener, starting=starting)


def _check(settings: ConsoleSettings) -> CameraStream | None:
    """Refuse wrong options and files before anything slow is loaded; return the camera's stream,
    None for what this machine can follow."""
    from app.replay.recording import open_recording
    from app.storage.sites import checked_name
    from navcore.config.navigator import load_config
    from navcore.formats import nav2_map
    from navcore.mapping.storage import map_file
    from navcore.mission.beware_sets import beware_list_of
    from sim.robot.chassis import chassis_for
    from sim.scenario.load import load_scenario

    for name in settings.allow_host or ():
        if not HOST.fullmatch(name):
            raise BadConfiguration(f"--allow-host: {name!r} is no name of a host, such as r1.local")
    if settings.proxy is not None:
        try:
            ipaddress.ip_address(settings.proxy)
        except ValueError:
            raise BadConfiguration(
                f"--proxy: {settings.proxy!r} is no IP address, such as 127.0.0.1"
            ) from None
    if settings.site is not None:
        checked_name(settings.site)
    robot = robot_profile(settings.robot, scanner=settings.scanner)
    if settings.recording is not None:
        open_recording(settings.recording)
    else:
        load_scenario(settings.scenario, robot)
        chassis_for(robot)
    if settings.navigation is not None:
        load_config(settings.navigation, robot)
    if settings.beware is not None:
        beware_list_of(settings.beware)
    if settings.kept is not None:
        prepare(settings.kept.parent)
        if is_there(settings.kept):
            map_file.load(settings.kept)
    if settings.prior is not None:
        nav2_map.load(settings.prior)
    if settings.recording is not None and (settings.camera != "auto" or settings.scanner):
        option = "--scanner" if settings.scanner else "--camera"
        raise BadConfiguration(
            f"{option} is for the simulated robot; a recording has its own images"
        )
    camera = None if settings.camera == "auto" else camera_stream(settings.camera, robot.stream)
    settings.segmentation.choice(camera=camera)
    return camera
