"""Engines: all answer as torch in f32 does, and the choice among them is by time only where they
do."""

from __future__ import annotations

import copy
import dataclasses
import functools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from navcore.config.perception.inference import InferenceConfig
from navcore.errors import BadConfiguration
from navcore.perception.esanet import EsaNet, build
from navcore.perception.esanet.inference import selection as choice
from navcore.perception.esanet.inference.engine import Batch
from navcore.perception.esanet.inference.network_file import NetworkFile, nearest_size, open_network
from navcore.perception.esanet.inference.onnx_engines import (
    OnnxRuntimeInference,
    OpenVinoInference,
    is_installed,
)
from navcore.perception.esanet.inference.onnx_file import OnnxCard, exported, read_onnx, with_card
from navcore.perception.esanet.inference.selection import (
    DEFAULT_CONFIG,
    Candidate,
    EngineBenchmark,
    benchmark_engines,
    choose,
    open_inference,
    probe_images,
)
from navcore.perception.esanet.inference.torch_engine import TorchInference
from navcore.perception.esanet.network.batchnorm_folding import FixedPool, folded
from navcore.perception.esanet.network.preprocess import NYUV2_DEPTH, Preprocessor, Size, to_tensors
from navcore.perception.esanet.weights.weights_file import WeightsCard, save

SIZE = Size(
    height=96, width=128
)  # at 1/32 3 × 4: cells of the 5 × 5 pooling are not all of one size
NAMES = ("background", "book", "cup", "cable")
CARD = OnnxCard(class_names=NAMES, depth=NYUV2_DEPTH, size=SIZE)
needs_onnx = pytest.mark.skipif(
    not (is_installed("onnx") and is_installed("onnxruntime")),
    reason="onnx and onnxruntime are not installed",
)
needs_openvino = pytest.mark.skipif(
    not (is_installed("onnx") and is_installed("openvino")),
    reason="onnx and openvino are not installed",
)


@functools.cache
def network(variant: str = "r18-nbt1d") -> EsaNet:
    """As if trained: batch norms that are no identity."""
    torch.manual_seed(1)
    made = build(variant, len(NAMES), width=1 / 8).eval()
    for module in made.modules():
        if isinstance(module, nn.BatchNorm2d):
            assert module.running_mean is not None
            assert module.running_var is not None
            module.running_mean.normal_(0, 0.2)
            module.running_var.uniform_(0.5, 1.5)
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.normal_(module.bias, 0, 0.2)
    return made


def network_file(**changes: object) -> NetworkFile:
    made = NetworkFile(
        title="test",
        class_names=NAMES,
        depth=NYUV2_DEPTH,
        size=SIZE,
        sha256="0" * 64,
        features="f" * 64,
        network=network(),
    )
    return dataclasses.replace(made, **changes)  # type: ignore[arg-type]


@functools.cache
def onnx_bytes() -> bytes:
    return exported(network(), CARD)


def image() -> tuple[Batch, Batch]:
    return probe_images(SIZE, NYUV2_DEPTH)[0]


def reference(variant: str = "r18-nbt1d") -> Batch:
    with torch.inference_mode():
        answer: Batch = network(variant)(*(torch.from_numpy(batch) for batch in image())).numpy()
    return answer


def assert_close(answer: Batch, expected: Batch) -> None:
    assert (answer.shape, answer.dtype) == (expected.shape, np.dtype(np.float32))
    np.testing.assert_allclose(answer, expected, atol=1e-4 * float(expected.std()), rtol=0)


@pytest.mark.parametrize("variant", ["r18", "r18-nbt1d", "r50"])
def test_folding_batch_norms_changes_nothing_but_rounding_and_leaves_the_original_alone(
    variant: str,
) -> None:
    before = {key: value.clone() for key, value in network(variant).state_dict().items()}
    assert not any(
        isinstance(module, nn.BatchNorm2d) for module in folded(network(variant)).modules()
    )
    # In doubles, so that the tolerance is one of the folding and not of how far a CPU's single
    # precision is off in 50 layers.
    exact, images = (
        copy.deepcopy(network(variant)).double(),
        [torch.from_numpy(batch).double() for batch in image()],
    )
    with torch.inference_mode():
        expected, answer = exact(*images), folded(exact)(*images)
    torch.testing.assert_close(answer, expected, atol=1e-11 * float(expected.std()), rtol=0)
    assert all(
        torch.equal(value, before[key]) for key, value in network(variant).state_dict().items()
    )


