"""The choice of the segmenter, and the warning when it is not the intended one."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from app.runtime.start import segmentation
from app.runtime.start.engine_memory import KEPT_NETWORKS, ChosenEngine, EngineMemory, key_of
from app.runtime.start.segmentation import colour_perception, compose, measure_segmenter
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.config.perception.inference import InferenceConfig
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import default_beware_list
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.esanet import build
from navcore.perception.esanet.inference import selection
from navcore.perception.esanet.inference.network_file import SHIPPED, open_network
from navcore.perception.esanet.inference.selection import EngineBenchmark, TrialStep, open_inference
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size
from navcore.perception.esanet.weights.weights_file import WeightsCard, save
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import LabelSource
from navcore.robot.profile import HUSKY
from tests.navcore.scene import picture

NAMES = ("background", "books", "cup", "red floor")
DEPTH = DepthStatistics(mean=2000.0, std=1000.0, units_per_m=1000.0)


def weights(folder: Path, seed: int = 0) -> Path:
    torch.manual_seed(seed)
    path = folder / f"w{seed}.safetensors"
    card = WeightsCard(
        variant="r18-nbt1d",
        num_classes=4,
        width=1 / 8,
        class_names=NAMES,
        depth=DEPTH,
        source_sha256="0" * 64,
    )
    save(build("r18-nbt1d", 4, width=1 / 8).eval(), card, path)
    return path


def damaged(folder: Path) -> Path:
    path = weights(folder)
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    return path


@pytest.fixture
def torch_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure the engines of torch, which are always there, and each with a few images only."""
    monkeypatch.setattr(selection, "is_installed", lambda package: False)
    monkeypatch.setattr(
        segmentation, "InferenceConfig", functools.partial(InferenceConfig, trial_s=0.0)
    )


def test_without_shipped_weights_the_colour_rules_are_used_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        perception = compose(
            SegmenterChoice(), shipped=tmp_path / "none.safetensors", sensor=HUSKY.depth_sensor
        )
    assert isinstance(perception.segmenter, ColourSegmenter)
    assert perception.warning is not None
    assert "no trained weights" in perception.warning
    assert perception.warning in caplog.text


def test_damaged_weights_are_never_used(tmp_path: Path) -> None:
    broken = damaged(tmp_path)
    perception = compose(SegmenterChoice(), shipped=broken, sensor=HUSKY.depth_sensor)
    assert isinstance(perception.segmenter, ColourSegmenter)
    assert "damaged" in (perception.warning or "")
    with pytest.raises(BadConfiguration, match="damaged"):
        compose(SegmenterChoice(weights=broken), sensor=HUSKY.depth_sensor)


def test_a_network_asked_for_by_name_is_refused_when_it_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(BadConfiguration, match=r"none\.safetensors: no such file"):
        compose(
            SegmenterChoice(kind="network"),
            shipped=tmp_path / "none.safetensors",
            sensor=HUSKY.depth_sensor,
        )


def test_a_network_is_fused_with_the_colour_rules_and_knows_entries_by_name_and_alias(
    tmp_path: Path,
) -> None:
    perception = compose(
        SegmenterChoice(weights=weights(tmp_path), engine="torch", threads=1),
        sensor=HUSKY.depth_sensor,
    )
    assert isinstance(perception.segmenter, FusedSegmenter)
    assert perception.warning is None
    assert "torch f32" in perception.title
    beware = default_beware_list()
    found = {entry.name: perception.segmenter.source_of(entry) for entry in beware.classes}
    assert (found["red floor"], found["book"], found["cup"]) == (
        LabelSource.WEIGHED,
        LabelSource.NETWORK,
        LabelSource.NETWORK,
    )
    assert found["person"] is LabelSource.NOTHING
    labels = perception.segmenter.segment(picture(), beware)
    assert labels.class_ids.shape == labels.confidence.shape == picture().depth_m.shape


COMPOSED = """
import sys
from pathlib import Path
from app.runtime.start.segmentation import compose
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.robot.profile import DepthSensor
choice = SegmenterChoice(weights=Path(sys.argv[1]), engine="onnxruntime", threads=1)
perception = compose(choice, apart=sys.argv[2] == "apart", sensor=DepthSensor())
print("torch" in sys.modules, perception.identity)
"""


def composed(path: Path, where: str) -> tuple[str, str]:
    """Return whether a fresh process that composes a network has loaded torch, and its identity."""
    command = [sys.executable, "-c", COMPOSED, str(path), where]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    loaded, _, identity = output.strip().partition(" ")
    return loaded, identity


