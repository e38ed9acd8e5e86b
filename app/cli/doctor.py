"""`bewarenav doctor`: what is installed, what is missing, and how to install it."""

from __future__ import annotations

import importlib.metadata
import platform
import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from navcore.perception.esanet.inference.selection import EngineBenchmark

NAME = re.compile(r"[A-Za-z0-9._-]+")
"""Name of a package at the beginning of a requirement."""
FASTER = ("onnx", "onnxruntime", "openvino")
TRIAL_S = 1.0
"""Time for which each engine of the network is measured, seconds."""


def examine() -> int:
    """Print one line per part; return 0 if everything required is installed, else 1."""
    missing = 0
    _say(True, f"Python {platform.python_version()} ({sys.executable})")
    for package in ("bewarenav", *_required()):
        try:
            _say(True, f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            missing += 1
            _say(False, f"{package} is missing: run `make setup`")
    for line in _segmentation():
        _say(*line)
    found = shutil.which("chromium")
    _say(
        bool(found),
        f"chromium {found}"
        if found
        else "chromium is missing, needed for browser tests: apt-get install chromium",
    )
    return 1 if missing else 0


def _required() -> list[str]:
    """Return the packages that the installed program needs in any case, none if it is not
    installed."""
    try:
        lines = importlib.metadata.requires("bewarenav") or []
    except importlib.metadata.PackageNotFoundError:
        return []
    return [found[0] for line in lines if "extra ==" not in line and (found := NAME.match(line))]


def _segmentation() -> Iterator[tuple[bool, str]]:
    """Yield the installed engines, the time of the network on each, and the one that drives."""
    from app.runtime.start.camera_choice import choose_stream
    from app.runtime.start.engine_memory import EngineMemory
    from app.runtime.start.segmentation import compose, measure_segmenter
    from app.runtime.start.segmenter_choice import SegmenterChoice
    from navcore.config.perception.inference import InferenceConfig
    from navcore.perception.esanet.inference.onnx_engines import is_installed
    from navcore.perception.esanet.inference.onnx_file import INSTALL
    from navcore.robot.profile import HUSKY

    for package in FASTER:
        if is_installed(package):
            yield True, f"{package} {importlib.metadata.version(package)}"
        else:
            yield (
                False,
                f"{package} is missing; not needed, but the network runs faster with it: {INSTALL}",
            )
    # All are measured once, and the choice is remembered for every later start.
    thorough = InferenceConfig(trial_s=TRIAL_S, fast_enough_ms=0.0)
    perception = compose(
        SegmenterChoice(live=True),
        sensor=HUSKY.depth_sensor,
        memory=EngineMemory.of_user(),
        inference=thorough,
    )
    trials: Sequence[EngineBenchmark] = perception.trials
    if not trials:
        what, trials = measure_segmenter(trial_s=TRIAL_S)
        yield True, f"measured {what}"
    for trial in trials:
        yield trial.failure is None, f"  {trial.text()}"
    yield perception.warning is None, f"segmentation: {perception.title}"
    camera = choose_stream(perception.image_ms, HUSKY.stream)
    yield True, f"camera of the console, {camera.text()}"


def _say(good: bool, text: str) -> None:
    typer.echo(f"{'ok  ' if good else 'MISS'} {text}")
