"""Command-line options that several commands share, and how a dataclass becomes options.

A command with many options takes one frozen dataclass, whose fields are `Annotated` with their
`typer.Option`; `takes_options` turns the fields into the parameters that typer shows. Nothing here
imports a slow package.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, get_type_hints

import typer

from app.episode.ablations import Ablation
from app.runtime.start.segmenter_choice import Backend, Kind, SegmenterChoice
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import BewareList, default_beware_list
from navcore.mission.beware_sets import beware_list_of
from navcore.robot.camera_stream import CameraStream, stream_of
from sim.robot.odometry_grade import OdometryGrade
from sim.sensors.gnss_settings import GnssKind

if TYPE_CHECKING:
    from app.fleet.engine import Engine
    from navcore.robot.profile import RobotProfile
    from sim.scenario.schema import Scenario

Settings = TypeVar("Settings")

ScenarioOption = Annotated[
    str,
    typer.Option("--scenario", metavar="NAME|FILE.toml", help="A built-in world or a world file."),
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same run.")]
PriorOption = Annotated[
    Path | None,
    typer.Option(
        "--prior",
        metavar="MAP.yaml",
        help="A Nav2 map; its obstacles count until the camera sees their floor free.",
    ),
]
NavigationOption = Annotated[
    Path | None,
    typer.Option(
        "--navigation",
        metavar="FILE.toml",
        help="Navigation parameters that differ from the defaults.",
    ),
]
LevelOption = Annotated[
    bool,
    typer.Option(
        "--level",
        help="The recording's world frame has z up and the floor at z = 0: do not search for it.",
    ),
]
OdometryOption = Annotated[
    OdometryGrade,
    typer.Option("--odometry", help="How good the simulated robot's odometry is."),
]
GnssOption = Annotated[
    GnssKind | None,
    typer.Option(
        "--gnss", help="GNSS receiver of the simulated robot; that of the world when left out."
    ),
]
SavedMapOption = Annotated[
    Path | None,
    typer.Option(
        "--map",
        metavar="FILE",
        help="The map of an earlier session: loaded if the file exists, saved there at the end.",
    ),
]
CameraOption = Annotated[
    str | None,
    typer.Option(
        "--camera",
        metavar="WxH[@HZ][+colour]",
        help="Image size and rate of the depth camera: 424x240, 640x480 or 848x480, at 10, 15, 30 "
        "or 60 images a second, e.g. 848x480@15, and +colour for a colour lens of its own; as in "
        "the robot's profile when left out.",
    ),
]
RobotOption = Annotated[
    str,
    typer.Option(
        "--robot",
        metavar="husky|jackal|FILE.toml",
        help="The robot, or a profile of your own; the simulator models husky and jackal.",
    ),
]
ScannerOption = Annotated[
    bool,
    typer.Option(
        "--scanner",
        help="The robot carries a laser scanner that sees people all round, not only ahead.",
    ),
]
LatencyOption = Annotated[
    str,
    typer.Option(
        "--latency",
        metavar="live|MS|none",
        help="Time that a tick takes on the simulated clock: as measured in the console, so many "
        "milliseconds, or none.",
    ),
]
YieldingOption = Annotated[
    bool,
    typer.Option(
        "--yielding",
        help="People wait for the robot and turn back, where the world says so; else they walk on.",
    ),
]
BewareOption = Annotated[
    Path | None,
    typer.Option(
        "--beware",
        metavar="office|indoor|outdoor|FILE.toml",
        help="Beware list to drive with: a ready-made one by its name, or a file.",
    ),
]
RandomOption = Annotated[
    bool,
    typer.Option("--random", help="Draw a start and a reachable goal from each seed."),
]
ZonesOption = Annotated[
    int | None,
    typer.Option(
        "--zones",
        min=0,
        max=8,
        help="Number of zones that each seed draws across the path; 2 with --random.",
    ),
]
AblationOption = Annotated[
    Ablation,
    typer.Option(
        "--ablation",
        help="Leave a part of the navigation out, or label images by the simulator's truth.",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmenterOptions:
    """The options that choose the segmenter."""

    segmenter: Annotated[
        Kind,
        typer.Option(
            "--segmenter",
            help="The network, the colour rules alone, or the network where it runs.",
        ),
    ] = "auto"
    weights: Annotated[
        Path | None,
        typer.Option(
            "--weights",
            metavar="FILE.safetensors|FILE.onnx",
            help="A network other than the shipped one.",
        ),
    ] = None
    backend: Annotated[
        Backend,
        typer.Option(
            "--backend",
            help="Engine of the network; `auto` takes the fastest accurate one, `torch` is the "
            "bit-exact reference.",
        ),
    ] = "auto"

    def choice(self, *, live: bool = False, camera: CameraStream | None = None) -> SegmenterChoice:
        """Return the segmenter to compose; `live` where the world does not wait for it. Weights of
        the user's own may follow the image size of the camera, the shipped ones have their own.

        Raises `BadConfiguration` for weights beside the colour rules, and for a name or a file that
        is not that of a network: what follows is slow."""
        if self.weights is not None:
            if self.segmenter == "colour":
                raise BadConfiguration(
                    "--weights with --segmenter colour: the colour rules have no weights; "
                    "leave one of them out"
                )
            from navcore.perception.esanet.inference.network_file import check_name

            check_name(self.weights)
        follows = camera if camera is not None and self.weights is not None else CameraStream()
        return SegmenterChoice(
            kind=self.segmenter,
            weights=self.weights,
            engine=self.backend,
            live=live,
            camera=follows.size,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineOptions:
    """The options that say where tasks are done."""

    workers: Annotated[int, typer.Option(min=1, max=256, help="Tasks done in parallel.")] = 1
    engine: Annotated[
        Literal["local", "ray"],
        typer.Option(help="Processes of this machine, or a Ray cluster with a worker a CPU."),
    ] = "local"
    address: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT|auto",
            help="The Ray cluster; without it --engine ray starts one of --workers here.",
        ),
    ] = None

    def chosen(self, *, simulated_s: float = 0.0) -> Engine:
        """Return the engine for tasks of up to so many simulated seconds."""
        from app.fleet.local import Processes, ThisProcess, limit_for
        from app.fleet.ray_cluster import RayCluster

        limit_s = limit_for(simulated_s)
        if self.engine == "ray":
            return RayCluster(address=self.address, workers=self.workers, limit_s=limit_s)
        if self.address is not None:
            raise BadConfiguration("--address is for --engine ray")
        if self.workers == 1:
            return ThisProcess()
        return Processes(workers=self.workers, limit_s=limit_s)


def takes_options(command: Callable[[Settings], None]) -> Callable[..., None]:
    """Return `command`, which takes one dataclass of options, with their fields as parameters.

    A field whose type is a dataclass itself stands for the fields of that one, in its position.
    """
    (settings_type,) = (hint for name, hint in get_type_hints(command).items() if name != "return")

    @functools.wraps(command)
    def with_parameters(**values: Any) -> None:
        command(_filled(settings_type, values))

    parameters = list(_parameters(settings_type))
    with_parameters.__annotations__ = {one.name: one.annotation for one in parameters}
    with_parameters.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return with_parameters


def _parameters(settings_type: Any) -> Iterator[inspect.Parameter]:
    hints = get_type_hints(settings_type, include_extras=True)
    for option in dataclasses.fields(settings_type):
        hint = hints[option.name]
        if dataclasses.is_dataclass(hint):
            yield from _parameters(hint)
        else:
            missing = option.default is dataclasses.MISSING
            yield inspect.Parameter(
                option.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if missing else option.default,
                annotation=hint,
            )


def _filled(settings_type: Any, values: Mapping[str, Any]) -> Any:
    hints = get_type_hints(settings_type)
    return settings_type(
        **{
            option.name: _filled(hints[option.name], values)
            if dataclasses.is_dataclass(hints[option.name])
            else values[option.name]
            for option in dataclasses.fields(settings_type)
        }
    )


def beware_list(path: Path | None, world: Scenario | None = None) -> BewareList:
    """Return the beware list of a name or file, else the one that a world starts with, else the
    shipped one."""
    if path is not None:
        return beware_list_of(path)
    from sim.scenario.beware import starting_beware_list

    return default_beware_list() if world is None else starting_beware_list(world)


def camera_stream(text: str | None, default: CameraStream | None = None) -> CameraStream:
    """Return the stream of `--camera`, that of the profile when left out; raises
    `BadConfiguration`."""
    default = default or CameraStream()
    return default if text is None else stream_of(text, default)


def robot_profile(name_or_path: str, *, scanner: bool) -> RobotProfile:
    """Return the robot of `--robot`, with `--scanner` with a laser scanner if it has none; raises
    `BadConfiguration`, also for one that the safety gate could not stop in time."""
    from navcore.robot.laser_scan import ScannerMount
    from navcore.robot.profile import load_profile
    from navcore.safety.stopping import check_stopping

    robot = load_profile(name_or_path)
    check_stopping(robot)
    if not scanner:
        return robot
    return dataclasses.replace(robot, scanner=robot.scanner or ScannerMount())


def point(text: str, option: str) -> tuple[float, float]:
    """Parse an `X,Y` argument; raises `BadConfiguration` that names the option."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise BadConfiguration(f"{option} {text!r}: expected X,Y, e.g. 3.5,-2") from None
    return x, y


def finite_point(text: str, option: str) -> tuple[float, float]:
    """Parse an `X,Y` argument of two finite numbers of at most 1000 km; raises as `point` does."""
    x, y = point(text, option)
    if not (math.isfinite(x) and math.isfinite(y) and max(abs(x), abs(y)) <= 1e6):
        raise BadConfiguration(f"{option} {text!r}: expected two numbers from -1000000 to 1000000")
    return x, y


def check_data_folder(folder: Path, *, makes: bool = False) -> None:
    """Refuse a folder that no console has used: its name was mistyped. A command that `makes` one
    says so instead."""
    from app.storage.database import FILE

    if (folder / FILE).exists():
        return
    if not makes:
        raise BadConfiguration(f"--data: {folder} is no data folder of a console, it has no {FILE}")
    typer.echo(f"{folder} is a new data folder.", err=True)


def prepare(folder: Path) -> None:
    """Create a folder and refuse one that cannot be written, before the work and not after it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise BadConfiguration(f"{folder} cannot be written: {error.strerror or error}") from None
