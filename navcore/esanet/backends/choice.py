"""Which engine runs the network here: the fastest of those that decide as torch in f32 does, found by trying, in seconds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.esanet.backends.inference import THREADS, Batch, Inference
from navcore.esanet.backends.network_file import NetworkFile
from navcore.esanet.backends.onnx_engines import OnnxRuntimeInference, OpenVinoInference, is_installed
from navcore.esanet.backends.onnx_file import can_export
from navcore.esanet.backends.torch_engine import TorchInference
from navcore.esanet.preprocess import DepthStatistics, Preprocessor, Size

MIN_AGREEMENT = 0.999
"""An engine is taken only if it gives at least this share of pixels the class that torch in f32 gives them."""
CLEARLY_FASTER = 0.9
"""A later candidate must need less than this share of the time of the best so far: noise must not choose."""
MIN_RUNS, MAX_RUNS = 5, 200
TRIAL_S = 0.3
"""How long each engine is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What came of trying one engine."""

    name: str
    """Engine and precision."""
    p50_ms: float = 0.0
    """Median time of a picture, without resizing and labelling."""
    p99_ms: float = 0.0
    """99th percentile of it."""
    agreement: float = 0.0
    """Share of pixels whose class is the reference's, over the probes."""
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


def open_inference(file: NetworkFile, engine: str, *, threads: int = THREADS) -> tuple[Inference, tuple[Trial, ...]]:
    """The engine asked for (`torch`, `onnxruntime` or `openvino`, in f32 unless it says `… bf16`), or with `auto` the best
    here, and what the trials gave.

    Raises `BadConfiguration` when it is not installed or cannot run the network.
    """
    if engine == "auto":
        return choose(file, threads=threads)
    for candidate in candidates(file, threads):
        if candidate.name == (engine if " " in engine else f"{engine} f32"):
            return candidate.build(), ()
    if file.network is None and engine.startswith("torch"):
        raise BadConfiguration("torch does not run ONNX files; choose onnxruntime or openvino")
    raise BadConfiguration(f"{engine} is not installed here, or the onnx package is not: pip install 'bewarenav[fast]'")


def choose(file: NetworkFile, *, threads: int = THREADS) -> tuple[Inference, tuple[Trial, ...]]:
    """Try every engine that is installed; a later one is taken only if it is clearly faster and accurate."""
    best: tuple[Inference, Trial] | None = None
    trials = []
    for engine, trial in tried(file, threads=threads):
        trials.append(trial)
        if engine is None or trial.agreement < MIN_AGREEMENT:
            continue
        if best is None or trial.p50_ms < CLEARLY_FASTER * best[1].p50_ms:
            best = engine, trial
    if best is None:
        reasons = "; ".join(trial.text() for trial in trials) or "an ONNX file needs onnxruntime or openvino"
        raise BadConfiguration(f"no engine runs this network ({reasons}): pip install 'bewarenav[fast]'")
    return best[0], tuple(trials)


def tried(file: NetworkFile, *, threads: int = THREADS, trial_s: float = TRIAL_S) -> Iterator[tuple[Inference | None, Trial]]:
    """Each engine with what it measured; the first that runs is the reference of the others."""
    pictures, reference = probes(file.size, file.depth), None
    for candidate in candidates(file, threads):
        try:
            engine = candidate.build()
            winners = [engine.logits(*picture).argmax(axis=1) for picture in pictures]
        except BadConfiguration as error:
            yield None, Trial(name=candidate.name, failure=str(error))
            continue
        reference = reference or winners
        agreement = float(np.mean([np.mean(a == b) for a, b in zip(winners, reference, strict=True)]))
        p50_ms, p99_ms = np.percentile(timed(engine, pictures, trial_s), [50, 99])
        yield engine, Trial(name=candidate.name, p50_ms=float(p50_ms), p99_ms=float(p99_ms), agreement=agreement)


def candidates(file: NetworkFile, threads: int = THREADS) -> list[Candidate]:
    """What is installed and fits the file, the reference first."""
    found = []
    if (network := file.network) is not None:
        found.append(Candidate(name="torch f32", build=lambda: TorchInference(network, threads=threads)))
        found.append(Candidate(name="torch bf16", build=lambda: TorchInference(network, precision="bf16", threads=threads)))
        if not can_export():
            return found
    held: list[bytes] = []

    def onnx() -> bytes:
        if not held:
            held.append(file.as_onnx())
        return held[0]

    if is_installed("onnxruntime"):
        found.append(Candidate(name="onnxruntime f32", build=lambda: OnnxRuntimeInference(onnx(), threads=threads)))
    if is_installed("openvino"):
        found.append(Candidate(name="openvino f32", build=lambda: OpenVinoInference(onnx(), threads=threads)))
        found.append(
            Candidate(name="openvino bf16", build=lambda: OpenVinoInference(onnx(), precision="bf16", threads=threads))
        )
    return found


def timed(engine: Inference, pictures: list[tuple[Batch, Batch]], trial_s: float) -> npt.NDArray[np.float64]:
    """(N,) milliseconds of single pictures, of an engine that is warm."""
    durations: list[float] = []
    end = time.perf_counter() + trial_s
    while len(durations) < MIN_RUNS or (time.perf_counter() < end and len(durations) < MAX_RUNS):
        start = time.perf_counter()
        engine.logits(*pictures[len(durations) % len(pictures)])
        durations.append((time.perf_counter() - start) * 1e3)
    return np.array(durations)


def probes(size: Size, statistics: DepthStatistics) -> list[tuple[Batch, Batch]]:
    """Three made-up rooms, always the same: a floor, a wall, some coloured boxes, noise, holes in the depth."""
    rng, prepare = np.random.default_rng(7), Preprocessor(size, statistics)
    made = []
    for _ in range(3):
        rows, cols = np.mgrid[0 : size.height, 0 : size.width].astype(np.float32)
        depth_m = np.minimum(0.6 * size.height / np.maximum(rows - 0.3 * size.height, 1.0), 5.0)
        rgb = np.full((size.height, size.width, 3), 150.0) + 20 * np.sin(cols / 40)[..., None]
        for _ in range(8):
            top, left = rng.integers(0, size.height - 16), rng.integers(0, size.width - 16)
            box = slice(top, top + rng.integers(8, size.height // 2)), slice(left, left + rng.integers(8, size.width // 3))
            rgb[box] = rng.uniform(0, 255, 3)
            depth_m[box] = rng.uniform(0.5, 4.0)
        depth_m[rng.random(depth_m.shape) < 0.02] = 0.0
        noisy = np.clip(rgb + rng.normal(0, 4, rgb.shape), 0, 255).astype(np.uint8)
        colour, distance = prepare(noisy, (depth_m * statistics.units_per_m).astype(np.float32))
        made.append((colour.copy(), distance))
    return made
