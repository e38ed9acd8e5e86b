"""Selection of the engine by measurement: a fast one that decides as torch in f32 does, or else the
fastest."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from navcore.config.perception.inference import InferenceConfig
from navcore.errors import BadConfiguration
from navcore.perception.esanet.inference.engine import THREADS, Batch, Inference, check_logits
from navcore.perception.esanet.inference.network_file import NetworkFile
from navcore.perception.esanet.inference.onnx_engines import (
    OnnxRuntimeInference,
    OpenVinoInference,
    has_bf16,
    is_installed,
)
from navcore.perception.esanet.inference.onnx_file import INSTALL, can_export
from navcore.perception.esanet.network.preprocess import DepthStatistics, Preprocessor, Size

PRECISIONS = ("int8", "bf16", "f32")
"""Precisions of the engines, increasingly exact."""
DEFAULT_CONFIG = InferenceConfig()
PROBES, PROBE_SEED = 3, 7
"""Number and random seed of the synthetic images."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineBenchmark:
    """Measurement of one engine."""

    name: str
    """Engine and precision, e.g. `openvino f32`."""
    p50_ms: float = 0.0
    """Median time per image in milliseconds, without resizing and labelling."""
    p99_ms: float = 0.0
    """99th percentile of the time per image in milliseconds."""
    agreement: float = 0.0
    """Share of the pixels of the probe images with the class of the reference."""
    is_accurate: bool = False
    """Whether the agreement is sufficient."""
    failure: str | None = None
    """Why the engine cannot be used; None when it ran."""

    def text(self) -> str:
        """Return the measurement as one line."""
        if self.failure is not None:
            return f"{self.name}: {self.failure}"
        return (
            f"{self.name} {self.p50_ms:.1f} ms (p99 {self.p99_ms:.1f}), "
            f"agrees in {self.agreement:.2%} of the pixels"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialStep:
    """How far the trials of the engines are."""

    done: int
    """Number of engines that have been tried."""
    all: int
    """Number of engines to try at most."""
    is_timed: bool
    """Whether an engine is being timed, so that the machine should be left alone."""


def _unwatched(step: TrialStep) -> None:
    """Tell no one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """An engine that may be tried."""

    name: str
    """Engine and precision, e.g. `openvino f32`."""
    build: Callable[[], Inference]
    """Builds the engine; may raise `BadConfiguration`."""
    min_agreement: float = DEFAULT_CONFIG.min_agreement
    """Smallest share of pixels in which it must decide as the reference does."""

    @property
    def is_exact(self) -> bool:
        """Whether the engine may be the reference."""
        return self.name.endswith("f32")


def open_inference(
    file: NetworkFile,
    engine: str,
    *,
    threads: int = THREADS,
    config: InferenceConfig = DEFAULT_CONFIG,
    watch: Callable[[TrialStep], None] = _unwatched,
    compiled: Path | None = None,
    measured: bool = False,
) -> tuple[Inference, tuple[EngineBenchmark, ...]]:
    """Open an engine by name, or with `auto` the best one here; return it with its measurements.

    `watch` is told of each step of the trials. `compiled` is the folder in which an engine that is
    opened by name keeps what it compiled. With `measured` such an engine is measured, too.

    Names are `torch`, `onnxruntime` or `openvino`, in f32 unless followed by `bf16` or `int8`.
    Raises `BadConfiguration` when the engine is not installed or cannot run the network, and when
    it was measured and is not accurate.
    """
    if engine == "auto":
        return choose(file, threads=threads, config=config, watch=watch)
    name = engine.replace("-", " ")
    for candidate in candidates(file, threads, config, compiled):
        if candidate.name == (name if " " in name else f"{name} f32"):
            if measured:
                return _accurate(file, candidate, threads=threads, config=config, watch=watch)
            return candidate.build(), ()
    if file.network is None and engine.startswith("torch"):
        raise BadConfiguration("torch does not run ONNX files; choose onnxruntime or openvino")
    raise BadConfiguration(
        f"{engine} is not installed here, or the onnx package is not ({INSTALL}), or processor or "
        "weights do not support it"
    )


def choose(
    file: NetworkFile,
    *,
    threads: int = THREADS,
    config: InferenceConfig = DEFAULT_CONFIG,
    watch: Callable[[TrialStep], None] = _unwatched,
) -> tuple[Inference, tuple[EngineBenchmark, ...]]:
    """Measure the installed engines, the presumably fastest first, until one is accurate and fast
    enough; else take the most exact one that is not clearly slower than the fastest.

    Engines are compared by the 99th percentile of their times: the slow images are those that the
    robot waits for."""
    good: list[tuple[Inference, EngineBenchmark]] = []
    trials = []
    for engine, trial in benchmark_engines(file, threads=threads, config=config, watch=watch):
        trials.append(trial)
        if engine is not None and trial.is_accurate:
            good.append((engine, trial))
            if trial.p99_ms <= config.fast_enough_ms:
                return engine, tuple(trials)
    if not good:
        reasons = (
            "; ".join(trial.text() for trial in trials)
            or "an ONNX file needs onnxruntime or openvino"
        )
        raise BadConfiguration(f"no engine runs this network ({reasons}): {INSTALL}")
    least_ms = min(trial.p99_ms for _, trial in good)
    near = [one for one in good if config.clear_advantage * one[1].p99_ms <= least_ms]
    chosen, _ = max(
        near, key=lambda one: (PRECISIONS.index(one[1].name.split()[-1]), -one[1].p99_ms)
    )
    return chosen, tuple(trials)


def _accurate(
    file: NetworkFile,
    candidate: Candidate,
    *,
    threads: int,
    config: InferenceConfig,
    watch: Callable[[TrialStep], None],
) -> tuple[Inference, tuple[EngineBenchmark, ...]]:
    """Return an engine with its measurement; raises `BadConfiguration` where it fails, or decides
    otherwise than the reference."""
    ((engine, trial),) = benchmark_engines(
        file, threads=threads, config=config, watch=watch, only=candidate.name
    )
    if engine is None:
        raise BadConfiguration(trial.text())
    if not trial.is_accurate:
        least = f"it has to in {candidate.min_agreement:.1%}"
        raise BadConfiguration(f"{trial.text()}, {least}")
    return engine, (trial,)


def benchmark_engines(
    file: NetworkFile,
    *,
    threads: int = THREADS,
    config: InferenceConfig = DEFAULT_CONFIG,
    watch: Callable[[TrialStep], None] = _unwatched,
    only: str | None = None,
) -> Iterator[tuple[Inference | None, EngineBenchmark]]:
    """Yield each engine, or the `only` one, with its measurement; None for an engine that failed.

    The reference is the last exact engine that runs: torch, where it can run the file.
    """
    images = probe_images(file.size, file.depth)
    found = candidates(file, threads, config)
    classes = len(file.class_names)
    reference = _reference(found, images, classes)
    found = [candidate for candidate in found if only in (None, candidate.name)]
    for done, candidate in enumerate(found):
        watch(TrialStep(done=done, all=len(found), is_timed=False))
        try:
            engine = candidate.build()
            predictions = _predictions(engine, images, classes)
            if reference is None:
                raise BadConfiguration("no exact engine runs to compare it with")
        except BadConfiguration as error:
            yield None, EngineBenchmark(name=candidate.name, failure=str(error))
            continue
        agreement = float(
            np.mean([np.mean(a == b) for a, b in zip(predictions, reference, strict=True)])
        )
        watch(TrialStep(done=done, all=len(found), is_timed=True))
        p50_ms, p99_ms = np.percentile(run_times_ms(engine, images, config), [50, 99])
        watch(TrialStep(done=done + 1, all=len(found), is_timed=False))
        yield (
            engine,
            EngineBenchmark(
                name=candidate.name,
                p50_ms=float(p50_ms),
                p99_ms=float(p99_ms),
                agreement=agreement,
                is_accurate=agreement >= candidate.min_agreement,
            ),
        )


def candidates(
    file: NetworkFile,
    threads: int = THREADS,
    config: InferenceConfig = DEFAULT_CONFIG,
    compiled: Path | None = None,
) -> list[Candidate]:
    """Return the installed engines that fit the file, the presumably fastest first; `compiled` as
    in `open_inference`."""
    found, onnx = [], functools.cache(file.as_onnx)
    openvino = functools.partial(OpenVinoInference, threads=threads, compiled=compiled)
    exportable = file.network is None or can_export()
    if exportable and is_installed("openvino"):
        if file.ranges is not None:
            found.append(
                Candidate(
                    name="openvino int8",
                    build=lambda: openvino(onnx(in_bytes=True), precision="int8"),
                    min_agreement=config.min_agreement_int8,
                )
            )
        if has_bf16():
            found.append(
                Candidate(
                    name="openvino bf16",
                    min_agreement=config.min_agreement,
                    build=lambda: openvino(onnx(), precision="bf16"),
                )
            )
        found.append(
            Candidate(
                name="openvino f32",
                min_agreement=config.min_agreement,
                build=lambda: openvino(onnx()),
            )
        )
    if exportable and is_installed("onnxruntime"):
        found.append(
            Candidate(
                name="onnxruntime f32",
                min_agreement=config.min_agreement,
                build=lambda: OnnxRuntimeInference(onnx(), threads=threads),
            )
        )
    if (network := file.network) is not None:
        from navcore.perception.esanet.inference.torch_engine import TorchInference

        if has_bf16():  # without it an image takes seconds
            found.append(
                Candidate(
                    name="torch bf16",
                    min_agreement=config.min_agreement,
                    build=lambda: TorchInference(network, precision="bf16", threads=threads),
                )
            )
        found.append(
            Candidate(
                name="torch f32",
                min_agreement=config.min_agreement,
                build=lambda: TorchInference(network, threads=threads),
            )
        )
    return found


def run_times_ms(
    engine: Inference, images: list[tuple[Batch, Batch]], config: InferenceConfig
) -> npt.NDArray[np.float64]:
    """Return the milliseconds (N,) of single images on a warm engine."""
    durations: list[float] = []
    end = time.perf_counter() + config.trial_s
    while len(durations) < config.min_runs or (
        time.perf_counter() < end and len(durations) < config.max_runs
    ):
        start = time.perf_counter()
        engine.logits(*images[len(durations) % len(images)])
        durations.append((time.perf_counter() - start) * 1e3)
    return np.array(durations)


def probe_images(size: Size, statistics: DepthStatistics) -> list[tuple[Batch, Batch]]:
    """Return preprocessed synthetic rooms, always the same: a floor, a wall, coloured boxes, noise,
    holes in the depth."""
    rng, prepare = np.random.default_rng(PROBE_SEED), Preprocessor(size, statistics)
    made = []
    for _ in range(PROBES):
        rows, cols = np.mgrid[0 : size.height, 0 : size.width].astype(np.float32)
        depth_m = np.minimum(0.6 * size.height / np.maximum(rows - 0.3 * size.height, 1.0), 5.0)
        rgb = np.full((size.height, size.width, 3), 150.0) + 20 * np.sin(cols / 40)[..., None]
        for _ in range(8):
            top, left = rng.integers(0, size.height - 16), rng.integers(0, size.width - 16)
            box = (
                slice(top, top + rng.integers(8, size.height // 2)),
                slice(left, left + rng.integers(8, size.width // 3)),
            )
            rgb[box] = rng.uniform(0, 255, 3)
            depth_m[box] = rng.uniform(0.5, 4.0)
        depth_m[rng.random(depth_m.shape) < 0.02] = 0.0
        noisy = np.clip(rgb + rng.normal(0, 4, rgb.shape), 0, 255).astype(np.uint8)
        colour, distance = prepare(noisy, (depth_m * statistics.units_per_m).astype(np.float32))
        made.append((colour.copy(), distance))
    return made


def _reference(
    found: list[Candidate], images: list[tuple[Batch, Batch]], classes: int
) -> list[npt.NDArray[np.int64]] | None:
    """Return the classes that the last exact engine that runs decides; None if none runs."""
    for candidate in reversed(found):
        if candidate.is_exact:
            try:
                return _predictions(candidate.build(), images, classes)
            except BadConfiguration:
                continue  # its failure is reported by its own trial
    return None


def _predictions(
    engine: Inference, images: list[tuple[Batch, Batch]], classes: int
) -> list[npt.NDArray[np.int64]]:
    """Return the class maps (1, h, w) of the images; raises `BadConfiguration` for logits of a
    wrong shape and for non-finite ones."""
    predictions = []
    for rgb, depth in images:
        logits = engine.logits(rgb, depth)
        check_logits(logits, classes, rgb, engine.name)
        if not np.isfinite(logits).all():
            raise BadConfiguration(f"{engine.name}: its logits are not finite")
        predictions.append(logits.argmax(axis=1))
    return predictions
