"""Which engine runs the network here: one that decides as torch in f32 does and is fast, or the
fastest; found by trying."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.perception.esanet.inference.engine import THREADS, Batch, Inference, check_logits
from navcore.perception.esanet.inference.network_file import NetworkFile
from navcore.perception.esanet.inference.onnx_engines import (
    OnnxRuntimeInference,
    OpenVinoInference,
    has_bf16,
    is_installed,
)
from navcore.perception.esanet.inference.onnx_file import can_export
from navcore.perception.esanet.inference.torch_engine import TorchInference
from navcore.perception.esanet.network.preprocess import DepthStatistics, Preprocessor, Size

MIN_AGREEMENT = 0.999
"""An engine is taken only if it gives at least this share of pixels the class that torch in f32
gives them."""
MIN_AGREEMENT_IN_BYTES = 0.99
"""In eight bits; how much that costs was measured on thousands of things, when the ranges were
(`weights quantise`)."""
ENOUGH_MS = 50.0
"""Of a fifteenth of a second this leaves a quarter to all else: an engine that takes no longer is
taken, no other is tried."""
CLEARLY_FASTER = 0.9
"""Else the most exact of those is taken that the fastest does not beat by this much: noise must not
choose."""
PRECISIONS = ("int8", "bf16", "f32")
"""The later, the more exact."""
MIN_RUNS, MAX_RUNS = 5, 200
TRIAL_S = 0.3
"""How long each engine is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineBenchmark:
    """What came of trying one engine."""

    name: str
    """Engine and precision."""
    p50_ms: float = 0.0
    """Median time of a picture, without resizing and labelling."""
    p99_ms: float = 0.0
    """99th percentile of it."""
    agreement: float = 0.0
    """Share of pixels whose class is the reference's, over the probes."""
    is_accurate: bool = False
    """Whether that is enough."""
    failure: str | None = None
    """Why it cannot be used; None when it ran."""

    def text(self) -> str:
        """One line."""
        if self.failure is not None:
            return f"{self.name}: {self.failure}"
        return f"{self.name} {self.p50_ms:.1f} ms (p99 {self.p99_ms:.1f}), agrees in {self.agreement:.2%} of the pixels"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """An engine that might be used."""

    name: str
    """Engine and precision."""
    build: Callable[[], Inference]
    """Makes it ready; may raise `BadConfiguration`."""
    min_agreement: float = MIN_AGREEMENT
    """Share of the pixels in which it must decide as the reference does."""

    @property
    def is_exact(self) -> bool:
        """Whether it may be the reference."""
        return self.name.endswith("f32")


def open_inference(
    file: NetworkFile, engine: str, *, threads: int = THREADS
) -> tuple[Inference, tuple[EngineBenchmark, ...]]:
    """The engine asked for (`torch`, `onnxruntime` or `openvino`, in f32 unless it says `… bf16` or
    `… int8`), or with `auto` the best here, and what the trials gave.

    Raises `BadConfiguration` when it is not installed or cannot run the network.
    """
    if engine == "auto":
        return choose(file, threads=threads)
    name = engine.replace("-", " ")
    for candidate in candidates(file, threads):
        if candidate.name == (name if " " in name else f"{name} f32"):
            return candidate.build(), ()
    if file.network is None and engine.startswith("torch"):
        raise BadConfiguration("torch does not run ONNX files; choose onnxruntime or openvino")
    raise BadConfiguration(
        f"{engine} is not installed here, or the onnx package is not (pip install 'bewarenav[fast]'), "
        "or processor or weights are not made for it"
    )


def choose(
    file: NetworkFile, *, threads: int = THREADS
) -> tuple[Inference, tuple[EngineBenchmark, ...]]:
    """Try the engines that are installed, those that should be fastest first, until one is fast
    enough and accurate."""
    good: list[tuple[Inference, EngineBenchmark]] = []
    trials = []
    for engine, trial in benchmark_engines(file, threads=threads):
        trials.append(trial)
        if engine is not None and trial.is_accurate:
            good.append((engine, trial))
            if trial.p50_ms <= ENOUGH_MS:
                return engine, tuple(trials)
    if not good:
        reasons = (
            "; ".join(trial.text() for trial in trials)
            or "an ONNX file needs onnxruntime or openvino"
        )
        raise BadConfiguration(
            f"no engine runs this network ({reasons}): pip install 'bewarenav[fast]'"
        )
    least_ms = min(trial.p50_ms for _, trial in good)
    near = [one for one in good if CLEARLY_FASTER * one[1].p50_ms <= least_ms]
    chosen, _ = max(
        near, key=lambda one: (PRECISIONS.index(one[1].name.split()[-1]), -one[1].p50_ms)
    )
    return chosen, tuple(trials)


