"""Training runs of a running console: started, watched, cancelled and resumed."""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from app.teaching.frames.frame_store import FrameStore
from app.teaching.networks.versions import VERSION_NAME, VersionStore, read_version
from app.teaching.training.lock import end_holder, holder_of
from app.teaching.training.plan import PLAN_NAME, TrainingPlan, prepare, read_plan
from app.teaching.training.progress import LOOKS_NAME, RunProgress, read_progress, write_progress
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.learning.teaching.teaching_recipe import TeachingRecipe
from navcore.toml_config import from_table
from web.interface.teaching import TrainingOrder, TrainingPhase, TrainingRun

END_S = 20.0
"""Longest wait for a run that was asked to end, seconds; then it is killed. What it has saved
stays."""
LOG_NAME = "training.log"
ENDED = ("done", "failed", "cancelled")
"""Phases of a run that has ended."""
log = logging.getLogger(__name__)
Start = Callable[[str | None], tuple[str, Path]]
"""Function that gives name and weights file of a version, by default of the one in use."""


class LiveTrainings:
    """Satisfies `web.interface.teaching.Trainings`."""

    def __init__(self, versions: VersionStore, frames: FrameStore, start_of: Start) -> None:
        self._versions, self._frames, self._start_of = versions, frames, start_of
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def newest(self) -> TrainingRun | None:
        """Return the newest run; None before the first."""
        folder = self._newest_folder()
        return None if folder is None else self._shown(folder)

    def start(self, order: TrainingOrder) -> TrainingRun:
        """Prepare a run and begin it."""
        with self._lock:
            self._refuse_while_running()
            self._versions.refuse_if_full()
            name, weights = self._start_of(order.start_name)
            if weights.suffix != ".safetensors":
                raise Refused("an ONNX file cannot be trained on; start from another version")
            plan = TrainingPlan(
                name=self._versions.new_name(),
                start_name=name,
                start_path=str(weights.resolve()),
                class_names=(),
                created_unix_s=round(time.time(), 1),
                threads=max(1, (os.cpu_count() or 1) // 2),
                size=order.size,
                recipe=_recipe(order),
            )
            folder = self._versions.folder / plan.name
            prepare(folder, self._frames, plan, order.class_names)
            self._remove_unfinished(but=folder)
            self._launch(folder)
            return self._shown(folder)

    def cancel(self) -> TrainingRun:
        """Ask the running process to end, and wait for it."""
        with self._lock:
            folder = self._newest_folder()
            if folder is None or not self._is_running(folder):
                raise Refused("no training is running")
            self._end(folder)
            return self._shown(folder)

    def resume(self) -> TrainingRun:
        """Continue the newest run."""
        with self._lock:
            self._refuse_while_running()
            folder = self._newest_folder()
            if folder is None or _is_complete(folder):
                raise Refused("there is no training to resume")
            self._launch(folder)
            return self._shown(folder)

    def look(self, number: int) -> bytes:
        """Return a validation image of the newest run."""
        folder = self._newest_folder()
        path = None if folder is None else folder / LOOKS_NAME / f"{number}.png"
        try:
            if path is not None:
                return path.read_bytes()
        except FileNotFoundError:
            pass
        except OSError as error:
            raise StorageFailed(f"{path}: {error.strerror or error}") from None
        raise NotKnown("the training has no such image yet")

    def close(self) -> None:
        """End the run of this console; it can be resumed at the next start."""
        with self._lock:
            folder, process = self._newest_folder(), self._process
            if process is not None and process.poll() is None and folder is not None:
                self._end(folder)

    def _launch(self, folder: Path) -> None:
        """Start the process of a run."""
        progress = read_progress(folder)
        progress.phase, progress.message = "waiting", ""
        write_progress(folder, progress)
        environment = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}
        try:
            with (folder / LOG_NAME).open("ab") as output:
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "app.teaching", str(folder)],
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=output,
                    env=environment,
                )
        except OSError as error:
            raise StorageFailed(
                f"the training cannot be started: {error.strerror or error}"
            ) from error
        log.info("training %s: process %d", folder.name, self._process.pid)

    def _end(self, folder: Path) -> None:
        """End the process of a run, of this console or of an earlier one."""
        process = self._process
        if process is not None and process.poll() is None:
            process.terminate()
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        try:
            end_holder(folder, END_S)
        except OSError as error:
            raise Refused(f"the training cannot be ended: {error.strerror or error}") from None
        self._note_end(folder)

    def _note_end(self, folder: Path) -> None:
        """Say of a run whose process ended without a word that it can be resumed."""
        progress = read_progress(folder)
        if progress.phase not in ENDED:
            progress.phase = "cancelled"
            write_progress(folder, progress)

    def _refuse_while_running(self) -> None:
        folder = self._newest_folder()
        if folder is not None and self._is_running(folder):
            raise Refused("a training is running; wait for it, or cancel it")

    def _is_running(self, folder: Path) -> bool:
        if self._process is not None and self._process.poll() is None:
            return True
        return holder_of(folder) is not None

    def _remove_unfinished(self, *, but: Path) -> None:
        """Remove the runs that no version came of: only the newest one can be resumed."""
        for path in self._versions.folder.glob(f"*/{PLAN_NAME}"):
            folder = path.parent
            if folder != but and not _is_complete(folder) and not holder_of(folder):
                shutil.rmtree(folder, ignore_errors=True)

    def _newest_folder(self) -> Path | None:
        times_ns: dict[Path, int] = {}
        for path in self._versions.folder.glob(f"*/{PLAN_NAME}"):
            with contextlib.suppress(OSError):  # it is being deleted
                times_ns[path.parent] = path.stat().st_mtime_ns
        return max(times_ns, key=times_ns.__getitem__, default=None)

    def _shown(self, folder: Path) -> TrainingRun:
        running = self._is_running(folder)
        try:
            plan, progress = read_plan(folder), read_progress(folder)
        except BadConfiguration as error:
            raise NotKnown(f"the newest training cannot be read: {error}") from None
        return TrainingRun(
            name=plan.name,
            start_name=plan.start_name,
            class_names=plan.class_names,
            phase=_phase(folder, progress, running=running),
            done=progress.done,
            of=progress.of,
            losses=tuple(progress.losses),
            mious=tuple(progress.mious),
            looks=progress.looks,
            message="" if _is_complete(folder) else _message(progress, running=running),
            running=running,
            not_found=_not_found(folder),
        )


