"""`bewarenav plan`: paths on stored maps, and every refusal one clear line."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from app.cli.main import cli
from app.map_planner import query
from app.map_planner.query import ask
from app.map_planner.stored_map import open_map
from navcore.errors import BewareNavError
from navcore.formats.nav2_map import State, load, map_from_cells
from navcore.grid.grid import GridSpec
from navcore.grid.nearest import nearest_reachable
from navcore.planning.path import Path as GridPath
from navcore.planning.planner import plan
from tests.app.cli.test_main import bewarenav
from tests.navcore.formats.stored import save
from tests.navcore.planning.test_planner import map_data

SPEC = GridSpec(resolution_m=0.1, rows=60, cols=80, origin_x_m=-4.0, origin_y_m=-1.0)
ROBOT = ("--width", "0.4", "--margin", "0.1")


def run(*arguments: str | Path) -> Result:
    """The command in this process; a refusal is its exception."""
    return CliRunner().invoke(cli, ["plan", *(str(argument) for argument in arguments)])


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """8 m × 6 m, a wall at x = 0 with a gap above y = 4 m, a closed room around (3, 0.5), the lower
    left unknown."""
    occupied = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    occupied[:50, 40] = True
    occupied[5:25, 60:80] = True
    occupied[7:23, 62:78] = False
    known = np.ones_like(occupied)
    known[:10, :40] = False
    path = tmp_path_factory.mktemp("hall") / "hall.yaml"
    save(map_from_cells(occupied=occupied, known=known, spec=SPEC), path)
    return path


@pytest.fixture(scope="module")
def maze(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five columns, three rows, the middle row closed but at its right end."""
    path = tmp_path_factory.mktemp("maze") / "maze.map"
    path.write_text("type octile\nheight 3\nwidth 5\nmap\n.....\n@@@@.\n.....\n")
    return path


def test_a_path_leads_from_start_to_goal_round_the_inflated_wall(
    hall: Path, tmp_path: Path
) -> None:
    out = tmp_path / "new" / "plan.json"
    result = run("--map", hall, "--start", "-2,1", "--goal", "2,2.5", *ROBOT, "--out", out)
    assert result.exit_code == 0
    report: dict[str, Any] = json.loads(out.read_text())
    path, cells = np.array(report["path"]), np.array(report["cells"])
    assert (report["found"], report["reason"], report["unit"]) == (True, None, "m")
    assert (report["start"], report["goal"], report["reached"]) == (
        [-2.0, 1.0],
        [2.0, 2.5],
        [2.0, 2.5],
    )
    assert report["inflation"] == {"width": 0.4, "margin": 0.1, "cells": 3}
    np.testing.assert_allclose(path[[0, -1]], np.array([[-2.0, 1.0], [2.0, 2.5]]), atol=0.05 + 1e-9)
    np.testing.assert_allclose(SPEC.centres(cells), path)
    assert report["waypoints"][-1] == report["path"][-1]
    assert report["length"] == pytest.approx(np.hypot(*np.diff(path, axis=0).T).sum())
    wall = np.argwhere(load(hall).cells(State.OCCUPIED))
    nearest = np.sqrt(((cells[:, None] - wall[None]) ** 2).sum(axis=2).min()) * SPEC.resolution_m
    assert 0.3 < nearest <= 0.5  # outside the disc of three cells, and no further than needed
    assert path[:, 1].max() > 4.3


