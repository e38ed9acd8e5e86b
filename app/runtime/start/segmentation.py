"""Composition of the segmenter: the network with the colour rules, or the rules alone."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import logging
import multiprocessing
import signal
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from app.runtime.start.engine_memory import ChosenEngine, EngineMemory, key_of
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.config.perception.inference import InferenceConfig
from navcore.config.perception.perception import DEFAULT_PERCEPTION, PerceptionConfig
from navcore.errors import BadConfiguration
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.esanet.inference.engine import THREADS, Inference
from navcore.perception.esanet.inference.network_file import (
    SHIPPED,
    NetworkFile,
    nearest_size,
    open_network,
)
from navcore.perception.esanet.inference.selection import (
    EngineBenchmark,
    TrialStep,
    benchmark_engines,
    open_inference,
    probe_images,
    run_times_ms,
)
from navcore.perception.esanet.network.preprocess import NYUV2_DEPTH, Size
from navcore.perception.esanet.segmenter import NetworkSegmenter
from navcore.perception.esanet.weights.class_names import aliases_for
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import Segmenter
from navcore.robot.profile import DepthSensor

log = logging.getLogger(__name__)
Watch = Callable[[TrialStep], None]
"""Is told of each step of the trials of the engines."""
RANDOM_CLASSES = 12
"""Number of classes of the network with random weights."""
SLOWER = 2.0
"""Ratio of its time per image to the one it was chosen with above which an engine that is
remembered is measured again."""
CHECK = InferenceConfig(trial_s=0.0)
"""Few images, to see whether an engine that is remembered has become too slow."""
IDENTITY_DIGITS = 16
"""Number of digits of the hash of its weights that name a network in prototypes."""
SLOW_MS = 100.0
"""Time per image, in milliseconds, above which a robot in real time uses smaller images."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Perception:
    """A segmenter with its description."""

    segmenter: Segmenter
    """Segmenter of the camera images."""
    title: str
    """Title for operators, e.g. `network r18-nbt1d × 0.5, onnxruntime f32, 448 × 256`."""
    identity: str
    """Everything that determines the labels: hash of the weights, image size and precision.
    Campaigns with the same identity are comparable."""
    warning: str | None = None
    """Why the network that was asked for, or was in use last, does not run, for the operator; None
    when it does or none was."""
    trials: tuple[EngineBenchmark, ...] = ()
    """Measurements of the engines, from which one was chosen."""
    image_ms: float | None = None
    """99th percentile of the network's time per image in milliseconds when its engine was chosen;
    None where none was measured."""
    choice: SegmenterChoice
    """Options that give the same segmenter again, with the chosen engine."""
    examples: NetworkSegmenter | None = None
    """The network, for another thread, of which classes by example are made; None where none runs,
    or its file has no features."""


def colour_perception(
    warning: str | None = None, config: PerceptionConfig = DEFAULT_PERCEPTION
) -> Perception:
    """Return the colour rules alone."""
    return Perception(
        segmenter=ColourSegmenter(config),
        title="colour rules",
        identity="colour rules",
        warning=warning,
        choice=SegmenterChoice(kind="colour"),
    )


def compose(
    choice: SegmenterChoice,
    *,
    sensor: DepthSensor,
    shipped: Path = SHIPPED,
    config: PerceptionConfig = DEFAULT_PERCEPTION,
    memory: EngineMemory | None = None,
    inference: InferenceConfig | None = None,
    apart: bool = False,
    watch: Watch = lambda step: None,
) -> Perception:
    """Compose the chosen segmenter for the robot's depth camera `sensor`.

    With `memory` the engine that it remembers for this network and machine is taken unmeasured, as
    long as it is not too slow; one that was chosen by measuring is remembered. `inference` asks to
    measure in any case, in its way. With `apart` a network is read, exported and its engines are
    measured in a process of its own: what torch and the engines that were tried took ends with it.
    `watch` is told of each step of the trials.

    Raises `BadConfiguration` when a network was chosen explicitly and cannot run; with `auto` and
    the shipped weights this gives a warning, and the colour rules are used.
    """
    if choice.kind == "colour":
        return colour_perception(config=config)
    try:
        prepare = _prepared_apart if apart else _prepared
        opened = prepare(choice, choice.weights or shipped, memory, inference, watch)
    except BadConfiguration as error:
        if choice.kind == "network" or choice.weights is not None:
            raise
        why = str(error) if shipped.exists() else "no trained weights come with this version"
        warning = f"The network does not run, only the colour rules are used: {why}"
        log.warning("%s", warning)
        return colour_perception(warning, config)
    for trial in opened.trials:
        log.info("segmentation, tried %s", trial.text())
    perception = _perception(opened, sensor, config)
    log.info("segmentation: %s", perception.title)
    return perception