@pytest.mark.long
def test_a_network_prepared_apart_is_the_same_and_leaves_no_torch_in_the_process(
    tmp_path: Path,
) -> None:
    pytest.importorskip("onnxruntime")
    pytest.importorskip("onnx")
    path = weights(tmp_path)
    apart, within = composed(path, "apart"), composed(path, "within")
    assert (apart[0], within[0]) == ("False", "True")
    assert apart[1] == within[1]


@pytest.mark.long
def test_a_network_prepared_apart_is_refused_as_in_the_process_and_torch_can_run_it(
    tmp_path: Path,
) -> None:
    with pytest.raises(BadConfiguration, match="damaged"):
        compose(SegmenterChoice(weights=damaged(tmp_path)), apart=True, sensor=HUSKY.depth_sensor)
    choice = SegmenterChoice(weights=weights(tmp_path), engine="torch", threads=1)
    assert "torch f32" in compose(choice, apart=True, sensor=HUSKY.depth_sensor).title


@pytest.mark.long
def test_each_trial_of_an_engine_is_reported_and_says_when_the_machine_should_be_quiet(
    tmp_path: Path,
) -> None:
    steps: list[TrialStep] = []
    compose(
        SegmenterChoice(weights=weights(tmp_path), threads=1),
        inference=InferenceConfig(trial_s=0.0, fast_enough_ms=0.0),
        apart=True,
        watch=steps.append,
        sensor=HUSKY.depth_sensor,
    )
    count = steps[-1].all
    assert count >= 2 and steps[-1].done == count
    assert [step.done for step in steps] == sorted(step.done for step in steps)
    timed = [number for number, step in enumerate(steps) if step.is_timed]
    assert len(timed) >= 2
    assert not any(steps[number + 1].is_timed for number in timed), "each ends with its engine"


def test_other_weights_are_another_campaign_and_the_same_choice_gives_the_same_one(
    tmp_path: Path,
) -> None:
    first = compose(
        SegmenterChoice(weights=weights(tmp_path, 1), engine="torch", threads=1),
        sensor=HUSKY.depth_sensor,
    )
    other = compose(
        SegmenterChoice(weights=weights(tmp_path, 2), engine="torch", threads=1),
        sensor=HUSKY.depth_sensor,
    )
    assert len({first.identity, other.identity, colour_perception().identity}) == 3
    assert compose(first.choice, sensor=HUSKY.depth_sensor).identity == first.identity
    assert (
        compose(colour_perception().choice, sensor=HUSKY.depth_sensor).identity
        == colour_perception().identity
    )


@pytest.mark.long
def test_engines_are_measured_with_the_given_weights_or_with_random_ones_as_the_title_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    what, trials = measure_segmenter(weights(tmp_path), trial_s=0.0, threads=1)
    assert what.startswith("r18-nbt1d × 0.125, 4 classes, 416 × 256")
    assert trials[-1].name == "torch f32"
    assert all(0 < trial.p50_ms <= trial.p99_ms for trial in trials if trial.failure is None)
    monkeypatch.setattr("app.runtime.start.segmentation.SHIPPED", tmp_path / "none.safetensors")
    monkeypatch.setattr(
        "app.runtime.start.segmentation.benchmark_engines", lambda file, **how: iter(())
    )
    assert "RANDOM" in measure_segmenter()[0]
    with pytest.raises(BadConfiguration):
        measure_segmenter(tmp_path / "none.safetensors")


