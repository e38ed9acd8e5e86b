"""The command line: bad input is one clear line and exit code 2."""

from __future__ import annotations

import io
import json
import os
import socket
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

import pytest
import torch

from app.cli.main import main
from app.evaluation.campaign import Fleet
from app.fleet.local import Processes
from app.fleet.ray_cluster import RayCluster
from navcore.errors import BadConfiguration
from navcore.perception.esanet import build

COLUMNS = {"COLUMNS": "200"}
"""Width of the terminal: no message is broken into lines."""


def free_port() -> str:
    """A port that no console of this machine listens on."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return str(free.getsockname()[1])


CONSOLE = ("console", "--port", free_port())


def bewarenav(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line in this process, which spares the imports of every new one."""
    out, err = io.StringIO(), io.StringIO()
    with (
        patch.object(sys, "argv", ["bewarenav", *arguments]),
        patch.dict(os.environ, COLUMNS),
        redirect_stdout(out),
        redirect_stderr(err),
        pytest.raises(SystemExit) as ended,
    ):
        main()
    return subprocess.CompletedProcess(
        arguments, int(ended.value.code or 0), out.getvalue(), err.getvalue()
    )


def bewarenav_process(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line as a user does, in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "app", *arguments],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
        env={**os.environ, **COLUMNS},
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("drive", "--scenario", "nowhere"), "nowhere"),
        (("drive", "--scenario", "empty_room", "--goal", "here"), "--goal 'here'"),
        (
            ("drive", "--scenario", "empty_room", "--goal", "100,0", "--segmenter", "colour"),
            "outside the world",
        ),
        (
            ("drive", "--scenario", "empty_room", "--goal", "nan,0", "--segmenter", "colour"),
            "outside the world",
        ),
        (
            (
                "drive",
                "--scenario",
                "empty_room",
                "--beware",
                "/no/such.toml",
                "--segmenter",
                "colour",
            ),
            "no such file",
        ),
        (
            ("drive", "--scenario", "empty_room", "--report", "/proc/nowhere/r.json"),
            "cannot be written",
        ),
        (
            ("evaluate", "localisation", "--scenario", "empty_room", "--out", "/proc/nowhere"),
            "cannot be written",
        ),
        (("evaluate", "nowhere"), "nowhere"),
        (("evaluate", "barn"), "--worlds"),
        (("evaluate", "barn", "--random"), "suite of its own"),
        (("evaluate", "barn", "--gnss", "rtk"), "suite of its own"),
        (("evaluate", "finding", "--odometry", "poor"), "--odometry"),
        (("evaluate", "finding", "--latency", "none"), "--latency"),
        (("evaluate", "finding", "--scanner"), "--scanner"),
        (("evaluate", "one-click", "--robot", "jackal"), "measures the husky"),
        (("evaluate", "localisation", "--robot", "jackal"), "measures the husky"),
        (("evaluate", "office", "--worlds", "barn.json"), "--worlds"),
        (("evaluate", "table-tops", "--images", ".", "--episodes", "3"), "--episodes"),
        (("evaluate", "table-tops", "--images", ".", "--seed", "3"), "--seed"),
        (("drive", "--robot", "marvin"), "no robot is called 'marvin'"),
        (("drive", "--robot", "nowhere.toml"), "no such file"),
        ((*CONSOLE, "--robot", "marvin"), "no robot is called 'marvin'"),
        (("evaluate", "crossings", "--yielding"), "suite of its own"),
        (("evaluate", "crossings", "--max-time", "9"), "--max-time"),
        (("evaluate", "doors", "--figures", "3"), "--figures"),
        (("evaluate", "doors", "--segmenter", "network"), "--segmenter"),
        (("evaluate", "crossings", "--weights", "my.onnx"), "--weights"),
        (("evaluate", "barn", "--backend", "torch"), "--backend"),
        (
            ("evaluate", "barn", "--figures", "0", "--segmenter", "colour", "--max-time", "600"),
            "--worlds",
        ),
        (("evaluate", "office", "--camera", "640x360"), "camera '640x360': expected one of"),
        (("evaluate", "finding", "--camera", "@15"), "without a rate"),
        (("evaluate", "light", "--segmenter", "colour"), "needs a network"),
        (("evaluate", "light", "--workers", "2"), "runs as a whole"),
        (("evaluate", "teaching", "--segmenter", "colour"), "--segmenter and --backend"),
        (("evaluate", "teaching", "--backend", "torch"), "--segmenter and --backend"),
        (("evaluate", "localisation", "--camera", "848x480"), "--camera"),
        (("evaluate", "localisation", "--shard", "1/2"), "take --workers"),
        (("drive", "--camera", "848x480@25"), "one of 10, 15, 30, 60"),
        ((*CONSOLE, "--camera", "large"), "camera 'large'"),
        (("bench", "tick", "--camera", "12x12"), "camera '12x12'"),
        (("evaluate", "office", "--latency", "-5"), "--latency '-5'"),
        (("drive", "--latency", "fast"), "--latency 'fast'"),
        (("evaluate", "office", "--ablation", "no-zones"), "--zones"),
        (("evaluate", "paper"), "--experiment"),
        (("evaluate", "paper", "--experiment", "indoor", "--random"), "no --random"),
        (("evaluate", "indoor", "--experiment", "indoor"), "suite 'paper'"),
        (("evaluate", "office", "--shard", "5/4"), "--shard '5/4'"),
        (("evaluate", "finding", "--workers", "2"), "runs as a whole"),
        (("evaluate", "office", "--address", "auto", "--segmenter", "colour"), "--engine ray"),
        (("merge", "/no/such/folder", "--out", "/tmp/merged"), "no folder of a campaign"),
        (("merge", "/no/such/folder", "--out", "m", "--allow", "all"), "missing, repeated"),
        (("compare", "/no/such/folder"), "summary.json"),
        # Refused before the weights are opened, and before an engine is tried.
        (("drive", "--goal", "99,99", "--weights", "/no/such.onnx"), "outside the world"),
        (("drive", "--scenario", "moon", "--weights", "/no/such.onnx"), "forest, indoor, office"),
        ((*CONSOLE, "--scenario", "moon", "--weights", "/no/such.onnx"), "forest, indoor, office"),
        ((*CONSOLE, "--site", "a/b", "--weights", "/no/such.onnx"), "site name 'a/b'"),
        ((*CONSOLE, "--map", __file__, "--weights", "/no/such.onnx"), "test_main.py: no map file"),
        (("evaluate", "office", "--robot", "unicycle", "--segmenter", "colour"), "unicycle"),
        (
            ("drive", "--scenario", "empty_room", "--weights", "/no/such.safetensors"),
            "such.safetensors",
        ),
        (
            ("drive", "--scenario", "empty_room", "--weights", "/no/such.pth"),
            ".safetensors or .onnx",
        ),
        (("evaluate", "empty_room", "--weights", "/no/such.onnx"), "such.onnx"),
    ],
)
def test_bad_input_is_one_clear_line_and_exit_code_2(
    arguments: tuple[str, ...], words: str
) -> None:
    check_refusal(bewarenav(*arguments), words)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("drive", "--weights", "/no/such.onnx"), "/no/such.onnx: no such file"),
        (("drive", "--weights", "/no/such.pth"), ".safetensors or .onnx"),
        (("drive", "--segmenter", "colour", "--weights", "/no/such.onnx"), "have no weights"),
        (("drive", "--map", "TMP/torn.map"), "torn.map"),
        (("evaluate", "table-tops", "--images", "TMP", "--out", "TMP/out"), "holds no folder"),
        (("evaluate", "light", "--beware", "/no/such.toml", "--out", "TMP/out"), "no such file"),
        (("evaluate", "teaching", "--weights", "/no/such.onnx", "--out", "TMP/out"), "no such"),
        *(
            (("evaluate", suite, "--out", "TMP/torn.map"), "torn.map cannot be written")
            for suite in ("finding", "light", "one-click", "prints", "teaching")
        ),
        ((*CONSOLE, "--recording", "/no/such"), "no such file"),
        ((*CONSOLE, "--weights", "/no/such.onnx"), "/no/such.onnx: no such file"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused_before_anything_slow_begins(
    arguments: tuple[str, ...], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def begun(*_: object, **__: object) -> None:
        raise BadConfiguration("something slow has begun")

    for slow in (
        "app.runtime.start.preparation.prepared_perception",
        "app.runtime.start.segmentation.compose",
        "app.evaluation.perception.teaching.evaluate_teaching",
    ):
        monkeypatch.setattr(slow, begun)
    monkeypatch.setitem(sys.modules, "app.console.application", None)
    (tmp_path / "torn.map").write_bytes(b"PK")
    check_refusal(bewarenav(*(part.replace("TMP", str(tmp_path)) for part in arguments)), words)
    assert [file.name for file in tmp_path.iterdir()] == ["torn.map"]  # no folder of results


@pytest.mark.parametrize(
    ("suite", "left"),
    [("office", "the same command drives the rest"), ("teaching", "measures all again")],
)
def test_an_interrupted_evaluation_says_so_and_ends_with_130(
    suite: str, left: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr("app.cli.evaluate.command._evaluated", interrupted)
    answer = bewarenav("evaluate", suite)
    assert answer.returncode == 130
    assert left in answer.stderr


@pytest.mark.parametrize(
    ("options", "limit_s"),
    [
        ((), 3600.0),
        (("--max-time", "60"), 3600.0),
        (("--max-time", "1200"), 7200.0),
        (("--kept-map",), 10_800.0),
        (("--kept-map", "--engine", "ray"), 10_800.0),
    ],
)
def test_an_episode_of_a_worker_has_as_much_time_as_its_own_limit_needs(
    options: tuple[str, ...], limit_s: float, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    limits = list[float]()

    def driven(*_: object, fleet: Fleet, **__: object) -> dict[str, float]:
        assert isinstance(fleet.engine, Processes | RayCluster)
        limits.append(fleet.engine.limit_s)
        return {"success_rate": 1.0}

    monkeypatch.setattr("app.evaluation.driving.scenario.evaluate_scenario", driven)
    colour = ("--segmenter", "colour", "--workers", "2", "--out", str(tmp_path))
    assert bewarenav("evaluate", "office", "--random", *colour, *options).returncode == 0
    assert limits == [limit_s]


def test_a_process_ends_with_the_line_and_the_exit_code() -> None:
    check_refusal(bewarenav_process("drive", "--scenario", "nowhere"), "nowhere")


def check_refusal(answer: subprocess.CompletedProcess[str], words: str) -> None:
    """Assert that an answer is a refusal in one line that contains the words."""
    assert answer.returncode == 2
    last = answer.stderr.strip().splitlines()[-1]
    assert last.startswith("bewarenav: ")
    assert words in last
    assert "Traceback" not in answer.stderr


@pytest.mark.parametrize("option", ["--odometry", "--gnss"])
@pytest.mark.parametrize("command", [("console",), ("drive",), ("evaluate", "office")])
def test_a_sensor_that_the_simulated_robot_does_not_have_is_refused(
    command: tuple[str, ...], option: str
) -> None:
    answer = bewarenav(*command, option, "good")
    assert answer.returncode == 2
    assert option in answer.stderr and "'good'" in answer.stderr


def test_a_world_with_an_unknown_key_is_refused_by_key(tmp_path: Path) -> None:
    world = tmp_path / "w.toml"
    world.write_text('name = "w"\nsize_m = [8.0, 8.0]\nstart = [0.0, 0.0, 0.0]\ncolor = "red"\n')
    answer = bewarenav("drive", "--scenario", str(world))
    assert answer.returncode == 2
    assert "'color'" in answer.stderr


def test_a_busy_port_is_refused_with_port_and_remedy(tmp_path: Path) -> None:
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        answer = bewarenav("console", "--port", str(port), "--data", str(tmp_path))
    assert answer.returncode == 2
    assert str(port) in answer.stderr
    assert "--port" in answer.stderr


@pytest.mark.parametrize(
    "command",
    [
        (),
        ("console",),
        ("drive",),
        ("evaluate",),
        ("compare",),
        ("bench",),
        ("doctor",),
        ("plan",),
        ("weights",),
    ],
)
def test_every_level_has_help(command: tuple[str, ...]) -> None:
    answer = bewarenav(*command, "--help")
    assert answer.returncode == 0
    assert "Usage" in answer.stdout


def test_a_drive_writes_its_report_and_plots_and_ends_with_0(tmp_path: Path) -> None:
    report, plots = tmp_path / "out" / "r.json", tmp_path / "plots"
    answer = bewarenav(
        "drive",
        "--scenario",
        "empty_room",
        "--seed",
        "1",
        "--camera",
        "848x480@15",
        "--report",
        str(report),
        "--plots",
        str(plots),
        "--goal",
        "-1,-2.5",
        "--segmenter",
        "colour",
    )
    assert answer.returncode == 0, answer.stderr
    assert "1 of 1 goals" in answer.stdout
    said = json.loads(report.read_text())
    assert said["success"] is True
    assert said["camera"] == "848x480@15"
    names = ("frames", "progress", "top_view")
    assert sorted(path.name for path in plots.iterdir()) == [
        f"{name}.{kind}" for name in names for kind in ("png", "svg")
    ]


def test_an_official_checkpoint_is_converted_once_and_a_damaged_file_is_refused(
    tmp_path: Path,
) -> None:
    source, target = tmp_path / "official.pth", tmp_path / "converted.safetensors"
    torch.save({"state_dict": build("r18", 40, width=0.125).state_dict()}, source)
    assert (
        "r18, width 0.125, 40 classes"
        in bewarenav("weights", "convert", str(source), str(target)).stdout
    )
    assert "40 classes" in bewarenav("weights", "info", str(target)).stdout
    content = bytearray(target.read_bytes())
    content[-1] ^= 1
    target.write_bytes(content)
    answer = bewarenav("weights", "info", str(target))
    assert answer.returncode == 2
    assert "damaged" in answer.stderr


@pytest.mark.long
def test_navigation_parameters_are_read_from_a_file_and_a_wrong_key_is_named(
    tmp_path: Path,
) -> None:
    file = tmp_path / "nav.toml"
    file.write_text("[people]\nheedles = true\n")
    refused = bewarenav(
        "drive", "--scenario", "empty_room", "--navigation", str(file), "--segmenter", "colour"
    )
    assert refused.returncode == 2
    assert "nav.toml.people: unknown key 'heedles'" in refused.stderr
    assert (
        "nav.toml.people: unknown key 'heedles'"
        in bewarenav("evaluate", "clutter", "--navigation", str(file)).stderr
    )
    assert "nothing does" in bewarenav("evaluate", "finding", "--navigation", str(file)).stderr
    # A margin as wide as the passages leaves no path: the robot is driven by this file.
    report, driven_m = tmp_path / "r.json", []
    for margin_m in (0.15, 1.0):
        file.write_text(f"safety_margin_m = {margin_m}\n")
        options = (
            "--scenario",
            "clutter",
            "--segmenter",
            "colour",
            "--max-time",
            "6",
            "--report",
            str(report),
        )
        bewarenav("drive", "--navigation", str(file), *options)
        driven_m.append(json.loads(report.read_text())["distance_m"])
    assert 0.0 < driven_m[1] < driven_m[0] / 4


@pytest.mark.long
def test_a_drive_with_the_network_that_runs_out_of_time_ends_with_1() -> None:
    answer = bewarenav_process(
        "drive", "--scenario", "empty_room", "--max-time", "1", "--backend", "torch"
    )
    assert answer.returncode == 1
    assert "FAILED" in answer.stdout
