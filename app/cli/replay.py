"""`bewarenav replay`: a recording of a real sensor through the navigator."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.options import LevelOption, finite_point, prepare
from app.runtime.segmenter_choice import BackendOption, KindOption, SegmenterChoice, WeightsOption
from navcore.files import write_whole

if TYPE_CHECKING:
    from app.replay.reference import Agreement


def replay(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="poses.txt, camera-intrinsics.txt, frame-NNNNNN.{color,depth}."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write replay.json and the map (map.npz) here."),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="Plan to here; else to where the camera began."),
    ] = None,
    reference: Annotated[
        Path | None,
        typer.Option(metavar="FILE.npz", help="Free and occupied voxels to compare with."),
    ] = None,
    picture: Annotated[bool, typer.Option("--picture", help="Draw replay.png into --out.")] = False,
    robot: Annotated[
        str, typer.Option(metavar="NAME|FILE.toml", help="Whose size the path is for.")
    ] = "husky",
    every: Annotated[int, typer.Option(min=1, max=1000, help="Only every so manieth frame.")] = 1,
    level: LevelOption = False,
    segmenter: KindOption = "auto",
    weights: WeightsOption = None,
    backend: BackendOption = "auto",
) -> None:
    """Build the map of a recording, frame by frame as a robot would, plan on it and say how well it
    agrees with a reference."""
    import numpy as np
    from rich.console import Console as Terminal
    from rich.progress import Progress

    from app.replay.floor_plane import find_floor
    from app.replay.plot import draw_replay
    from app.replay.recording import open_recording
    from app.replay.reference import load_reference
    from app.replay.run import as_report, compare
    from app.replay.run import replay as run
    from app.runtime.map_persistence import save_map
    from app.runtime.segmentation import compose
    from navcore.config.navigator import config_for
    from navcore.mission.beware_list import default_beware_list
    from navcore.robot.profile import load_profile

    if out is None and picture:
        out = Path("runs") / "replay"
    if out is not None:
        prepare(out)
    target = None if goal is None else finite_point(goal, "--goal")
    profile, beware = load_profile(robot), default_beware_list()
    config = config_for(profile)
    known = None if reference is None else load_reference(reference)
    recording = open_recording(folder, every=every)
    perception = compose(SegmenterChoice(kind=segmenter, weights=weights, engine=backend))
    T_map_world = np.eye(4) if level else find_floor(recording)
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
    report = as_report(replayed, judged)
    lines = in_words(report, judged)
    if out is not None:
        write_whole(out / "replay.json", json.dumps(report, indent=1).encode())
        save_map(replayed.navigator.map, beware, out / "map.npz")
    if out is not None and picture:
        write_whole(
            out / "replay.png",
            draw_replay(recording, replayed, known, config, title="\n".join(lines)),
        )
    typer.echo("\n".join(lines))


def in_words(report: dict[str, Any], judged: Agreement | None) -> list[str]:
    """The report for people."""
    (x, y), (goal_x, goal_y) = report["start"], report["goal"]
    lines = [
        f"{report['frames']} frames: {report['explored_m2']:.1f} m² and {report['explored_m3']:.1f} m³ explored, "
        f"{report['occupied_cells']} cells occupied, {report['beware_cells']} to beware of, "
        f"a tick {report['tick_ms']:.0f} ms",
    ]
    if judged is not None:
        lines.append(
            f"beside the reference: occupied IoU {judged.iou:.3f}, precision {judged.precision_near:.4f} and recall "
            f"{judged.recall_near:.4f} within one cell ({judged.judged} cells against {judged.reference}; "
            f"{judged.not_judged} more lie where it knows nothing)"
        )
    way = f"from ({x:.2f}, {y:.2f}) to ({goal_x:.2f}, {goal_y:.2f})"
    if report["path_m"] is None:
        return [*lines, f"no path {way}: {report['no_path']}"]
    return [*lines, f"path {way}: {report['path_m']:.2f} m, {len(report['waypoints'])} waypoints"]