@pytest.mark.long
@pytest.mark.usefixtures("torch_alone")
def test_a_machine_too_slow_for_the_size_it_was_trained_at_gives_the_network_smaller_images(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    choice = SegmenterChoice(weights=weights(tmp_path), threads=1, live=True)
    monkeypatch.setattr("app.runtime.start.segmentation.SLOW_MS", 1e9)
    assert "416 × 256" in compose(choice, sensor=HUSKY.depth_sensor).title
    monkeypatch.setattr("app.runtime.start.segmentation.SLOW_MS", 0.0)
    small = compose(choice, sensor=HUSKY.depth_sensor)
    assert "320 × 192" in small.title
    assert "320 × 192" in small.identity
    assert "too slow" in caplog.text
    assert compose(small.choice, sensor=HUSKY.depth_sensor).identity == small.identity
    labels = small.segmenter.segment(picture(), default_beware_list())
    assert labels.class_ids.shape == picture().depth_m.shape
    # Without real time, or with an explicit engine, the full size is used however slow, for
    # reproducible results.
    assert (
        "416 × 256"
        in compose(dataclasses.replace(choice, live=False), sensor=HUSKY.depth_sensor).title
    )
    assert (
        "416 × 256"
        in compose(dataclasses.replace(choice, engine="torch"), sensor=HUSKY.depth_sensor).title
    )


def test_one_slow_engine_beside_a_quick_one_makes_no_image_smaller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = open_network(weights(tmp_path), camera=Size(height=240, width=424))
    engine, _ = open_inference(file, "torch", threads=1)
    trials = tuple(
        EngineBenchmark(name=f"{name} f32", p50_ms=ms, is_accurate=True)
        for name, ms in (("torch", 105.0), ("quick", 95.0))
    )
    monkeypatch.setattr(
        "app.runtime.start.segmentation.open_inference", lambda *_, **__: (engine, trials)
    )
    assert (
        "416 × 256"
        in compose(
            SegmenterChoice(weights=weights(tmp_path), live=True), sensor=HUSKY.depth_sensor
        ).title
    )


@pytest.mark.usefixtures("torch_alone")
def test_weights_without_a_size_of_their_own_take_the_one_nearest_to_the_cameras(
    tmp_path: Path,
) -> None:
    choice = SegmenterChoice(weights=weights(tmp_path), threads=1, camera=(640, 480))
    assert "640 × 480" in compose(choice, sensor=HUSKY.depth_sensor).title


@pytest.mark.long
@pytest.mark.usefixtures("torch_alone")
def test_the_chosen_engine_is_remembered_and_measured_again_only_on_request_or_when_too_slow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    # However busy the machine is meanwhile, it is not too slow.
    monkeypatch.setattr("app.runtime.start.segmentation.SLOWER", 1e9)
    memory = EngineMemory(tmp_path / "cache" / "engines.json")
    choice = SegmenterChoice(weights=weights(tmp_path), threads=1)
    first = compose(choice, memory=memory, sensor=HUSKY.depth_sensor)
    assert first.trials
    again = compose(
        choice, memory=EngineMemory(tmp_path / "cache" / "engines.json"), sensor=HUSKY.depth_sensor
    )
    assert (again.title, again.trials) == (first.title, ())
    assert first.image_ms == again.image_ms is not None, "the time it was chosen with"
    asked = compose(
        choice, memory=memory, inference=InferenceConfig(trial_s=0.0), sensor=HUSKY.depth_sensor
    )
    assert asked.trials
    other = compose(
        SegmenterChoice(weights=weights(tmp_path, 1), threads=1),
        memory=memory,
        sensor=HUSKY.depth_sensor,
    )
    assert other.trials, "the memory of one network is none of another"
    monkeypatch.setattr("app.runtime.start.segmentation.SLOWER", 0.0)
    with caplog.at_level(logging.WARNING):
        assert compose(choice, memory=memory, sensor=HUSKY.depth_sensor).trials
    assert "when it was chosen: measuring again" in caplog.text


@pytest.mark.usefixtures("torch_alone")
def test_a_named_engine_that_is_measured_replaces_none_that_was_chosen(tmp_path: Path) -> None:
    memory = EngineMemory(tmp_path / "engines.json")
    choice = SegmenterChoice(weights=weights(tmp_path), threads=1)
    assert compose(choice, memory=memory, sensor=HUSKY.depth_sensor).trials
    chosen = (tmp_path / "engines.json").read_text()
    named = dataclasses.replace(choice, engine="torch f32", measured=True)
    assert compose(named, memory=memory, sensor=HUSKY.depth_sensor).trials
    assert (tmp_path / "engines.json").read_text() == chosen


@pytest.mark.usefixtures("torch_alone")
def test_smaller_images_are_remembered_and_an_engine_that_is_gone_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    # However busy the machine is meanwhile, what is remembered has not become too slow.
    monkeypatch.setattr("app.runtime.start.segmentation.SLOWER", 1e9)
    memory = EngineMemory(tmp_path / "engines.json")
    choice = SegmenterChoice(weights=weights(tmp_path), threads=1, live=True)
    with monkeypatch.context() as slow:
        slow.setattr("app.runtime.start.segmentation.SLOW_MS", 0.0)
        assert "320 × 192" in compose(choice, memory=memory, sensor=HUSKY.depth_sensor).title
    again = compose(choice, memory=memory, sensor=HUSKY.depth_sensor)
    assert "320 × 192" in again.title and not again.trials
    key = key_of(
        open_network(weights(tmp_path), camera=Size(height=240, width=424)).sha256,
        live=True,
        threads=1,
        camera=(424, 240),
    )
    memory.remember(key, ChosenEngine(name="absent f32", p99_ms=1.0, smaller=False))
    assert compose(choice, memory=memory, sensor=HUSKY.depth_sensor).trials
    assert "absent f32 does not run any more" in caplog.text


@pytest.mark.parametrize("content", ["", "[]", '{"k": 3}', '{"k": {"name": "x"}}', "{"])
def test_a_memory_that_cannot_be_read_or_written_is_an_empty_one(
    tmp_path: Path, content: str
) -> None:
    file = tmp_path / "engines.json"
    file.write_text(content, encoding="utf-8")
    memory = EngineMemory(file)
    assert memory.recall("k") is None
    engine = ChosenEngine(name="torch f32", p99_ms=5.0, smaller=False)
    memory.remember("k", engine)
    assert memory.recall("k") == engine
    nowhere = EngineMemory(file / "below a file" / "engines.json")
    nowhere.remember("k", engine)
    assert nowhere.recall("k") is None


@pytest.mark.long
def test_a_later_start_opens_the_network_that_was_exported_in_eight_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("openvino")
    pytest.importorskip("onnx")
    memory = EngineMemory(tmp_path / "engines.json")
    choice = SegmenterChoice(weights=SHIPPED, threads=1)
    sha256 = hashlib.sha256(SHIPPED.read_bytes()).hexdigest()
    key = key_of(sha256, live=False, threads=1, camera=(424, 240))
    engine = ChosenEngine(name="openvino int8", p99_ms=1e6, smaller=False, title="shipped")
    memory.remember(key, engine)
    compose(choice, memory=memory, apart=True, sensor=HUSKY.depth_sensor)

    def refuse(*_: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr("app.runtime.start.segmentation.multiprocessing.get_context", refuse)
    (blob,) = (tmp_path / "compiled").glob("*.blob")
    compiled = blob.stat()
    later = compose(choice, memory=memory, apart=True, sensor=HUSKY.depth_sensor)
    assert later.choice.engine == "openvino int8"
    assert blob.stat().st_mtime_ns == compiled.st_mtime_ns, "it was not compiled again"
    blob.chmod(0o600)
    blob.write_bytes(blob.read_bytes()[: compiled.st_size // 2])
    assert (
        compose(choice, memory=memory, apart=True, sensor=HUSKY.depth_sensor).choice.engine
        == "openvino int8"
    )
    assert blob.stat().st_size > 0.9 * compiled.st_size, "a damaged one was"


def test_the_newest_of_what_engines_compiled_are_kept(tmp_path: Path) -> None:
    folder = EngineMemory(tmp_path / "engines.json").compiled()
    for age in range(KEPT_NETWORKS + 2):
        (folder / f"{age}.blob").touch()
        os.utime(folder / f"{age}.blob", (1e9 - age, 1e9 - age))
    EngineMemory(tmp_path / "engines.json").compiled()
    kept = {blob.stem for blob in folder.glob("*.blob")}
    assert kept == {str(age) for age in range(KEPT_NETWORKS)}


@pytest.mark.long
def test_a_later_start_opens_the_exported_network_without_torch_and_labels_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onnxruntime")
    pytest.importorskip("onnx")
    memory, path = EngineMemory(tmp_path / "memory" / "engines.json"), weights(tmp_path)
    choice = SegmenterChoice(weights=path, threads=1)
    key = key_of(
        hashlib.sha256(path.read_bytes()).hexdigest(), live=False, threads=1, camera=(424, 240)
    )
    engine = ChosenEngine(
        name="onnxruntime f32", p99_ms=1e6, smaller=False, title="r18-nbt1d × 0.125"
    )
    memory.remember(key, engine)
    first = compose(choice, memory=memory, apart=True, sensor=HUSKY.depth_sensor)
    (kept,) = (tmp_path / "memory" / "networks").glob("*.onnx")

    def refuse(*_: object) -> None:
        raise AssertionError("a process was started")

    with monkeypatch.context() as without:
        without.setattr("app.runtime.start.segmentation.multiprocessing.get_context", refuse)
        later = compose(choice, memory=memory, apart=True, sensor=HUSKY.depth_sensor)
        other = dataclasses.replace(choice, weights=weights(tmp_path, 2))
        with pytest.raises(AssertionError):
            compose(other, memory=memory, apart=True, sensor=HUSKY.depth_sensor)
    frame, beware = picture(), default_beware_list()
    assert (first.identity, first.title) == (later.identity, later.title)
    labels = [each.segmenter.segment(frame, beware).class_ids for each in (first, later)]
    assert (labels[0] == labels[1]).all()
    # A damaged file is exported again.
    kept.write_bytes(b"no network")
    assert (
        compose(choice, memory=memory, apart=True, sensor=HUSKY.depth_sensor).identity
        == first.identity
    )
    assert kept.read_bytes() != b"no network"