def _is_complete(folder: Path) -> bool:
    """Return whether a run has become a version, whatever its progress says: the disk may have been
    full by then."""
    return (folder / VERSION_NAME).exists()


def _not_found(folder: Path) -> tuple[str, ...]:
    """Return the classes that the network of a run does not find; empty before it is done."""
    if not _is_complete(folder):
        return ()
    try:
        return read_version(folder).not_found
    except BadConfiguration:
        return ()


def _phase(folder: Path, progress: RunProgress, *, running: bool) -> TrainingPhase:
    """Return the phase; a process that ended without a word has failed."""
    if _is_complete(folder):
        return "done"
    return progress.phase if running or progress.phase in ENDED else "failed"


def _message(progress: RunProgress, *, running: bool) -> str:
    if running or progress.message or progress.phase in ENDED:
        return progress.message
    return "the process of the training ended, or the console was stopped; resume it"


def _recipe(order: TrainingOrder) -> TeachingRecipe:
    """Return the recipe of an order; raises `BadConfiguration`."""
    given = {
        "steps": order.steps,
        "rehearsal": order.rehearsal,
        "rendered_test": order.rehearsal,
        "seed": order.seed,
    }
    table = {name: value for name, value in given.items() if value is not None}
    return from_table(TeachingRecipe, table, "training")