def test_torch_answers_as_the_network_does() -> None:
    assert_close(TorchInference(network()).logits(*image()), reference())


@pytest.mark.parametrize(("height", "width"), [(3, 4), (5, 10), (8, 13), (1, 1), (17, 6)])
def test_pooling_by_constant_matrices_is_adaptive_pooling(height: int, width: int) -> None:
    x = torch.randn(2, 3, height, width, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(
        FixedPool(5, height, width)(x), nn.AdaptiveAvgPool2d(5)(x), atol=1e-6, rtol=1e-5
    )


def test_the_fast_preprocessing_is_the_plain_one_to_the_last_bit() -> None:
    rng = np.random.default_rng(0)
    rgb = rng.integers(0, 256, (120, 212, 3), dtype=np.uint8)
    depth = rng.uniform(0, 9000, (120, 212)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.2] = 0
    expected = to_tensors(rgb, depth, SIZE, NYUV2_DEPTH)
    for fast, plain in zip(Preprocessor(SIZE, NYUV2_DEPTH)(rgb, depth), expected, strict=True):
        np.testing.assert_array_equal(fast, plain.numpy())


@needs_onnx
def test_onnxruntime_answers_as_torch_does() -> None:
    assert_close(OnnxRuntimeInference(onnx_bytes(), threads=1).logits(*image()), reference())


@needs_openvino
def test_openvino_answers_as_torch_does() -> None:
    assert_close(OpenVinoInference(onnx_bytes(), threads=1).logits(*image()), reference())


@needs_openvino
def test_openvino_does_without_a_folder_that_cannot_be_used(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    engine = OpenVinoInference(onnx_bytes(), threads=1, compiled=tmp_path / "file" / "folder")
    assert_close(engine.logits(*image()), reference())


def features_of_torch() -> Batch:
    return TorchInference(network()).logits_and_features(*image())[1]


@needs_onnx
@needs_openvino
def test_every_engine_gives_the_features_that_the_classifier_sees_beside_the_same_logits() -> None:
    for engine in (OnnxRuntimeInference(onnx_bytes()), OpenVinoInference(onnx_bytes())):
        assert engine.has_features
        logits, features = (batch.copy() for batch in engine.logits_and_features(*image()))
        assert_close(features, features_of_torch())
        np.testing.assert_array_equal(logits, engine.logits(*image()))
    with torch.inference_mode():
        decoder = network().decoder
        again = decoder.upsample2(decoder.upsample1(decoder.conv_out(torch.from_numpy(features))))
    assert_close(again.numpy(), reference())


@pytest.mark.long
@needs_onnx
@pytest.mark.parametrize("package", ["onnxruntime", "openvino", "onnx"])
def test_a_package_that_does_not_fit_the_machine_leaves_the_choice_to_the_others(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / f"{package}.py").write_text(
        'raise ImportError("libm.so.6: version GLIBC_2.38 not found")\n'
    )
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)
    trials = [
        trial
        for _, trial in benchmark_engines(
            network_file(), threads=1, config=InferenceConfig(trial_s=0.0)
        )
    ]
    failed = {trial.name.partition(" ")[0] for trial in trials if trial.failure}
    assert failed == ({"onnxruntime", "openvino"} if package == "onnx" else {package})
    engine, _ = choose(network_file(), threads=1)
    assert engine.logits(*image()).shape == reference().shape


@needs_openvino
def test_openvino_sends_no_telemetry(tmp_path: Path) -> None:
    """By default OpenVINO writes `~/intel` and sends events to its maker."""
    program = """
import socket, sys, threading
from navcore.errors import BadConfiguration
from navcore.perception.esanet.inference.onnx_engines import OpenVinoInference
def refuse(*_): raise SystemExit("it opened a connection")
socket.socket.connect = socket.getaddrinfo = refuse
try: OpenVinoInference(b"junk")
except BadConfiguration: pass
telemetry = [name for name in sys.modules if name.startswith("openvino_telemetry")]
assert not [name for name in telemetry if sys.modules[name]]
assert "openvino" in sys.modules
"""
    home = {**os.environ, "HOME": str(tmp_path)}
    ended = subprocess.run(
        [sys.executable, "-c", program], env=home, capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert list(tmp_path.iterdir()) == []


@needs_onnx
def test_an_onnx_file_carries_its_card_and_a_file_beside_it_takes_precedence(
    tmp_path: Path,
) -> None:
    path = tmp_path / "network.onnx"
    path.write_bytes(onnx_bytes())
    assert read_onnx(path) == (onnx_bytes(), CARD)
    opened = open_network(path, camera=Size(height=240, width=424))
    assert (opened.class_names, opened.size, opened.network) == (NAMES, SIZE, None)
    beside = path.with_name("network.onnx.json")
    text = '{"class_names": ["a", "b", "c", "d"], "depth": {"mean": 1, "std": 1, "units_per_m": 1}'
    beside.write_text(text + ', "size": {"height": 96, "width": 128}}')
    assert read_onnx(path)[1].class_names == ("a", "b", "c", "d")
    engine, _ = open_inference(opened, "onnxruntime", threads=1)
    assert_close(engine.logits(*image()), reference())
    with pytest.raises(BadConfiguration, match="torch does not run ONNX"):
        open_inference(opened, "torch")


@needs_onnx
def test_the_onnx_package_reads_the_card_that_was_appended_without_it() -> None:
    import onnx

    model = onnx.load_from_string(onnx_bytes())
    onnx.checker.check_model(model)
    assert [entry.key for entry in model.metadata_props] == ["bewarenav"]
    assert [port.name for port in model.graph.input] == ["rgb", "depth"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "does not say what its outputs mean"),
        (b"\x72", "cut off"),
        (b"\x72\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff", "not an ONNX file"),
        (b"not an onnx file", "not an ONNX file"),
        (with_card(b"", dataclasses.replace(CARD, class_names=("a",)))[:-9], "cut off"),
        (with_card(b"", CARD).replace(b"class_names", b"class_namez"), "class_namez"),
        (with_card(b"", CARD).replace(b'"height": 96', b'"height": 97'), "multiple of 32"),
        (with_card(b"", CARD).replace(b'"book"', b'"cup" '), "unique"),
    ],
)
def test_a_file_that_is_no_network_or_has_a_bad_card_is_refused_by_name(
    tmp_path: Path, content: bytes, words: str
) -> None:
    path = tmp_path / "bad.onnx"
    path.write_bytes(content)
    with pytest.raises(BadConfiguration, match=words) as refusal:
        read_onnx(path)
    assert "bad.onnx" in str(refusal.value)


