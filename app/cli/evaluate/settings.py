"""Argument and options of `bewarenav evaluate`, the names of its suites, and which options go with
which suite."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import typer

from app.cli.options import (
    AblationOption,
    BewareOption,
    CameraOption,
    EngineOptions,
    GnssOption,
    LatencyOption,
    NavigationOption,
    OdometryOption,
    RandomOption,
    RobotOption,
    ScannerOption,
    SegmenterOptions,
    YieldingOption,
    ZonesOption,
    camera_stream,
    robot_profile,
)
from app.episode.ablations import Ablation
from app.evaluation.suites import BARN_SUITES, BY_NAME, VIEWING, Suite
from navcore.errors import BadConfiguration
from navcore.robot.camera_stream import CameraStream
from navcore.robot.profile import RobotProfile
from sim.robot.odometry_grade import OdometryGrade

PAPER = "paper"
"""Argument for the paper's missions, whose worlds `--experiment` names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateSettings:
    """The argument and the options of the command."""

    suite: Annotated[
        str,
        typer.Argument(
            help="A scenario, e.g. office, or a world file; or one of the suites barn, dynabarn, "
            "crossings, unseen-crossings, doors, finding, light, localisation, one-click, prints, "
            "table-tops, teaching and paper."
        ),
    ]
    experiment: Annotated[
        Literal["indoor", "forest"] | None,
        typer.Option(help="Experiment of the paper: the world that S → G1 → G2 → G3 lead through."),
    ] = None
    scenario: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE.toml", help="World of localisation, office by default."),
    ] = None
    worlds: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="The worlds of barn or dynabarn.")
    ] = None
    images: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The real images of table-tops.")
    ] = None
    robot: RobotOption = "husky"
    episodes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=10_000,
            help="Number of episodes: seeds of a scenario (10 by default) or of paper (1), or "
            "worlds of a suite.",
        ),
    ] = None
    seed: Annotated[
        int,
        typer.Option(min=0, help="Seed of the first episode, counting up; of every world of barn."),
    ] = 0
    where: EngineOptions = field(default_factory=EngineOptions)
    shard: Annotated[
        str | None,
        typer.Option(
            metavar="i/n",
            help="Drive the i-th of n shares of the episodes; `merge` joins their folders.",
        ),
    ] = None
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of episodes.jsonl, summary.json and figures."),
    ] = None
    max_time: Annotated[
        float,
        typer.Option(metavar="S", min=1.0, help="Time limit of an episode in simulated seconds."),
    ] = 600.0
    beware: BewareOption = None
    segmentation: SegmenterOptions = field(default_factory=SegmenterOptions)
    navigation: NavigationOption = None
    random: RandomOption = False
    zones: ZonesOption = None
    ablation: AblationOption = Ablation.NONE
    odometry: OdometryOption = OdometryGrade.TYPICAL
    gnss: GnssOption = None
    camera: CameraOption = None
    scanner: ScannerOption = False
    latency: LatencyOption = "live"
    yielding: YieldingOption = False
    kept_map: Annotated[
        bool,
        typer.Option(
            "--kept-map",
            help="Second day: the robot has mapped the world of each seed by a drive to its goals "
            "and back, and starts in that map.",
        ),
    ] = False
    figures: Annotated[
        int,
        typer.Option(min=0, help="Number of first episodes to draw; failed ones are always drawn."),
    ] = 1

    @property
    def stream(self) -> CameraStream:
        """Size and rate of the camera's images."""
        return camera_stream(self.camera, self.profile.stream)

    @property
    def profile(self) -> RobotProfile:
        """The robot with its sensors."""
        return robot_profile(self.robot, scanner=self.scanner)