def measure_segmenter(
    weights: Path | None = None, *, trial_s: float = 2.0, threads: int = THREADS
) -> tuple[str, list[EngineBenchmark]]:
    """Measure each installed engine; returns a description of the network and the measurements.

    Without `weights` the shipped network is measured or, without that, one of its shape with random
    weights, which takes the same time.
    """
    try:
        file = open_network(weights or SHIPPED, camera=_camera(SegmenterChoice()))
    except BadConfiguration:
        if weights is not None:
            raise
        file = _random_network()
    what = f"{file.title}, {len(file.class_names)} classes, {_by(file.size)}, {threads} threads"
    config = InferenceConfig(trial_s=trial_s)
    return what, [trial for _, trial in benchmark_engines(file, threads=threads, config=config)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Opened:
    """A network with the engine that runs it."""

    choice: SegmenterChoice
    file: NetworkFile
    engine: Inference
    trials: tuple[EngineBenchmark, ...] = ()
    remembered_ms: float | None = None

    @property
    def image_ms(self) -> float | None:
        """99th percentile of the time per image when the engine was chosen."""
        names = {trial.name: trial.p99_ms for trial in self.trials if trial.failure is None}
        return names.get(self.engine.name, self.remembered_ms)


_Exported = tuple[
    SegmenterChoice, NetworkFile | None, str, tuple[EngineBenchmark, ...], float | None
]


def _prepared_apart(
    choice: SegmenterChoice,
    path: Path,
    memory: EngineMemory | None,
    inference: InferenceConfig | None,
    watch: Watch,
) -> _Opened:
    """`_prepared` in a process of its own; only the engine is opened in this one.

    A network that was exported at an earlier start, for the engine that is remembered, is opened
    without that process.
    """
    key = None
    if memory is not None and choice.engine == "auto" and inference is None and path.exists():
        sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        key = key_of(sha256, live=choice.live, threads=choice.threads, camera=choice.camera)
        known = memory.recall(key)
        kept = memory.network(key, known=known, sha256=sha256) if known else None
        opened = _remembered(known, choice, kept, memory, watch) if kept else None
        if opened is not None:
            return opened
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(
        target=_export_to, args=(sender, choice, path, memory, inference), daemon=True
    )
    process.start()
    sender.close()
    try:
        while isinstance(message := receiver.recv(), TrialStep):
            watch(message)
    except EOFError:
        raise BadConfiguration(f"{path}: the process that prepares the network ended") from None
    finally:
        receiver.close()
        process.terminate()  # it has sent everything, or the start is given up
        process.join()
    if isinstance(message, Exception):
        raise message
    chosen, file, name, trials, known_ms = message
    if file is None:
        whole = open_network(path, camera=_camera(choice))
        file = (whole.smaller() or whole) if chosen.smaller else whole
    elif memory is not None and key is not None and path.suffix != ".onnx":
        memory.keep_network(key, file.as_onnx())
    compiled = None if memory is None else memory.compiled()
    engine, _ = open_inference(file, name, threads=choice.threads, compiled=compiled)
    return _Opened(choice=chosen, file=file, engine=engine, trials=trials, remembered_ms=known_ms)


def _export_to(
    sender: Connection,
    choice: SegmenterChoice,
    path: Path,
    memory: EngineMemory | None,
    inference: InferenceConfig | None,
) -> None:
    """Send each step of the trials, and at the end what `_exported` returns or raises."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the program that waits for it ends it
    try:
        sender.send(_exported(choice, path, memory, inference, sender.send))
    except Exception as error:
        sender.send(error)


def _exported(
    choice: SegmenterChoice,
    path: Path,
    memory: EngineMemory | None,
    inference: InferenceConfig | None,
    watch: Watch,
) -> _Exported:
    """Return what `_prepared` returns, with the ONNX file for the engine in place of the network,
    and the name of the engine in place of the engine; no file for torch, which reads its own."""
    opened = _prepared(choice, path, memory, inference, watch)
    name, file = opened.engine.name, None
    if not name.startswith("torch"):
        onnx = opened.file.as_onnx(in_bytes=name.endswith("int8"))
        file = dataclasses.replace(opened.file, network=None, onnx=onnx)
    return opened.choice, file, name, opened.trials, opened.remembered_ms


def _prepared(
    choice: SegmenterChoice,
    path: Path,
    memory: EngineMemory | None,
    inference: InferenceConfig | None,
    watch: Watch,
) -> _Opened:
    """Read the network, and open the engine that was asked for, that is remembered, or that is the
    best by measurement."""
    file = open_network(path, camera=_camera(choice))
    key = key_of(file.sha256, live=choice.live, threads=choice.threads, camera=choice.camera)
    known = None
    if memory is not None and choice.engine == "auto" and inference is None:
        known = _remembered(memory.recall(key), choice, file, memory, watch)
    if known is not None:
        return known
    chosen, file, engine, trials = _measured(choice, file, inference or InferenceConfig(), watch)
    taken = next((trial for trial in trials if trial.name == engine.name), None)
    if memory is not None and choice.engine == "auto" and taken is not None:
        memory.remember(
            key,
            ChosenEngine(
                name=engine.name, p99_ms=taken.p99_ms, smaller=chosen.smaller, title=file.title
            ),
        )
    return _Opened(choice=chosen, file=file, engine=engine, trials=trials)


def _remembered(
    known: ChosenEngine | None,
    choice: SegmenterChoice,
    file: NetworkFile,
    memory: EngineMemory,
    watch: Watch,
) -> _Opened | None:
    """Open a remembered engine; None without one, and for one that no longer runs or has become
    too slow."""
    if known is None:
        return None
    smaller = choice.smaller or known.smaller
    file = (file.smaller() or file) if smaller else file
    try:
        engine, _ = open_inference(
            file, known.name, threads=choice.threads, compiled=memory.compiled()
        )
        images = probe_images(file.size, file.depth)
        engine.logits(*images[0])  # the first image of an engine takes longest
        watch(TrialStep(done=0, all=1, is_timed=True))
        now_ms = float(np.median(run_times_ms(engine, images, CHECK)))
        watch(TrialStep(done=1, all=1, is_timed=False))
    except BadConfiguration as error:
        log.warning("segmentation: %s does not run any more: %s", known.name, error)
        return None
    if now_ms > SLOWER * known.p99_ms:
        log.warning(
            "segmentation: %s takes %.0f ms, %.0f ms when it was chosen: measuring again",
            known.name,
            now_ms,
            known.p99_ms,
        )
        return None
    return _Opened(
        choice=dataclasses.replace(choice, smaller=smaller),
        file=file,
        engine=engine,
        remembered_ms=known.p99_ms,
    )


def _measured(
    choice: SegmenterChoice, file: NetworkFile, inference: InferenceConfig, watch: Watch
) -> tuple[SegmenterChoice, NetworkFile, Inference, tuple[EngineBenchmark, ...]]:
    """Open the engine that was asked for, or the best one by measurement."""
    if choice.smaller:
        file = file.smaller() or file
    opened = functools.partial(
        open_inference,
        engine=choice.engine,
        threads=choice.threads,
        config=inference,
        watch=watch,
        measured=choice.measured,
    )
    engine, trials = opened(file)
    fastest_ms = min((trial.p50_ms for trial in trials if trial.is_accurate), default=0.0)
    is_free = choice.live and choice.engine == "auto"
    if is_free and fastest_ms > SLOW_MS and (smaller := file.smaller()) is not None:
        log.warning(
            "segmentation: too slow here for images of %s, using %s",
            _by(file.size),
            _by(smaller.size),
        )
        file, choice = smaller, dataclasses.replace(choice, smaller=True)
        engine, trials = opened(file)
    return choice, file, engine, trials


def _perception(opened: _Opened, sensor: DepthSensor, config: PerceptionConfig) -> Perception:
    file, engine = opened.file, opened.engine
    network = NetworkSegmenter(
        engine,
        class_names=file.class_names,
        depth=file.depth,
        size=file.size,
        aliases=aliases_for(file.class_names),
        identity=file.features[:IDENTITY_DIGITS],
        config=config.prototype,
    )
    _, precision = engine.name.split()
    return Perception(
        segmenter=FusedSegmenter(network, sensor, config),
        title=f"network {file.title}, {engine.name}, {_by(file.size)}",
        identity=f"network sha256 {file.sha256}, {_by(file.size)}, {precision}, with colour rules",
        trials=opened.trials,
        image_ms=opened.image_ms,
        choice=dataclasses.replace(opened.choice, kind="network", engine=engine.name),
        examples=network.for_another_thread() if network.identity else None,
    )


@functools.cache
def _random_network() -> NetworkFile:
    import torch

    from navcore.perception.esanet import build

    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        network = build("r18-nbt1d", RANDOM_CLASSES, width=0.5).eval()
    return NetworkFile(
        title="r18-nbt1d × 0.5 with RANDOM weights (none ship)",
        class_names=tuple(f"class {number}" for number in range(RANDOM_CLASSES)),
        depth=NYUV2_DEPTH,
        size=nearest_size(_camera(SegmenterChoice())),
        sha256="0" * 64,
        features="0" * 64,
        network=network,
    )


def _camera(choice: SegmenterChoice) -> Size:
    width, height = choice.camera
    return Size(height=height, width=width)


def _by(size: Size) -> str:
    return f"{size.width} × {size.height}"
