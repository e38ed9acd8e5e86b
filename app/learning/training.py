"""A training run of the command line: arithmetic of the machine, processes and progress."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import cv2
import torch
import torch.distributed as group
from rich.console import Console as Terminal
from rich.progress import (
    BarColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from app.learning.prefetch import prefetching
from app.learning.rendered_batches import RenderedBatches
from navcore.errors import BadConfiguration, StorageFailed
from navcore.learning.data.dataset import Dataset
from navcore.learning.training.checkpoint import Epoch
from navcore.learning.training.distributed import Ranks
from navcore.learning.training.initial_weights import with_depth_of
from navcore.learning.training.recipe import Recipe
from navcore.learning.training.trainer import STATE_NAME, Machine, Step, Training
from navcore.perception.esanet.weights.weights_file import TrainedNetwork


def train(
    recipe: Recipe,
    dataset: Dataset,
    out: Path,
    *,
    resume: bool,
    start: TrainedNetwork | None = None,
    device: str = "auto",
    workers: int = 2,
    cache_mb: int = 4096,
    rendered: bool = False,
) -> Training | None:
    """Train to the end, from the weights `start` or from scratch.

    `rendered`: learn from worlds that `workers` processes render meanwhile instead of the train
    split. Returns the run, or None in the processes that write no files. `out` must not hold
    another run unless `resume` is set. Raises `BadConfiguration` or `StorageFailed`.
    """
    keep_freed_memory()
    cv2.setNumThreads(1)  # the threads that prepare batches are parallel already
    with _process_group(device) as (ranks, where):
        machine = Machine(
            device=where,
            bfloat16=uses_bfloat16(recipe, where),
            ranks=ranks,
            cache_mb=cache_mb,
            map_batches=prefetching(workers),
        )
        _prepare(out, resume=resume)
        with ExitStack() as stack:
            source, card = None, dataset.card
            if start is not None:
                card = with_depth_of(start, dataset).card
            if rendered:
                if ranks.count > 1:
                    raise BadConfiguration("--rendered: expected one process, not torchrun")
                if not dataset.count("valid") + dataset.count("test"):
                    raise BadConfiguration(
                        "--rendered: the data set has no valid and no test images to report on"
                    )
                source = stack.enter_context(
                    closing(
                        RenderedBatches(
                            recipe, card, where, workers=max(1, workers), memory_mb=cache_mb
                        )
                    )
                )
            training = Training(recipe, dataset, out, machine, start=start, source=source)
            if resume:
                training.resume()
            display = stack.enter_context(_displayed(training, ranks))
            training.run(display.update)
    return training if ranks.first else None


def uses_bfloat16(recipe: Recipe, device: torch.device) -> bool:
    """Return whether to compute in bfloat16: `auto` where the processor or the GPU has instructions
    for it."""
    if recipe.precision != "auto":
        return recipe.precision == "bfloat16"
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())


def chosen_device(name: str) -> torch.device:
    """Return the device of a name; `auto` is a GPU if there is one. Raises `BadConfiguration`."""
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        device = torch.device(name)
    except RuntimeError:
        raise BadConfiguration(f"--device {name!r:.40}: expected auto, cpu or cuda") from None
    if device.type not in ("cpu", "cuda") or (
        device.type == "cuda" and not torch.cuda.is_available()
    ):
        raise BadConfiguration(
            f"--device {name}: this torch has no such device; expected auto, cpu or cuda"
        )
    return device


def keep_freed_memory() -> None:
    """Ask glibc to reuse large blocks: new ones cost a page fault per 4 kB, most of the time of the
    loss."""
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        m_trim_threshold, m_top_pad, m_mmap_max = -1, -2, -4
        for parameter, value in ((m_mmap_max, 0), (m_trim_threshold, -1), (m_top_pad, 64 << 20)):
            mallopt(parameter, value)


@contextmanager
def _process_group(device: str) -> Iterator[tuple[Ranks, torch.device]]:
    """Join the process group if `torchrun` started several processes."""
    where = chosen_device(device)
    count = int(os.environ.get("WORLD_SIZE", "1"))
    if count == 1:
        yield Ranks(), where
        return
    if where.type == "cuda":
        where = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
        torch.cuda.set_device(where)
    group.init_process_group("nccl" if where.type == "cuda" else "gloo")
    try:
        yield Ranks(rank=group.get_rank(), count=count), where
    finally:
        group.destroy_process_group()


def _prepare(out: Path, *, resume: bool) -> None:
    state = out / STATE_NAME
    if resume and not state.is_file():
        raise BadConfiguration(f"--resume: {state} is not there; there is no run to continue")
    if not resume and state.exists():
        raise BadConfiguration(
            f"{out}: holds a training run already; give --resume, or another --out"
        )
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageFailed(f"{out}: cannot be made: {error.strerror or error}") from error


class _ProgressDisplay:
    """A progress bar that leaves one line per epoch."""

    def __init__(self, progress: Progress, task: TaskID, epochs: int) -> None:
        self._progress, self._task, self._epochs = progress, task, epochs
        self._miou = ""

    def update(self, progress: Step | Epoch) -> None:
        """Show the progress of a step, or print an epoch."""
        if isinstance(progress, Step):
            done = progress.epoch - 1 + progress.step / progress.steps
            text = f"epoch {progress.epoch}/{self._epochs}  loss {progress.loss:.3f}{self._miou}"
            self._progress.update(self._task, completed=done, description=text)
            return
        if progress.miou is not None:
            self._miou = f"  mIoU {progress.miou:.4f}"
        rate = f"rate {progress.learning_rate:.2e}"
        measured = "" if progress.miou is None else f"  mIoU {progress.miou:.4f}"
        self._progress.console.print(
            f"epoch {progress.number:4d}  loss {progress.loss:.4f}  {rate}{measured}",
            highlight=False,
        )


@contextmanager
def _displayed(training: Training, ranks: Ranks) -> Iterator[_ProgressDisplay]:
    epochs = training.recipe.epochs
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Terminal(stderr=True), disable=not ranks.first) as progress:
        task = progress.add_task("starting", total=epochs, completed=len(training.state.history))
        yield _ProgressDisplay(progress, task, epochs)
