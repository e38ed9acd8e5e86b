"""`bewarenav evaluate`: many episodes, driven and judged."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from app.cli.evaluate.settings import PAPER, EvaluateSettings, check_options
from app.cli.options import beware_list, prepare
from app.episode.ablations import Ablation
from app.evaluation.suites import BARN_SUITES, CROSSING_SUITES, UNRECORDED, Suite
from navcore.errors import BadConfiguration
from sim.robot.odometry_grade import OdometryGrade

if TYPE_CHECKING:
    from app.episode.episode import EpisodeSettings
    from app.evaluation.campaign import Fleet
    from app.evaluation.perception.detection_counts import Walks
    from app.runtime.start.segmentation import Perception
    from app.runtime.start.segmenter_choice import SegmenterChoice
    from navcore.config.navigator import NavigatorConfig
    from navcore.mission.beware_list import BewareList

ENOUGH_FOUND: Mapping[str, float] = {Suite.FINDING: 0.95, Suite.ONE_CLICK: 0.8}
"""Share of objects found in time at which a suite succeeds."""
FEW_FALSE_PER_10_M = 1.0
"""Rate of false detections up to which it does."""
ENOUGH_LABELLED, LITTLE_OF_TABLES = 0.5, 0.01
"""Shares of the real things that are labelled, and of the tables, at which `table-tops` succeeds.
"""
FEW_LET_THROUGH = 0.1
"""Share of the prints of each class with a least height that the network claims and the check by
depth lets through, up to which `prints` succeeds."""
ENOUGH_PASSED = 0.95
"""Share of doors passed at the first try at which `doors` succeeds, and of goals reached at which
`crossings` does: a robot that stays where it is drives into no person."""


def evaluate(settings: EvaluateSettings) -> None:
    """Drive many seeded episodes and print a summary; resumes an interrupted campaign."""
    from app.runtime.record.provenance import version
    from navcore.config.navigator import load_config

    version()  # of the files that are loaded now, whatever changes while episodes are driven
    check_options(settings)
    config = (
        None if settings.navigation is None else load_config(settings.navigation, settings.profile)
    )
    try:
        succeeded = _evaluated(settings, config)
    except KeyboardInterrupt:
        left = (
            f"the suite {settings.suite!r} has no results before its end, and the same command "
            "measures all again"
            if settings.suite in UNRECORDED
            else "what was driven is recorded, and the same command drives the rest"
        )
        typer.echo(f"bewarenav: interrupted; {left}", err=True)
        sys.exit(130)
    sys.exit(0 if succeeded else 1)


def _evaluated(settings: EvaluateSettings, config: NavigatorConfig | None) -> bool:
    """Run the suite; return whether it succeeded."""
    if settings.suite in BARN_SUITES:
        return _barn(settings, config)
    if settings.suite in CROSSING_SUITES:
        return _crossings(settings, config)
    if settings.suite == Suite.DOORS:
        return _doors(settings, config)
    if settings.suite == Suite.FINDING:
        return _detection(settings)
    if settings.suite == Suite.ONE_CLICK:
        return _one_click(settings)
    if settings.suite == Suite.LIGHT:
        return _light(settings)
    if settings.suite == Suite.TEACHING:
        return _teaching(settings)
    if settings.suite == Suite.TABLE_TOPS:
        return _table_tops(settings)
    if settings.suite == Suite.PRINTS:
        return _prints(settings)
    if settings.suite == Suite.LOCALISATION:
        return _localisation(settings, config)
    return _scenario(settings, config)


def _fleet(settings: EvaluateSettings) -> Fleet:
    from app.episode.second_day import FIRST_DAY
    from app.evaluation.campaign import Fleet
    from app.fleet.shard import parse_shard

    shard = None if settings.shard is None else parse_shard(settings.shard)
    days = 1 + FIRST_DAY if settings.kept_map else 1
    engine = settings.where.chosen(simulated_s=days * settings.max_time)
    return Fleet(engine=engine, shard=shard)


def _out(settings: EvaluateSettings, name: str) -> Path:
    """Return the folder of the results; by default of its own for each share."""
    share = "" if settings.shard is None else f"-shard-{settings.shard.replace('/', '-of-')}"
    return settings.out or Path("runs") / f"{name}{share}"


def _barn(settings: EvaluateSettings, config: NavigatorConfig | None) -> bool:
    from app.evaluation.driving.barn import evaluate_barn

    verdict = evaluate_barn(
        settings.suite,
        settings.worlds,
        _episode_settings(settings, config),
        count=settings.episodes,
        seed=settings.seed,
        fleet=_fleet(settings),
        out=_out(settings, f"{settings.suite}-{settings.robot}"),
    )
    return _is_perfect(verdict)


def _crossings(settings: EvaluateSettings, config: NavigatorConfig | None) -> bool:
    from app.evaluation.driving.crossings import evaluate_crossings

    evaluate = partial(evaluate_crossings, suite=Suite(settings.suite))
    verdict = _seeded(settings, config, evaluate, episodes=200)
    goals = verdict["goals_reached"] / verdict["episodes"]
    return bool(verdict["drove_into_people"] == 0 and goals >= ENOUGH_PASSED)


def _doors(settings: EvaluateSettings, config: NavigatorConfig | None) -> bool:
    from app.evaluation.driving.doors import evaluate_doors

    verdict = _seeded(settings, config, evaluate_doors, episodes=50)
    return bool(verdict["first_try"] >= ENOUGH_PASSED)


def _seeded(
    settings: EvaluateSettings,
    config: NavigatorConfig | None,
    evaluate_suite: Callable[..., dict[str, Any]],
    *,
    episodes: int,
) -> dict[str, Any]:
    """Run a suite that draws one episode of each seed; `episodes`: their number by default."""
    return evaluate_suite(
        _episode_settings(settings, config),
        seeds=range(settings.seed, settings.seed + (settings.episodes or episodes)),
        fleet=_fleet(settings),
        out=_out(settings, settings.suite),
    )


def _episode_settings(
    settings: EvaluateSettings, config: NavigatorConfig | None
) -> EpisodeSettings:
    """Return what all episodes of a suite share; its time limit is its own."""
    from app.episode.episode import EpisodeSettings
    from app.episode.latency import latency_of

    return EpisodeSettings(
        beware=beware_list(settings.beware),
        config=config,
        robot=settings.profile,
        odometry=settings.odometry,
        latency=latency_of(settings.latency),
        camera=settings.stream,
    )


def _detection(settings: EvaluateSettings) -> bool:
    from app.evaluation.perception.detection import walks
    from app.runtime.start.preparation import prepared_perception

    beware, choice, out = _given(settings)
    perception = prepared_perception(choice, sensor=settings.profile.depth_sensor)
    suite = walks(perception, beware, settings.stream.size)
    return _walked(settings, suite, out, walks_by_default=40)


def _given(settings: EvaluateSettings) -> tuple[BewareList, SegmenterChoice, Path]:
    """Return the beware list, the segmenter and the folder of the results of a suite in which
    nothing drives, checked before anything slow begins; the folder last, so that what is refused
    leaves none."""
    beware = beware_list(settings.beware)
    choice = settings.segmentation.choice(camera=settings.stream)
    out = _out(settings, settings.suite)
    prepare(out)
    return beware, choice, out


def _perception(settings: EvaluateSettings, choice: SegmenterChoice) -> Perception:
    """Return what sees the images of a suite in which nothing drives."""
    from app.runtime.start.engine_memory import EngineMemory
    from app.runtime.start.segmentation import compose

    return compose(choice, sensor=settings.profile.depth_sensor, memory=EngineMemory.of_user())


def _one_click(settings: EvaluateSettings) -> bool:
    from app.evaluation.perception.one_click import walks

    if settings.beware is not None:
        raise BadConfiguration(
            "--beware names the classes that are known, and in the suite 'one-click' none are"
        )
    _, choice, out = _given(settings)
    suite = walks(_perception(settings, choice), settings.stream.size)
    return _walked(settings, suite, out, walks_by_default=20)


def _light(settings: EvaluateSettings) -> bool:
    from app.evaluation.perception.light import evaluate_light

    beware, choice, out = _given(settings)
    told = evaluate_light(
        _perception(settings, choice),
        beware,
        seeds=range(settings.seed, settings.seed + (settings.episodes or 12)),
        out=out,
        size=settings.stream.size,
    )
    needed = ENOUGH_FOUND[Suite.FINDING]
    return all(one["found_in_time"] >= needed for one in told["disturbances"].values())


def _teaching(settings: EvaluateSettings) -> bool:
    from app.evaluation.perception.teaching import evaluate_teaching
    from navcore.perception.esanet.inference.network_file import SHIPPED

    if settings.beware is not None:
        raise BadConfiguration(
            "--beware names the classes that are known; the suite 'teaching' knows the network's"
        )
    seeds = range(settings.seed, settings.seed + (settings.episodes or 16))
    _, choice, out = _given(settings)
    return evaluate_teaching(choice.weights or SHIPPED, seeds, out=out)


def _table_tops(settings: EvaluateSettings) -> bool:
    from app.evaluation.perception.table_tops import evaluate_table_tops, splits_in

    assert settings.images is not None
    splits = splits_in(settings.images)
    beware, choice, out = _given(settings)
    told = evaluate_table_tops(_perception(settings, choice), beware, splits, out=out)
    return all(
        found["labelled"] >= ENOUGH_LABELLED * found["things"]
        and found["table_share"] <= LITTLE_OF_TABLES
        for found in told["labelled_things"].values()
    )


def _prints(settings: EvaluateSettings) -> bool:
    from app.evaluation.perception.prints import evaluate_prints

    beware, choice, out = _given(settings)
    told = evaluate_prints(
        _perception(settings, choice),
        beware,
        seeds=range(settings.seed, settings.seed + (settings.episodes or 30)),
        out=out,
        size=settings.stream.size,
    )
    return all(
        len(found["let_through_seeds"]) <= FEW_LET_THROUGH * told["episodes"]
        for found in told["printed"].values()
        if found["min_height_m"] is not None
    )


def _walked(settings: EvaluateSettings, walks: Walks, out: Path, *, walks_by_default: int) -> bool:
    seeds = range(settings.seed, settings.seed + (settings.episodes or walks_by_default))
    found = walks.run(seeds, out=out)
    return bool(
        found["found_in_time"] >= ENOUGH_FOUND[settings.suite]
        and found["false_items_per_10_m"] <= FEW_FALSE_PER_10_M
    )


def _localisation(settings: EvaluateSettings, config: NavigatorConfig | None) -> bool:
    from app.evaluation.localisation.suite import evaluate_localisation
    from sim.scenario.load import load_scenario

    world = settings.scenario or "office"
    scenario = load_scenario(world)
    beware, engine = beware_list(settings.beware, scenario), settings.where.chosen()
    out = _out(settings, f"localisation-{Path(world).stem}-{settings.odometry}")
    prepare(out)  # what could not be written shows hours later else
    summary = evaluate_localisation(
        scenario,
        grade=settings.odometry,
        episodes=settings.episodes or 10,
        seed=settings.seed,
        out=out,
        beware=beware,
        config=config,
        engine=engine,
    )
    searches = (
        summary["switched_on"],
        *summary["looked_round"].values(),
        *summary["wrong_map"].values(),
        *summary["started_in"].values(),
    )
    return all(found["wrong"] == 0 for found in searches)


def _scenario(settings: EvaluateSettings, config: NavigatorConfig | None) -> bool:
    from app.episode.latency import latency_of
    from app.episode.task import Task
    from app.evaluation.driving.scenario import NEEDS_NO_SEGMENTER, evaluate_scenario
    from app.runtime.start.preparation import prepared_perception
    from navcore.config.navigator import config_for
    from sim.scenario.load import load_scenario

    world, count = settings.experiment or settings.suite, settings.episodes
    task = Task(
        scenario=load_scenario(world, settings.profile),
        random=settings.random,
        zones=settings.zones,
        ablation=settings.ablation,
        odometry=settings.odometry,
        gnss=settings.gnss,
        camera=settings.stream,
        latency=latency_of(settings.latency),
        yielding=settings.yielding,
        kept_map=settings.kept_map,
        max_time_s=settings.max_time,
    )
    parts = [
        "" if settings.experiment is None else PAPER,
        Path(world).stem,
        "random" if settings.random else "",
        "" if settings.ablation is Ablation.NONE else str(settings.ablation),
        "" if settings.odometry is OdometryGrade.TYPICAL else str(settings.odometry),
        "" if settings.gnss is None else f"gnss-{settings.gnss}",
        "" if settings.camera is None else f"camera-{settings.stream}",
        "" if settings.latency == "live" else f"latency-{settings.latency}",
        "scanner" if settings.scanner else "",
        "yielding" if settings.yielding else "",
        "kept-map" if settings.kept_map else "",
    ]
    needs_segmenter = settings.ablation not in NEEDS_NO_SEGMENTER
    config = config or config_for(settings.profile)
    summary = evaluate_scenario(
        task,
        robot=settings.profile,
        seeds=range(
            settings.seed, settings.seed + (count or (10 if settings.experiment is None else 1))
        ),
        fleet=_fleet(settings),
        out=_out(settings, "-".join(filter(None, parts))),
        beware=beware_list(settings.beware, task.scenario),
        perception=prepared_perception(
            settings.segmentation.choice(camera=settings.stream),
            config=config.perception,
            sensor=settings.profile.depth_sensor,
        )
        if needs_segmenter
        else None,
        draw_first=settings.figures,
        config=config,
    )
    return _is_perfect(summary)


def _is_perfect(summary: Mapping[str, Any]) -> bool:
    return bool(summary["success_rate"] == 1.0)