def test_the_time_is_that_of_the_search_which_gave_the_path(
    hall: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 0.0

    def takes(seconds: float, do: Callable[..., Any]) -> Callable[..., Any]:
        def slow(*arguments: Any) -> Any:
            nonlocal now_s
            now_s += seconds
            return do(*arguments)

        return slow

    monkeypatch.setattr(query, "time", SimpleNamespace(perf_counter=lambda: now_s))
    monkeypatch.setattr(query, "plan", takes(0.25, plan))
    monkeypatch.setattr(query, "nearest_reachable", takes(5.0, nearest_reachable))
    plan_map = open_map(hall, width=0.4, margin=0.1, unknown_blocked=False)
    answer = ask(plan_map, (-3.0, 1.0), (3.0, 0.5), nearest=True)
    assert answer.reached is not None and answer.plan_ms == 250.0


def test_the_picture_shows_the_map_upright_and_the_path(hall: Path, tmp_path: Path) -> None:
    file = tmp_path / "plan.png"
    assert (
        run(
            "--map", hall, "--start", "-2,1", "--goal", "2,2.5", *ROBOT, "--picture", file
        ).exit_code
        == 0
    )
    image = cv2.imread(str(file))
    assert image is not None
    image = image[: int(0.9 * len(image))]  # without the legend
    blue = np.argwhere((np.abs(image.astype(int) - (0xD0, 0x66, 0x0A)).max(axis=2)) < 12)
    assert len(blue) > 200
    # The way over the wall's upper end lies in the upper part of the picture, the wall's foot does
    # not.
    assert blue[:, 0].min() < 0.35 * len(image)
    assert blue[:, 0].max() < 0.75 * len(image)


def test_without_width_and_margin_the_husky_is_planned_for(hall: Path) -> None:
    plan_map = open_map(hall, width=None, margin=None, unknown_blocked=False)
    assert (plan_map.width, plan_map.margin, plan_map.radius) == (0.7, 0.15, 5)


def test_unknown_cells_are_free_unless_they_are_to_be_blocked(hall: Path) -> None:
    ends = ("--map", hall, "--start", "-3,-0.5", "--goal", "-1,-0.5", *ROBOT)
    assert run(*ends).exit_code == 0
    result = run(*ends, "--unknown", "blocked")
    assert result.exit_code == 1
    assert (
        "the start (-3, -0.5) lies where the map is unknown, and unknown cells are blocked"
        in result.stdout
    )


@pytest.mark.parametrize(
    ("start", "goal", "words"),
    [
        ("-2,1", "3,0.5", "no path: every path from (-2, 1) to (3, 0.5) is blocked"),
        ("0.05,1", "2,2", "no path: the start (0.05, 1) lies in an obstacle"),
        (
            "-2,1",
            "0.3,1",
            "no path: the goal (0.3, 1) is too close to an obstacle "
            "for width 0.4 m and margin 0.1 m",
        ),
        ("-2,1", "9,1", "no path: the goal (9, 1) is outside the map, x -4 to 4 m, y -1 to 5 m"),
        ("0,1", "1e6,-1e6", "the goal (1e+06, -1e+06) is outside the map"),
    ],
)
def test_a_path_that_does_not_exist_is_exit_code_1_and_a_reason(
    hall: Path, tmp_path: Path, start: str, goal: str, words: str
) -> None:
    out = tmp_path / "plan.json"
    result = run("--map", hall, "--start", start, "--goal", goal, *ROBOT, "--out", out)
    assert result.exit_code == 1
    assert words in result.stdout
    report = json.loads(out.read_text())
    assert report["found"] is False
    assert f"no path: {report['reason']}" in result.stdout
    assert (report["length"], report["reached"], report["path"]) == (None, None, [])


def test_without_a_path_the_picture_shows_why(hall: Path, tmp_path: Path) -> None:
    file = tmp_path / "plan.png"
    assert (
        run(
            "--map", hall, "--start", "-2,1", "--goal", "3,0.5", *ROBOT, "--picture", file
        ).exit_code
        == 1
    )
    image = cv2.imread(str(file))
    assert image is not None
    assert (
        np.abs(image.astype(int) - (0xB2, 0xDE, 0xFF)).max(axis=2) < 4
    ).mean() > 0.02  # what is too close to the wall


@pytest.mark.parametrize("goal", [(3.0, 0.5), (0.3, 1.0), (9.0, 1.0), (0.05, 3.0)])
def test_the_nearest_reachable_place_is_planned_to_when_asked_for_and_said_to_be_another(
    hall: Path, goal: tuple[float, float]
) -> None:
    result = run(
        "--map", hall, "--start", "-2,1", "--goal", f"{goal[0]},{goal[1]}", *ROBOT, "--nearest"
    )
    assert result.exit_code == 0
    assert "no path: " in result.stdout
    assert re.search(r"nearest reachable cell: \(.*\), \d+\.\d\d m from the goal", result.stdout)
    plan_map = open_map(hall, width=0.4, margin=0.1, unknown_blocked=False)
    answer = ask(plan_map, (-2.0, 1.0), goal, nearest=True)
    cell = nearest_reachable(plan_map.blocked, SPEC.cell(-2.0, 1.0), SPEC.cell(*goal))
    assert tuple(answer.cells[-1].tolist()) == cell


def test_a_goal_that_can_be_reached_is_not_moved_by_nearest(hall: Path) -> None:
    result = run("--map", hall, "--start", "-2,1", "--goal", "2,2.5", *ROBOT, "--nearest")
    assert result.exit_code == 0
    assert "nearest" not in result.stdout


def test_a_start_that_is_no_place_is_not_helped_by_nearest(hall: Path) -> None:
    result = run("--map", hall, "--start", "0.05,1", "--goal", "2,2", *ROBOT, "--nearest")
    assert result.exit_code == 1


def test_a_movingai_map_is_planned_in_columns_and_rows_without_inflation(
    maze: Path, tmp_path: Path
) -> None:
    out = tmp_path / "plan.json"
    result = run(
        "--map",
        maze,
        "--start",
        "0,0",
        "--goal",
        "0,2",
        "--out",
        out,
        "--picture",
        tmp_path / "p.png",
    )
    assert result.exit_code == 0
    assert "10.0000 cells in 10 steps" in result.stdout
    report = json.loads(out.read_text())
    assert (report["unit"], report["path"][0], report["path"][5], report["path"][-1]) == (
        "cells",
        [0, 0],
        [4, 1],
        [0, 2],
    )
    assert report["cells"][5] == [1, 4]
    assert run("--map", maze, "--start", "0,0", "--goal", "0,2", "--width", "2").exit_code == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--start", "here"), "--start 'here': expected X,Y"),
        (("--goal", "nan,0"), "--goal 'nan,0': expected two numbers"),
        (("--goal", "1e300,0"), "--goal '1e300,0': expected two numbers"),
        (("--map", "/no/such.yaml"), "/no/such.yaml: no such file"),
        (("--map", "/no/such.png"), "expected a Nav2 map (.yaml) or a MovingAI map (.map)"),
        (("--width", "-1"), "--width -1: out of range"),
        (("--margin", "nan"), "--margin nan: out of range"),
        (("--width", "90"), "at most 200 are allowed; is the unit right?"),
        (("--out", "/proc/nowhere/p.json"), "/proc/nowhere cannot be written"),
        (("--picture", "/proc/nowhere/p.png"), "/proc/nowhere cannot be written"),
    ],
)
def test_bad_input_is_refused_in_words(hall: Path, arguments: tuple[str, str], words: str) -> None:
    good = {"--map": str(hall), "--start": "-2,1", "--goal": "2,2"} | dict([arguments])
    result = run(*(part for pair in good.items() for part in pair))
    assert isinstance(result.exception, BewareNavError)
    assert words in str(result.exception)


