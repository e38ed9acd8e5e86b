"""`bewarenav evaluate` and `bewarenav compare`: many episodes, and campaigns side by side."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console as Terminal

from app.cli.options import (
    AblationOption,
    BewareOption,
    NavigationOption,
    RandomOption,
    ZonesOption,
    beware_list,
)
from app.episode.ablation import Ablation
from app.runtime.segmenter_choice import BackendOption, KindOption, SegmenterChoice, WeightsOption
from navcore.errors import BadConfiguration


def evaluate(
    suite: Annotated[
        str,
        typer.Argument(
            help="A scenario, e.g. office, or a world file; or one of the suites barn, dynabarn, crossings and finding."
        ),
    ],
    worlds: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="The worlds of barn or dynabarn.")
    ] = None,
    robot: Annotated[
        str, typer.Option(metavar="husky|jackal", help="What drives; suites are scaled to fit it.")
    ] = "husky",
    episodes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=10_000,
            help="Seeds of a scenario, 10 if left out; the first worlds of a suite.",
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            min=0, help="Of the first episode; the others follow. Of every world of a suite."
        ),
    ] = 0,
    workers: Annotated[int, typer.Option(min=1, max=64)] = 1,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Where episodes.jsonl, summary.json and the figures go."),
    ] = None,
    max_time: Annotated[float, typer.Option(metavar="S", min=1.0)] = 600.0,
    beware: BewareOption = None,
    segmenter: KindOption = "auto",
    weights: WeightsOption = None,
    backend: BackendOption = "auto",
    navigation: NavigationOption = None,
    random: RandomOption = False,
    zones: ZonesOption = None,
    ablation: AblationOption = Ablation.NONE,
    figures: Annotated[
        int,
        typer.Option(
            min=0, help="Draw so many of the first episodes; those that fail are always drawn."
        ),
    ] = 1,
) -> None:
    """Drive many seeded episodes and print what came of them; resumes where it was interrupted."""
    from app.evaluation.barn import SUITES, evaluate_barn
    from app.evaluation.crossings import evaluate_crossings
    from app.runtime.segmentation import compose
    from navcore.config.navigator import load_config
    from navcore.robot.profile import load_profile

    if suite in (*SUITES, "crossings", "finding") and (
        random or zones is not None or ablation is not Ablation.NONE
    ):
        raise BadConfiguration(
            f"--random, --zones and --ablation are for scenarios, {suite!r} is a suite of its own"
        )
    if suite == "finding" and navigation is not None:
        raise BadConfiguration(
            "--navigation is for what drives, and in the suite 'finding' nothing does"
        )
    config = None if navigation is None else load_config(navigation, load_profile(robot))
    if suite in SUITES:
        into = out or Path("runs") / f"{suite}-{robot}"
        verdict = evaluate_barn(
            suite,
            worlds,
            robot=robot,
            count=episodes,
            seed=seed,
            workers=workers,
            out=into,
            config=config,
        )
        sys.exit(0 if verdict["success_rate"] == 1.0 else 1)
    if suite == "crossings":
        seeds, into = range(seed, seed + (episodes or 200)), out or Path("runs") / suite
        verdict = evaluate_crossings(
            seeds=seeds, workers=workers, out=into, beware=beware_list(beware), config=config
        )
        sys.exit(0 if verdict["drove_into_somebody"] == 0 else 1)
    choice = SegmenterChoice(kind=segmenter, weights=weights, engine=backend)
    if suite == "finding":
        from app.evaluation.detection import run_finding

        into = out or Path("runs") / suite
        found = run_finding(
            compose(choice).segmenter,
            beware_list(beware),
            seed=seed,
            walks=episodes or 40,
            out=into,
        )
        sys.exit(0 if found["found_in_time"] >= 0.95 and found["false_items_per_10_m"] < 1.0 else 1)

    from app.episode.task import Task
    from app.evaluation.scenario import NEEDS_NO_SEGMENTER, evaluate_scenario
    from sim.scenario.load import load_scenario

    task = Task(
        scenario=load_scenario(suite),
        random=random,
        zones=zones,
        ablation=ablation,
        max_time_s=max_time,
    )
    parts = [
        Path(suite).stem,
        "random" if random else "",
        "" if ablation is Ablation.NONE else str(ablation),
    ]
    summary = evaluate_scenario(
        task,
        robot=robot,
        seeds=range(seed, seed + (episodes or 10)),
        workers=workers,
        out=out or Path("runs") / "-".join(filter(None, parts)),
        beware=beware_list(beware),
        perception=None if ablation in NEEDS_NO_SEGMENTER else compose(choice),
        draw_first=figures,
        config=config,
    )
    sys.exit(0 if summary["success_rate"] == 1.0 else 1)


def compare(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR…", help="Where evaluations of scenarios lie.")
    ],
) -> None:
    """Print what came of several evaluations side by side, e.g. of the whole system and of its
    ablations."""
    from app.evaluation.summary import compare as side_by_side

    Terminal(width=None if sys.stdout.isatty() else 60 + 36 * len(folders)).print(
        side_by_side(folders)
    )