def benchmark_engines(
    file: NetworkFile, *, threads: int = THREADS, trial_s: float = TRIAL_S
) -> Iterator[tuple[Inference | None, EngineBenchmark]]:
    """Each engine with what it measured. The last exact one that runs is the reference: torch,
    where it can run the file."""
    pictures = probes(file.size, file.depth)
    found = candidates(file, threads)
    classes = len(file.class_names)
    reference = _reference(found, pictures, classes)
    for candidate in found:
        try:
            engine = candidate.build()
            winners = _winners(engine, pictures, classes)
            if reference is None:
                raise BadConfiguration("no exact engine runs that it could be compared with")
        except BadConfiguration as error:
            yield None, EngineBenchmark(name=candidate.name, failure=str(error))
            continue
        agreement = float(
            np.mean([np.mean(a == b) for a, b in zip(winners, reference, strict=True)])
        )
        p50_ms, p99_ms = np.percentile(timed(engine, pictures, trial_s), [50, 99])
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


def candidates(file: NetworkFile, threads: int = THREADS) -> list[Candidate]:
    """What is installed and fits the file, those that should be fastest first."""
    found, onnx = [], functools.cache(file.as_onnx)
    exportable = file.network is None or can_export()
    if exportable and is_installed("openvino"):
        if file.ranges is not None:
            found.append(
                Candidate(
                    name="openvino int8",
                    build=lambda: OpenVinoInference(
                        onnx(in_bytes=True), precision="int8", threads=threads
                    ),
                    min_agreement=MIN_AGREEMENT_IN_BYTES,
                )
            )
        if has_bf16():
            found.append(
                Candidate(
                    name="openvino bf16",
                    build=lambda: OpenVinoInference(onnx(), precision="bf16", threads=threads),
                )
            )
        found.append(
            Candidate(name="openvino f32", build=lambda: OpenVinoInference(onnx(), threads=threads))
        )
    if exportable and is_installed("onnxruntime"):
        found.append(
            Candidate(
                name="onnxruntime f32", build=lambda: OnnxRuntimeInference(onnx(), threads=threads)
            )
        )
    if (network := file.network) is not None:
        found.append(
            Candidate(
                name="torch bf16",
                build=lambda: TorchInference(network, precision="bf16", threads=threads),
            )
        )
        found.append(
            Candidate(name="torch f32", build=lambda: TorchInference(network, threads=threads))
        )
    return found


def timed(
    engine: Inference, pictures: list[tuple[Batch, Batch]], trial_s: float
) -> npt.NDArray[np.float64]:
    """(N,) milliseconds of single pictures, of an engine that is warm."""
    durations: list[float] = []
    end = time.perf_counter() + trial_s
    while len(durations) < MIN_RUNS or (time.perf_counter() < end and len(durations) < MAX_RUNS):
        start = time.perf_counter()
        engine.logits(*pictures[len(durations) % len(pictures)])
        durations.append((time.perf_counter() - start) * 1e3)
    return np.array(durations)


def probes(size: Size, statistics: DepthStatistics) -> list[tuple[Batch, Batch]]:
    """Three made-up rooms, always the same: a floor, a wall, some coloured boxes, noise, holes in
    the depth."""
    rng, prepare = np.random.default_rng(7), Preprocessor(size, statistics)
    made = []
    for _ in range(3):
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
    found: list[Candidate], pictures: list[tuple[Batch, Batch]], classes: int
) -> list[npt.NDArray[np.int64]] | None:
    """What the last exact engine that runs decides; None where none does."""
    for candidate in reversed(found):
        if candidate.is_exact:
            try:
                return _winners(candidate.build(), pictures, classes)
            except BadConfiguration:
                continue  # it is told when its turn comes
    return None


def _winners(
    engine: Inference, pictures: list[tuple[Batch, Batch]], classes: int
) -> list[npt.NDArray[np.int64]]:
    """What it decides; raises `BadConfiguration` for an answer of another shape, and for one that
    is not finite."""
    winners = []
    for rgb, depth in pictures:
        logits = engine.logits(rgb, depth)
        check_logits(logits, classes, rgb, engine.name)
        if not np.isfinite(logits).all():
            raise BadConfiguration(f"{engine.name}: its answer is not finite")
        winners.append(logits.argmax(axis=1))
    return winners