@needs_onnx
def test_a_card_around_something_else_is_refused_by_the_engine() -> None:
    nothing = network_file(network=None, onnx=with_card(b"", CARD))
    for engine, why in (
        ("onnxruntime", "ModelProto|protobuf|graph"),
        ("openvino", "Unable to read the model"),
    ):
        if is_installed(engine):
            with pytest.raises(
                BadConfiguration, match=f"{engine} cannot run the network: .*({why})"
            ):
                open_inference(nothing, engine)
    with pytest.raises(BadConfiguration, match=r"no engine runs this network .*: run `make setup`"):
        choose(network_file(network=None, onnx=with_card(b"", CARD)))


def test_weights_from_the_disk_take_the_size_nearest_to_the_camera(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    card = WeightsCard(
        variant="r18-nbt1d",
        num_classes=4,
        width=1 / 8,
        class_names=NAMES,
        depth=NYUV2_DEPTH,
        source_sha256="0" * 64,
    )
    save(network(), card, path)
    assert open_network(path, camera=Size(height=240, width=424)).size == Size(
        height=256, width=416
    )
    with pytest.raises(BadConfiguration, match=r"\.safetensors or \.onnx"):
        open_network(tmp_path / "w.pth", camera=SIZE)


@pytest.mark.parametrize(
    ("camera", "size"), [((240, 424), (256, 416)), ((480, 640), (480, 640)), ((32, 40), (32, 32))]
)
def test_the_nearest_working_size_is_of_multiples_of_32(
    camera: tuple[int, int], size: tuple[int, int]
) -> None:
    assert nearest_size(Size(height=camera[0], width=camera[1])) == Size(
        height=size[0], width=size[1]
    )


class Slow:
    """An engine that takes the time it is told to, by a clock of its own, and errs as often as it
    is told to."""

    def __init__(self, name: str, ms: float, wrong: float, clock: list[float]) -> None:
        self.name, self._ms, self._wrong, self._clock = name, ms, wrong, clock

    has_features = False

    def for_another_thread(self) -> Slow:
        return self

    def logits_and_features(self, rgb: Batch, depth: Batch) -> tuple[Batch, Batch]:
        raise NotImplementedError

    def logits(self, rgb: Batch, depth: Batch) -> Batch:
        self._clock[0] += self._ms / 1e3
        answer = np.zeros((1, len(NAMES), *rgb.shape[2:]), dtype=np.float32)
        answer.reshape(len(NAMES), -1)[1, : round(self._wrong * answer[0, 0].size)] = 1.0
        return answer


def installed(
    monkeypatch: pytest.MonkeyPatch, *engines: tuple[str, float, float]
) -> list[Candidate]:
    """Install only these engines: name, milliseconds, share of wrong pixels."""
    clock = [0.0]
    monkeypatch.setattr(
        "navcore.perception.esanet.inference.selection.time.perf_counter", lambda: clock[0]
    )
    made = [
        Candidate(
            name=name,
            build=functools.partial(Slow, name, ms, wrong, clock),
            min_agreement=DEFAULT_CONFIG.min_agreement_int8
            if name.endswith("int8")
            else DEFAULT_CONFIG.min_agreement,
        )
        for name, ms, wrong in engines
    ]
    monkeypatch.setattr(choice, "candidates", lambda file, threads, config, compiled=None: made)
    return made


def chosen(monkeypatch: pytest.MonkeyPatch, *engines: tuple[str, float, float]) -> tuple[str, int]:
    """Return the chosen engine and the number of engines tried."""
    installed(monkeypatch, *engines)
    engine, trials = choose(network_file())
    return engine.name, len(trials)


def test_the_first_engine_that_is_fast_enough_and_agrees_with_the_reference_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bad, slow, torch_slow = (
        2 * (1 - DEFAULT_CONFIG.min_agreement),
        2 * DEFAULT_CONFIG.fast_enough_ms,
        ("torch f32", 4 * DEFAULT_CONFIG.fast_enough_ms, 0),
    )
    assert chosen(
        monkeypatch,
        ("ort f32", 0.9 * DEFAULT_CONFIG.fast_enough_ms, 0.0005),
        ("other f32", 1, 0),
        torch_slow,
    ) == ("ort f32", 1)
    assert chosen(monkeypatch, ("wild bf16", 5, bad), ("ort f32", 20, 0), torch_slow) == (
        "ort f32",
        2,
    )
    assert chosen(monkeypatch, ("ort bf16", slow, 0), ("ort f32", 2 * slow, 0), torch_slow) == (
        "ort bf16",
        3,
    )
    assert chosen(monkeypatch, ("wild bf16", 5, bad), torch_slow) == ("torch f32", 2)
    just, quick = (
        ("ort f32", 1.04 * DEFAULT_CONFIG.fast_enough_ms, 0),
        ("torch bf16", 0.96 * DEFAULT_CONFIG.fast_enough_ms, 0),
    )
    assert chosen(monkeypatch, just, quick, torch_slow) == ("torch bf16", 2)


def test_the_most_exact_engine_is_taken_of_those_that_the_fastest_does_not_clearly_beat(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert chosen(monkeypatch, ("ort bf16", 95, 0), ("torch f32", 100, 0)) == ("torch f32", 2)
    assert chosen(monkeypatch, ("ort bf16", 85, 0), ("torch f32", 100, 0)) == ("ort bf16", 2)
    assert chosen(
        monkeypatch, ("ov f32", 100, 0), ("torch bf16", 95, 0), ("torch f32", 300, 0)
    ) == ("ov f32", 3)
    in_steps = (
        ("a int8", 95, 0),
        ("a bf16", 104, 0),
        ("a f32", 116, 0),
        ("b f32", 128, 0),
        ("torch f32", 142, 0),
    )
    assert chosen(monkeypatch, *in_steps) == ("a bf16", 5)


def test_engines_are_compared_by_their_slow_images(monkeypatch: pytest.MonkeyPatch) -> None:
    int8, bf16 = (
        (Slow(name, p50, 0, [0.0]), EngineBenchmark(
            name=name, p50_ms=p50, p99_ms=p99, agreement=1.0, is_accurate=True
        ))
        for name, p50, p99 in (("ov int8", 79.8, 81.0), ("torch bf16", 86.9, 224.0))
    )  # fmt: skip
    monkeypatch.setattr(choice, "benchmark_engines", lambda file, **_: iter([int8, bf16]))
    assert choose(network_file())[0].name == "ov int8"


def test_what_is_not_exact_is_no_reference_and_eight_bits_may_differ_by_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert chosen(monkeypatch, ("exact f32", 90, 0), ("wild bf16", 5, 0.5)) == ("exact f32", 2)
    assert chosen(monkeypatch, ("odd f32", 5, 0.5), ("torch f32", 90, 0)) == (
        "torch f32",
        2,
    )  # the last exact one is right
    for wrong, expected in (
        (0.5 * (1 - DEFAULT_CONFIG.min_agreement_int8), "ov int8"),
        (2 * (1 - DEFAULT_CONFIG.min_agreement_int8), "torch f32"),
    ):
        assert chosen(monkeypatch, ("ov int8", 5, wrong), ("torch f32", 90, 0))[0] == expected


@needs_openvino
def test_torch_comes_last_as_the_reference_and_only_eight_bits_may_differ_by_a_hundredth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    of_files = network_file(ranges=(0.0,))
    for has_bf16 in (True, False):
        monkeypatch.setattr(choice, "has_bf16", lambda has_bf16=has_bf16: has_bf16)
        found = {
            candidate.name: candidate.min_agreement for candidate in choice.candidates(of_files)
        }
        assert list(found)[-1] == "torch f32"
        assert ("openvino bf16" in found) == has_bf16
        assert {name for name, least in found.items() if least != DEFAULT_CONFIG.min_agreement} == {
            "openvino int8"
        }
        assert found["openvino int8"] == DEFAULT_CONFIG.min_agreement_int8


@pytest.mark.parametrize(
    "answer",
    [
        np.float32(1),
        np.zeros((1, 2, 3, 3), np.float32),
        np.full((1, 4, 96, 128), np.nan, np.float32),
    ],
)
def test_an_answer_of_another_shape_or_none_at_all_fails_its_trial(
    monkeypatch: pytest.MonkeyPatch, answer: Batch
) -> None:
    made = installed(monkeypatch, ("odd f32", 5, 0), ("torch f32", 90, 0))
    odd = Slow("odd f32", 5, 0, [0.0])
    monkeypatch.setattr(odd, "logits", lambda rgb, depth: np.asarray(answer))
    made[0] = dataclasses.replace(made[0], build=lambda: odd)
    trials = [trial for _, trial in benchmark_engines(network_file())]
    assert [trial.failure is None for trial in trials] == [False, True]
    assert choose(network_file())[0].name == "torch f32"


def test_an_engine_that_fails_is_passed_over_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> Slow:
        raise BadConfiguration("it has no licence")

    (torch_f32,) = installed(monkeypatch, ("torch f32", 40, 0))
    broken = Candidate(name="broken f32", build=fail)
    for made in ([broken, torch_f32], [torch_f32, broken]):
        monkeypatch.setattr(choice, "candidates", lambda file, threads, config, made=made: made)
        trials = [trial for _, trial in benchmark_engines(network_file())]
        assert {trial.name: trial.failure for trial in trials} == {
            "torch f32": None,
            "broken f32": "it has no licence",
        }
        assert choose(network_file())[0].name == "torch f32"
    assert "it has no licence" in trials[1].text()


def test_an_engine_that_is_named_is_measured_on_request_and_refused_where_it_is_wrong(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    installed(monkeypatch, ("good f32", 5, 0), ("wild bf16", 5, 0.5), ("torch f32", 90, 0))
    engine, (trial,) = open_inference(network_file(), "good", measured=True)
    assert (engine.name, trial.name, trial.agreement) == ("good f32", "good f32", 1.0)
    assert trial.p50_ms == pytest.approx(5)
    assert open_inference(network_file(), "wild bf16")[0].name == "wild bf16"
    with pytest.raises(BadConfiguration, match=r"wild bf16.*agrees in 50.*has to in 99\.9%"):
        open_inference(network_file(), "wild bf16", measured=True)


def test_an_engine_that_is_not_there_is_refused_with_the_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(choice, "is_installed", lambda package: False)
    with pytest.raises(BadConfiguration, match=r"openvino is not installed.*make setup"):
        open_inference(network_file(), "openvino")
    engine, trials = open_inference(network_file(), "torch", threads=1)
    assert (engine.name, trials) == ("torch f32", ())
