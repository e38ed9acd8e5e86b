"""Row 26: a training runs beside the console, whose robot drives."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import httpx
import numpy as np

from app.bench.console.page import drive_around
from app.console.application import ConsoleOptions, console
from app.runtime.control.robot_controller import RobotController
from app.runtime.start.segmenter_choice import SegmenterChoice
from app.teaching.frames.frame_archive import exported
from navcore.config.safety import GateConfig
from tests.app.teaching.shoe_room import annotated_frames, room_file
from tests.reliability.result import Measurement

GOALS = ((2.2, 0.0), (-2.5, 1.5))
SETTLE_S, BEGIN_S = 5.0, 120.0
TIMEOUT_S = 30.0
BUSY = ("rendering", "encoding", "training", "comparing")
"""Phases in which a training computes."""


def training_beside(commands: int, *, in_a_process: bool = True) -> Measurement:
    """Measure the periods of so many commands without and with a training beside the console.

    `in_a_process`: false to compute within the console's own process instead, in a function that
    does not let other threads run, which is what is to be avoided.
    """
    sent, honest = list[float](), RobotController.command

    def timed(*arguments: Any, **options: Any) -> Any:
        sent.append(time.monotonic())
        return honest(*arguments, **options)

    with tempfile.TemporaryDirectory(prefix="beside-training-") as name:
        folder = Path(name)
        world = room_file(folder)
        with exported(annotated_frames(folder / "frames", world)) as file:
            data = file.read()
        options = ConsoleOptions(
            scenario=str(world),
            port=0,
            data=folder / "data",
            choice=SegmenterChoice(kind="network", live=True),
        )
        with (
            patch.object(RobotController, "command", timed),
            console(options) as running,
            httpx.Client(base_url=running.url, trust_env=False, timeout=TIMEOUT_S) as program,
        ):
            program.post("/api/v1/beware", json={"name": "shoe"}).raise_for_status()
            program.post("/api/v1/teach/frames.zip", content=data).raise_for_status()
            drive_around(program, GOALS)
            time.sleep(SETTLE_S)
            alone = _periods_ms(sent, commands, lambda: True)
            with _training(program) if in_a_process else _computing() as goes_on:
                beside = _periods_ms(sent, commands, goes_on)
    limit_ms = 1e3 * GateConfig().command_life_s
    return Measurement(
        trials=len(beside),
        measured=f"period of a command: alone {_told(alone)}, beside a training {_told(beside)}",
        met=bool(beside.max() <= limit_ms),
    )


def _periods_ms(
    sent: list[float], commands: int, goes_on: Callable[[], bool]
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the periods of the next commands, as many as there are while something goes on."""
    first = len(sent)
    while len(sent) <= first + commands and goes_on():
        time.sleep(0.2)
    return 1e3 * np.diff(sent[first : first + commands + 1])


def _told(periods_ms: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    p50, p99 = np.percentile(periods_ms, [50, 99])
    return f"p50 {p50:.1f}, p99 {p99:.1f}, max {periods_ms.max():.1f} ms"


@contextmanager
def _training(program: httpx.Client) -> Iterator[Callable[[], bool]]:
    """Train the class of the annotated frames; gives whether it computes."""

    def computes() -> bool:
        run = program.get("/api/v1/teach/training").json()["run"]
        return bool(run["running"] and run["phase"] in BUSY)

    program.post("/api/v1/teach/training", json={}).raise_for_status()
    deadline = time.monotonic() + BEGIN_S
    while not computes():
        if time.monotonic() > deadline:
            raise RuntimeError(f"no training computes within {BEGIN_S:g} s")
        time.sleep(0.2)
    try:
        yield computes
    finally:
        program.post("/api/v1/teach/training/cancel")


@contextmanager
def _computing() -> Iterator[Callable[[], bool]]:
    """Compute in a thread of this process that holds the interpreter."""
    ended = threading.Event()

    def compute() -> None:
        while not ended.is_set():
            pow(3, 4_000_000)

    thread = threading.Thread(target=compute, daemon=True)
    thread.start()
    try:
        yield lambda: True
    finally:
        ended.set()
        thread.join()
