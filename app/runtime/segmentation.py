"""Which segmenter drives: the network with the colour rules, or the rules alone, and what to tell
the operator about it."""

from __future__ import annotations

import dataclasses
import functools
import logging
from dataclasses import dataclass
from pathlib import Path

from app.runtime.segmenter_choice import SegmenterChoice
from navcore.errors import BadConfiguration
from navcore.perception.colour_segmenter import ColourSegmenter
from navcore.perception.esanet.inference.engine import THREADS
from navcore.perception.esanet.inference.network_file import (
    SHIPPED,
    NetworkFile,
    nearest_size,
    open_network,
)
from navcore.perception.esanet.inference.selection import (
    EngineBenchmark,
    benchmark_engines,
    open_inference,
)
from navcore.perception.esanet.network.preprocess import NYUV2_DEPTH, Size
from navcore.perception.esanet.segmenter import NetworkSegmenter
from navcore.perception.esanet.weights.class_names import aliases_for
from navcore.perception.fused_segmenter import FusedSegmenter
from navcore.perception.labels import Segmenter

log = logging.getLogger(__name__)
CAMERA = Size(height=240, width=424)
"""Of the simulated D455; the working size of weights that do not name their own is the nearest to
it."""
RANDOM_CLASSES = 12
SLOW_MS = 100.0
"""Where every engine takes longer for a picture, a robot that drives in the present is shown
smaller ones."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Perception:
    """A segmenter, and what is to be said of it."""

    segmenter: Segmenter
    """What labels the pictures."""
    title: str
    """For people, e.g. `network r18-nbt1d × 0.5, onnxruntime f32, 448 × 256`."""
    identity: str
    """Whatever changes its labels: the weights' hash, size and precision. Two campaigns with the
    same one are comparable."""
    warning: str | None = None
    """What the operator must know: that the network does not run, and why. None when all is as it
    should be."""
    trials: tuple[EngineBenchmark, ...] = ()
    """What was measured of the engines to choose one."""
    choice: SegmenterChoice
    """That gives the same segmenter again: the engine that was found is named."""


def colour_perception(warning: str | None = None) -> Perception:
    """The colour rules alone."""
    return Perception(
        segmenter=ColourSegmenter(),
        title="colour rules",
        identity="colour rules",
        warning=warning,
        choice=SegmenterChoice(kind="colour"),
    )


def compose(choice: SegmenterChoice, *, shipped: Path = SHIPPED) -> Perception:
    """The segmenter asked for.

    Raises `BadConfiguration` where a network was asked for by name and cannot run; with `auto` and
    the shipped weights that is a warning, and the colour rules drive.
    """
    if choice.kind == "colour":
        if choice.weights is not None:
            raise BadConfiguration(
                "--weights with --segmenter colour: the colour rules have no weights; leave one of them out"
            )
        return colour_perception()
    try:
        perception = _network(choice, choice.weights or shipped)
    except BadConfiguration as error:
        if choice.kind == "network" or choice.weights is not None:
            raise
        why = str(error) if shipped.exists() else "no trained weights come with this version"
        warning = (
            f"The network does not run, only the colour rules look for things to beware of: {why}"
        )
        log.warning("%s", warning)
        return colour_perception(warning)
    log.info("segmentation: %s", perception.title)
    return perception


def measure_segmenter(
    weights: Path | None = None, *, trial_s: float = 2.0, threads: int = THREADS
) -> tuple[str, list[EngineBenchmark]]:
    """What network was measured, and p50 and p99 of each engine that is installed.

    Without `weights` it is the shipped network, and where none ships one of its shape with random
    weights, which takes as long.
    """
    try:
        file = open_network(weights or SHIPPED, camera=CAMERA)
    except BadConfiguration:
        if weights is not None:
            raise
        file = _random_network()
    what = f"{file.title}, {len(file.class_names)} classes, {_by(file.size)}, {threads} threads"
    return what, [trial for _, trial in benchmark_engines(file, threads=threads, trial_s=trial_s)]


def _network(choice: SegmenterChoice, path: Path) -> Perception:
    file = open_network(path, camera=CAMERA)
    if choice.smaller:
        file = file.smaller() or file
    engine, trials = open_inference(file, choice.engine, threads=choice.threads)
    for trial in trials:
        log.info("segmentation, tried %s", trial.text())
    fastest_ms = min((trial.p50_ms for trial in trials if trial.is_accurate), default=0.0)
    if choice.live and fastest_ms > SLOW_MS and (smaller := file.smaller()) is not None:
        log.warning(
            "segmentation: too slow here for pictures of %s, it is shown %s",
            _by(file.size),
            _by(smaller.size),
        )
        file, choice = smaller, dataclasses.replace(choice, smaller=True)
        engine, trials = open_inference(file, choice.engine, threads=choice.threads)
    network = NetworkSegmenter(
        engine,
        class_names=file.class_names,
        depth=file.depth,
        size=file.size,
        aliases=aliases_for(file.class_names),
    )
    _, precision = engine.name.split()
    return Perception(
        segmenter=FusedSegmenter(network),
        title=f"network {file.title}, {engine.name}, {_by(file.size)}",
        identity=f"network sha256 {file.sha256}, {_by(file.size)}, {precision}, with colour rules",
        trials=trials,
        choice=dataclasses.replace(choice, kind="network", engine=engine.name),
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
        size=nearest_size(CAMERA),
        sha256="0" * 64,
        network=network,
    )


def _by(size: Size) -> str:
    return f"{size.width} × {size.height}"
