"""`bewarenav replay`: run the navigator on a recording of a real sensor."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.options import LevelOption, RobotOption, SegmenterOptions, finite_point, prepare
from navcore.files import write_whole

if TYPE_CHECKING:
    from app.replay.annotation import BewareAgreement
    from app.replay.reference import Agreement


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplaySettings:
    """The argument and the options of the command."""

    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="poses.txt, camera-intrinsics.txt, frame-NNNNNN.{color,depth}."
        ),
    ]
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write replay.json and the map (map.npz) here."),
    ] = None
    goal: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="Goal of the path; the camera's start if left out."),
    ] = None
    reference: Annotated[
        Path | None,
        typer.Option(metavar="FILE.npz", help="Free and occupied voxels to compare with."),
    ] = None
    objects: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml", help="Outlined objects of the beware list to judge the map by."
        ),
    ] = None
    picture: Annotated[bool, typer.Option("--picture", help="Draw replay.png into --out.")] = False
    robot: RobotOption = "husky"
    every: Annotated[int, typer.Option(min=1, max=1000, help="Use every N-th frame only.")] = 1
    level: LevelOption = False
    segmentation: SegmenterOptions = field(default_factory=SegmenterOptions)


def replay(settings: ReplaySettings) -> None:
    """Build the map of a recording frame by frame, plan on it and compare it with a reference."""
    import numpy as np
    from rich.console import Console as Terminal
    from rich.progress import Progress

    from app.evaluation.origin import origin_here
    from app.evaluation.suites import Suite
    from app.replay.annotation import load_annotation
    from app.replay.floor_plane import find_floor
    from app.replay.plot import draw_replay
    from app.replay.recording import open_recording
    from app.replay.reference import load_reference
    from app.replay.run import as_report, compare, compare_objects
    from app.replay.run import replay as run
    from app.runtime.record.map_persistence import save_map
    from app.runtime.start.engine_memory import EngineMemory
    from app.runtime.start.segmentation import compose
    from navcore.config.navigator import config_for
    from navcore.mission.beware_list import default_beware_list
    from navcore.robot.profile import load_profile

    out = settings.out
    if out is None and settings.picture:
        out = Path("runs") / "replay"
    if out is not None:
        prepare(out)
    target = None if settings.goal is None else finite_point(settings.goal, "--goal")
    profile, beware = load_profile(settings.robot), default_beware_list()
    config = config_for(profile)
    known = None if settings.reference is None else load_reference(settings.reference)
    annotation = None if settings.objects is None else load_annotation(settings.objects)
    recording = open_recording(settings.folder, every=settings.every)
    perception = compose(
        settings.segmentation.choice(),
        sensor=profile.depth_sensor,
        memory=EngineMemory.of_user(),
    )
    T_map_world = np.eye(4) if settings.level else find_floor(recording)
    with Progress(console=Terminal(stderr=True)) as bar:
        task = bar.add_task("frames", total=len(recording))
        replayed = run(
            recording,
            T_map_world,
            profile=profile,
            config=config,
            segmenter=perception.segmenter,
            beware=beware,
            goal=target,
            on_progress=lambda done, of: bar.update(task, completed=done),
        )
    judged = None if known is None else compare(replayed, known, config)
    objects = None if annotation is None else compare_objects(replayed, annotation, beware, config)
    report = origin_here(
        Suite.REPLAY, segmenter=perception.identity, scenario=settings.folder.resolve().name
    ) | as_report(replayed, judged, objects)
    lines = in_words(report, judged, objects)
    if out is not None:
        write_whole(out / "replay.json", json.dumps(report, indent=1).encode())
        save_map(replayed.navigator.map, beware, out / "map.npz")
    if out is not None and settings.picture:
        write_whole(
            out / "replay.png",
            draw_replay(recording, replayed, known, config, title="\n".join(lines)),
        )
    typer.echo("\n".join(lines))


def in_words(
    report: dict[str, Any], judged: Agreement | None, objects: BewareAgreement | None = None
) -> list[str]:
    """Return the report as lines of text."""
    (x, y), (goal_x, goal_y) = report["start"], report["goal"]
    lines = [
        f"{report['frames']} frames: {report['explored_m2']:.1f} m² and "
        f"{report['explored_m3']:.1f} m³ explored, {report['occupied_cells']} cells occupied, "
        f"{report['beware_cells']} to beware of, a tick {report['tick_ms']:.0f} ms",
    ]
    if judged is not None:
        lines.append(
            f"beside the reference: occupied IoU {judged.iou:.3f}, "
            f"precision {judged.precision_near:.4f} and recall {judged.recall_near:.4f} "
            f"within one cell ({judged.judged} cells against {judged.reference}; "
            f"{judged.not_judged} more where the reference is unknown)"
        )
    if objects is not None:
        by_class = ", ".join(f"{name} {count}" for name, count in objects.wrong_by_class.items())
        lines += [
            f"beside the annotated objects: {objects.wrong_cells} of {objects.judged_cells} cells "
            f"wrongly of the list, {objects.wrong_share:.1%} ({by_class or 'none'})",
            f"{objects.held_as_own_class} of {len(objects.held)} objects held as their class",
        ]
    ends = f"from ({x:.2f}, {y:.2f}) to ({goal_x:.2f}, {goal_y:.2f})"
    if report["path_m"] is None:
        return [*lines, f"no path {ends}: {report['no_path']}"]
    return [*lines, f"path {ends}: {report['path_m']:.2f} m, {len(report['waypoints'])} waypoints"]