def check_options(settings: EvaluateSettings) -> None:
    own_task = settings.random or settings.zones is not None or settings.gnss is not None
    own_task = own_task or settings.yielding or settings.kept_map
    is_own = settings.suite in BY_NAME
    if is_own and (own_task or settings.ablation is not Ablation.NONE):
        raise BadConfiguration(
            "--random, --zones, --gnss, --yielding, --kept-map and --ablation are for scenarios, "
            f"{settings.suite!r} is a suite of its own"
        )
    usual = EvaluateSettings(suite=settings.suite)
    if is_own and (settings.max_time != usual.max_time or settings.figures > usual.figures):
        raise BadConfiguration(
            "--max-time and --figures are for scenarios; the suite "
            f"{settings.suite!r} has its own time limit, and draws no episodes"
        )
    own_network = SegmenterOptions(weights=settings.segmentation.weights)
    if settings.suite == Suite.TEACHING and settings.segmentation != own_network:
        raise BadConfiguration(
            "--segmenter and --backend: the suite 'teaching' trains the network, in torch"
        )
    drives, colour = settings.suite not in VIEWING, SegmenterOptions(segmenter="colour")
    if is_own and drives and settings.segmentation not in (usual.segmentation, colour):
        raise BadConfiguration(
            f"--segmenter network, --weights and --backend: in the suite {settings.suite!r} the "
            "colour rules alone see"
        )
    if settings.scenario is not None and settings.suite != Suite.LOCALISATION:
        raise BadConfiguration(
            "--scenario names the world of the suite 'localisation'; other worlds are the argument"
        )
    if settings.worlds is not None and settings.suite not in BARN_SUITES:
        raise BadConfiguration(
            f"--worlds FILE.json names the worlds of {' and '.join(BARN_SUITES)}; other worlds are "
            "the argument"
        )
    if (settings.images is None) == (settings.suite == Suite.TABLE_TOPS):
        raise BadConfiguration(
            f"--images DIR names what the suite '{Suite.TABLE_TOPS}' looks at, and is for it alone"
        )
    if settings.suite == Suite.TABLE_TOPS and (settings.episodes is not None or settings.seed):
        raise BadConfiguration(
            f"--episodes and --seed are for what is drawn; the suite '{Suite.TABLE_TOPS}' looks at "
            "all images of --images"
        )
    if settings.latency != "live" and settings.suite in (*VIEWING, Suite.LOCALISATION):
        raise BadConfiguration(
            "--latency is the time from an image to a command, and the suite "
            f"{settings.suite!r} judges no commands"
        )
    if settings.suite == PAPER and (settings.experiment is None or settings.random):
        raise BadConfiguration(
            "the suite paper needs --experiment indoor or forest, and its goals are given: "
            "no --random"
        )
    if settings.experiment is not None and settings.suite != PAPER:
        raise BadConfiguration("--experiment is for the suite 'paper'; worlds are the argument")
    if settings.suite == Suite.LOCALISATION and (settings.shard or settings.where.engine == "ray"):
        raise BadConfiguration(
            "--shard and --engine ray are for suites of separate episodes, and the parts of "
            "'localisation' share recorded drives; take --workers"
        )
    spread = settings.shard is not None or settings.where != EngineOptions()
    if spread and settings.suite in VIEWING:
        raise BadConfiguration(
            "--shard, --workers and --engine are for suites of separate episodes, and "
            f"{settings.suite!r} runs as a whole"
        )
    if settings.robot != usual.robot and (not drives or settings.suite == Suite.LOCALISATION):
        raise BadConfiguration(
            f"--robot is for robots that drive missions, and the suite {settings.suite!r} measures "
            f"the {usual.robot}"
        )
    if settings.camera is not None and settings.suite in (
        Suite.LOCALISATION,
        Suite.TEACHING,
        Suite.TABLE_TOPS,
    ):
        raise BadConfiguration(
            f"--camera is not for the suite {settings.suite!r}: its images have a size of their own"
        )
    if settings.suite in VIEWING and settings.stream.rate_hz != CameraStream().rate_hz:
        raise BadConfiguration(
            f"--camera {settings.camera}: the suite {settings.suite!r} takes an image every "
            "decimetre; give a size without a rate"
        )
    if not drives and settings.navigation is not None:
        raise BadConfiguration(
            "--navigation sets how a robot drives, and in the suite "
            f"{settings.suite!r} nothing does"
        )
    if settings.scanner and (not drives or settings.suite == Suite.LOCALISATION):
        raise BadConfiguration(
            "--scanner is for robots that meet people, and in the suite "
            f"{settings.suite!r} none does"
        )
    if not drives and settings.odometry is not OdometryGrade.TYPICAL:
        raise BadConfiguration(
            f"--odometry is for robots that drive, and in the suite {settings.suite!r} nothing does"
        )
