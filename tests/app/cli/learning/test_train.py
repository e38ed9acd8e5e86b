"""The commands around training: from imported labels to a model, its report and labelled images."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from app.cli.main import cli
from app.learning.prefetch import prefetching
from app.learning.training import chosen_device, uses_bfloat16
from navcore.errors import BadConfiguration
from navcore.learning.data.dataset import load_dataset
from navcore.learning.training.quantisation import Quantisation
from navcore.learning.training.recipe import Recipe
from navcore.perception.esanet import build
from navcore.perception.esanet.network.preprocess import Size
from navcore.perception.esanet.weights import weights_file as weights
from tests.navcore.learning.made import data_set
from tests.navcore.learning.test_importers import DEPTH, archive, labelme

RECIPE = """
width = 0.125
size = { height = 64, width = 64 }
epochs = 3
batch = 4
precision = "float32"
"""

SLOWED = """
import sys, time
from app.cli import main
from app.learning import training
update = training._ProgressDisplay.update
training._ProgressDisplay.update = lambda display, progress: (
    update(display, progress), time.sleep(0.2)
)
sys.argv = {arguments}
main.main()
"""


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    before, opencv = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
    cv2.setNumThreads(opencv)


def run(*words: object) -> str:
    result = CliRunner().invoke(cli, [str(word) for word in words])
    if result.exception is not None:
        raise result.exception
    return result.output


def test_a_model_is_trained_reported_and_used(tmp_path: Path) -> None:
    dataset = data_set(tmp_path / "d")
    (tmp_path / "r.toml").write_text(RECIPE.replace("epochs = 3", "epochs = 1"))
    out = tmp_path / "out"
    assert "book" in run(
        "train", tmp_path / "r.toml", "--data", tmp_path / "d", "--out", out, "--threads", 1
    )
    metrics = json.loads((out / "metrics.json").read_text())
    assert (metrics["split"], metrics["pictures"], list(metrics["iou"])) == (
        "test",
        2,
        ["floor", "book"],
    )
    card = json.loads((out / "card.json").read_text())
    assert card["recipe"]["width"] == 0.125
    assert card["data"]["source"] == {"made_by": "a test"}
    assert "| book |" in (out / "card.md").read_text()
    assert cv2.imread(str(out / "confusion.png")) is not None
    trained = weights.load(out / "model.safetensors")
    assert trained.card.source_sha256 == card["run"]
    assert trained.card.size == Size(height=64, width=64)

    told = run(
        "segment", out / "model.safetensors", "--data", tmp_path / "d", "--out", tmp_path / "seg"
    )
    assert f"{metrics['miou']:.4f}" in told
    assert (
        json.loads((tmp_path / "seg" / "metrics.json").read_text())["confusion"]
        == metrics["confusion"]
    )
    mask = cv2.imread(str(tmp_path / "seg" / "0000.mask.png"), cv2.IMREAD_UNCHANGED)
    assert mask is not None
    assert set(np.unique(mask)) <= {1, 2}
    rgb, depth, _ = (dataset.folder / path for path in dataset.files["test"][0])
    assert "%" in run("segment", out / "model.safetensors", "--rgb", rgb, "--depth", depth)
    assert "book" in run("dataset", "info", tmp_path / "d")
    with pytest.raises(BadConfiguration, match="holds a training run"):
        run("train", tmp_path / "r.toml", "--data", tmp_path / "d", "--out", out, "--threads", 1)


@pytest.mark.long
def test_a_killed_run_is_resumed_to_the_same_weights(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    (tmp_path / "r.toml").write_text(RECIPE)
    words = [
        "train",
        str(tmp_path / "r.toml"),
        "--data",
        str(tmp_path / "d"),
        "--threads",
        "1",
        "--out",
    ]
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    arguments = ["bewarenav", *words, str(killed)]
    child = subprocess.Popen(
        [sys.executable, "-c", SLOWED.format(arguments=arguments)], stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(1200):
            if (killed / "state.pt").exists() or child.poll() is not None:
                break
            time.sleep(0.05)
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait(30)
    assert not (killed / "metrics.json").exists()
    run(*words, killed, "--resume")
    run(*words, whole)
    histories = [
        json.loads((folder / "metrics.json").read_text())["history"] for folder in (killed, whole)
    ]
    assert histories[0] == histories[1]
    states = [
        torch.load(folder / "state.pt", weights_only=True)["network"] for folder in (killed, whole)
    ]
    assert all(torch.equal(states[0][key], states[1][key]) for key in states[1])


def test_a_rendered_data_set_may_have_images_of_several_sizes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sim.dataset.generate.WORLDS_PER_JOB", 1)
    sizes = ("--size", "64x48", "--size", "96x64")
    run(
        "dataset",
        "render",
        tmp_path / "d",
        "--train",
        "16",
        "--valid",
        "8",
        "--test",
        "0",
        *sizes,
    )
    dataset = load_dataset(tmp_path / "d")
    assert dataset.card.sizes == ((48, 64), (64, 96))
    shapes = [dataset.read("train", index).labels.shape for index in range(16)]
    assert shapes == [(48, 64)] * 8 + [(64, 96)] * 8


def test_rendering_with_interiors_is_told_in_the_card_and_changes_some_worlds(
    tmp_path: Path,
) -> None:
    counts = ("--train", "32", "--valid", "0", "--test", "0", "--size", "64x48")
    run("dataset", "render", tmp_path / "plain", *counts)
    run("dataset", "render", tmp_path / "furnished", *counts, "--interiors", "furnished")
    plain, furnished = (load_dataset(tmp_path / name) for name in ("plain", "furnished"))
    assert furnished.card.source == {**plain.card.source, "interiors": "furnished"}
    assert [plain.name("train", i) for i in range(32)] == [
        furnished.name("train", i) for i in range(32)
    ]
    same = [
        bool((plain.read("train", i).rgb == furnished.read("train", i).rgb).all())
        for i in range(32)
    ]
    assert 0 < sum(same) < len(same)


def test_a_killed_worker_ends_the_rendering_with_a_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.cli.learning.dataset._render", killed)
    with pytest.raises(BadConfiguration, match="ended with exit code -9; if memory is short"):
        run(
            "dataset",
            "render",
            tmp_path / "d",
            "--train",
            "8",
            "--valid",
            "0",
            "--test",
            "0",
            "--workers",
            "2",
        )


def killed(job: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_data_set_of_other_classes_or_units_is_refused_for_a_network(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    (tmp_path / "r.toml").write_text(RECIPE.replace("epochs = 3", "epochs = 1"))
    run(
        "train",
        tmp_path / "r.toml",
        "--data",
        tmp_path / "d",
        "--out",
        tmp_path / "out",
        "--threads",
        1,
    )
    model, card = tmp_path / "out" / "model.safetensors", tmp_path / "d" / "dataset.json"
    as_it_was = card.read_text()
    for found, instead, text in (
        ('"floor",\n  "book"', '"book",\n  "floor"', "names and order must be the same"),
        (
            '"units_per_m": 1000.0',
            '"units_per_m": 5000.0',
            "5000 units per metre, the network takes 1000",
        ),
    ):
        assert found in as_it_was
        card.write_text(as_it_was.replace(found, instead))
        fitted = [
            ("weights", words, model, tmp_path / "c.safetensors")
            for words in ("calibrate", "quantise")
        ]
        for words in (("segment", model), *fitted):
            with pytest.raises(BadConfiguration, match=text):
                run(*words, "--data", tmp_path / "d")
    card.write_text(as_it_was)
    run("weights", "calibrate", model, tmp_path / "c.safetensors", "--data", tmp_path / "d")
    data_set(tmp_path / "e", valid=0)
    with pytest.raises(BadConfiguration, match="no such images"):
        run("weights", "calibrate", model, tmp_path / "c2.safetensors", "--data", tmp_path / "e")


def test_ranges_for_eight_bits_go_into_the_card_unless_they_cost_too_much(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data_set(tmp_path / "d")
    of_data, model, target = (
        load_dataset(tmp_path / "d").card,
        tmp_path / "m.safetensors",
        tmp_path / "q.safetensors",
    )
    torch.manual_seed(0)
    network = build("r18-nbt1d", len(of_data.class_names), width=0.125).eval()
    card = weights.WeightsCard(
        variant="r18-nbt1d",
        num_classes=len(of_data.class_names),
        width=0.125,
        class_names=of_data.class_names,
        depth=of_data.depth,
        source_sha256="0" * 64,
        size=Size(height=64, width=64),
    )
    weights.save(network, card, model)
    said = run("weights", "quantise", model, target, "--data", tmp_path / "d", "--most-lost", 1)
    made = weights.load(target)
    assert made.card.ranges is not None
    assert dataclasses.replace(made.card, ranges=None) == card
    assert (
        f"{sum(most > 0 for most in made.card.ranges)} of {len(made.card.ranges)} convolutions"
        in said
    )
    assert "eight bits where an engine can" in run("weights", "info", target)
    assert all(
        torch.equal(value, network.state_dict()[key])
        for key, value in made.network.state_dict().items()
    )
    nan = float("nan")
    for in_bytes, without, why in ((0.48, 0.5, "cost more than"), (nan, nan, "have no labels")):
        costly = Quantisation(ranges=made.card.ranges, mean_iou_in_bytes=in_bytes, mean_iou=without)
        monkeypatch.setattr(
            "navcore.learning.training.quantisation.quantise", lambda *_, costly=costly: costly
        )
        with pytest.raises(BadConfiguration, match=why):
            run("weights", "quantise", model, tmp_path / "q2.safetensors", "--data", tmp_path / "d")
    with pytest.raises(BadConfiguration, match="expected a name ending in"):
        run("weights", "quantise", model, tmp_path / "q2.bin", "--data", tmp_path / "d")
    assert not (tmp_path / "q2.safetensors").exists()


def test_imported_labels_become_a_data_set(tmp_path: Path) -> None:
    folder = labelme(tmp_path / "l")
    run("dataset", "import", "labelme", folder, tmp_path / "a", "--classes", "background,book,cup")
    assert load_dataset(tmp_path / "a").card.class_names == ("background", "book", "cup")
    assert "no class is called background" in run(
        "dataset", "import", "labelme", folder, tmp_path / "a2"
    )
    assert "no class is called background" not in run(
        "dataset", "import", "labelme", folder, tmp_path / "a3", "--background"
    )
    (tmp_path / "depth").mkdir()
    cv2.imwrite(str(tmp_path / "depth" / "a.png"), DEPTH)
    told = run(
        "dataset",
        "import",
        "cvat",
        archive(tmp_path / "c.zip"),
        tmp_path / "b",
        "--depth-dir",
        tmp_path / "depth",
    )
    assert "0 images to train, 1 to validate" in told
    np.testing.assert_array_equal(load_dataset(tmp_path / "b").read("valid", 0).depth, DEPTH)


@pytest.mark.parametrize("there", [False, True])
def test_an_import_that_fails_leaves_the_folder_as_it_was(there: bool, tmp_path: Path) -> None:
    folder, out, depth = labelme(tmp_path / "l"), tmp_path / "out", tmp_path / "depth"
    if there:
        out.mkdir()
    command = ("dataset", "import", "labelme", folder, out, "--depth-dir", depth)
    with pytest.raises(BadConfiguration, match="depth: no such folder"):
        run(*command)
    depth.mkdir()
    with pytest.raises(BadConfiguration, match="no file for image 'a'"):
        run(*command)
    assert out.exists() == there
    cv2.imwrite(str(depth / "a.png"), DEPTH)
    assert "1 images to train" in run(*command)


@pytest.mark.parametrize("units", ["0", "-5", "nan"])
def test_units_of_depth_that_no_data_set_has_are_refused(units: str, tmp_path: Path) -> None:
    command = ("import", "labelme", str(labelme(tmp_path / "l")), str(tmp_path / "out"))
    result = CliRunner().invoke(cli, ["dataset", *command, "--units-per-m", units])
    assert result.exit_code == 2 and "--units-per-m" in result.output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("train", "--data", "/nowhere"), "no data set with a train split"),
        (("segment", "/nowhere.safetensors"), "either --rgb and --depth, or --data"),
        (("segment", "/nowhere.safetensors", "--data", "/nowhere"), "no such file"),
        (("dataset", "info", "/nowhere"), "no data set"),
        (("dataset", "import", "labelme", "/nowhere", "/nowhere/b"), "no labelme file"),
        (
            ("dataset", "import", "labelme", "/nowhere", "/nowhere/b", "--split", "some"),
            "expected one of train",
        ),
    ],
)
def test_impossible_commands_are_refused_by_name(words: tuple[str, ...], text: str) -> None:
    with pytest.raises(BadConfiguration, match=text):
        run(*words)


def test_items_are_prefetched_in_order_and_errors_arrive() -> None:
    assert list(prefetching(3)(lambda number: number * number, range(50))) == [
        number * number for number in range(50)
    ]
    assert list(prefetching(0)(str, [1, 2])) == ["1", "2"]
    with pytest.raises(ZeroDivisionError):
        list(prefetching(2)(lambda number: 1 // number, [1, 0, 1]))


def test_devices_and_precisions_are_chosen_or_refused() -> None:
    assert chosen_device("cpu").type == "cpu"
    for name in ("toaster", "mps", "meta"):
        with pytest.raises(BadConfiguration, match="--device"):
            chosen_device(name)
    assert uses_bfloat16(Recipe(precision="bfloat16"), torch.device("cpu"))
    assert not uses_bfloat16(Recipe(precision="float32"), torch.device("cpu"))
    assert os.environ.get("WORLD_SIZE") is None