def test_half_a_cell_is_no_place_on_a_movingai_map(maze: Path) -> None:
    result = run("--map", maze, "--start", "0.5,0", "--goal", "0,2")
    assert isinstance(result.exception, BewareNavError)
    assert "whole numbers" in str(result.exception)


def test_a_refusal_is_one_line_and_exit_code_2_on_the_real_command_line(
    hall: Path, tmp_path: Path
) -> None:
    torn = tmp_path / "torn.yaml"
    torn.write_text(hall.read_text().replace("hall.pgm", "torn.pgm"))
    (tmp_path / "torn.pgm").write_bytes((hall.parent / "hall.pgm").read_bytes()[:-100])
    answer = bewarenav("plan", "--map", str(torn), "--start", "-2,1", "--goal", "2,2")
    assert answer.returncode == 2
    assert answer.stderr.strip().splitlines() == [
        f"bewarenav: {tmp_path}/torn.pgm: expected 4800 bytes of pixels, got 4700"
    ]


def test_a_file_that_is_a_folder_is_refused_and_not_a_crash(hall: Path, tmp_path: Path) -> None:
    result = run("--map", hall, "--start", "-2,1", "--goal", "2,2", "--out", tmp_path)
    assert isinstance(result.exception, BewareNavError)
    assert "cannot be written" in str(result.exception)


@pytest.mark.parametrize(
    ("option", "file"), [("--out", "hall.yaml"), ("--out", "hall.pgm"), ("--picture", "hall.pgm")]
)
def test_a_plan_is_not_written_over_the_map(hall: Path, option: str, file: str) -> None:
    before = (hall.parent / file).read_bytes()
    result = run("--map", hall, "--start", "-2,1", "--goal", "2,2", option, hall.parent / file)
    assert isinstance(result.exception, BewareNavError)
    assert f"{file}: is a file of the map" in str(result.exception)
    assert (hall.parent / file).read_bytes() == before


@pytest.mark.parametrize(("name", "goal"), [("depot", "28,12"), ("warehouse", "5,20")])
def test_published_robot_maps_are_planned_on(name: str, goal: str) -> None:
    start = {"depot": "2,2", "warehouse": "0,-20"}[name]
    result = run("--map", map_data("ros", f"{name}.yaml"), "--start", start, "--goal", goal)
    assert result.exit_code == 0, result.stdout
    plan_map = open_map(
        map_data("ros", f"{name}.yaml"), width=None, margin=None, unknown_blocked=False
    )
    ends = [
        plan_map.cell((float(x), float(y))) for x, y in (text.split(",") for text in (start, goal))
    ]
    outcome = plan(plan_map.blocked, ends[0], ends[1])
    assert isinstance(outcome, GridPath)
    assert f"{outcome.length * plan_map.spec.resolution_m:.2f} m in" in result.stdout
