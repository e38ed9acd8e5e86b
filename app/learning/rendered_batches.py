"""Batches of images that processes render while the network learns from them.

For a machine with a GPU: it learns from far more worlds than a data set holds, and prepares the
windows itself. What the processes have rendered by a step depends on the machine, so two runs
differ. A run that is resumed goes on with other worlds and windows, not with those of its start.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import count, islice
from multiprocessing import parent_process
from multiprocessing.process import BaseProcess
from queue import Empty, Full
from typing import Any

import numpy as np
import torch
from torch import multiprocessing as processes

from navcore.errors import BadConfiguration
from navcore.learning.data.card import DatasetCard, Sample
from navcore.learning.data.class_names import BEWARE_CLASSES
from navcore.learning.training.batches import Batch
from navcore.learning.training.recipe import Recipe
from navcore.learning.training.window_pool import BYTES_PER_PIXEL, PooledImages, WindowPool
from navcore.perception.esanet.network.preprocess import Size

STEPS = 500
"""Number of batches of an epoch."""
JOBS_PER_EPOCH = 5
"""Number of jobs of a process in an epoch, as measured with 14 processes and a GPU: a run that is
resumed goes on after as many for each finished epoch."""
PATIENCE_S = 120.0
"""Time in seconds without an image after which the processes are taken to have failed."""
WAIT_S = 0.5
"""Time in seconds after which a process or thread that waits looks whether it shall end."""
ENDING_S = 30.0
"""Time in seconds within which a process notices that it shall end: after the next world."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """One kind of images, as an option each of `dataset render`."""

    seed: int
    """Seed of the worlds."""
    size: tuple[int, int]
    """Columns and rows."""
    disturbed: bool
    """Whether each world has a random light."""
    furnished: bool
    """Whether furniture has materials and tables have things on them."""


FINE, MIDDLE, COARSE = (848, 480), (640, 360), (424, 240)
SOURCES = (
    Source(seed=21, size=COARSE, disturbed=True, furnished=True),
    Source(seed=22, size=FINE, disturbed=True, furnished=True),
    Source(seed=23, size=COARSE, disturbed=False, furnished=False),
    Source(seed=24, size=FINE, disturbed=False, furnished=False),
    Source(seed=25, size=MIDDLE, disturbed=True, furnished=True),
    Source(seed=26, size=COARSE, disturbed=True, furnished=False),
    Source(seed=27, size=FINE, disturbed=False, furnished=True),
    Source(seed=28, size=FINE, disturbed=True, furnished=False),
    Source(seed=29, size=COARSE, disturbed=False, furnished=True),
    Source(seed=30, size=MIDDLE, disturbed=False, furnished=False),
)
"""What the shipped network was trained on, in equal parts."""


class RenderedBatches:
    """Windows of the images of the sources, the newest of which are kept in the memory of the
    device that trains; its processes render from the first epoch on until it is closed."""

    def __init__(
        self,
        recipe: Recipe,
        card: DatasetCard,
        device: torch.device,
        *,
        workers: int,
        memory_mb: int,
        sources: tuple[Source, ...] = SOURCES,
    ) -> None:
        """Use `workers` processes, and up to `memory_mb` megabytes for images. Raises
        `BadConfiguration` if the classes of `card`, whose depth statistics are used, are not those
        that are rendered, or if the recipe weighs them by their pixels."""
        if card.class_names != BEWARE_CLASSES:
            raise BadConfiguration(
                f"--rendered: the data set's classes are {', '.join(card.class_names):.200}; "
                f"expected those that are rendered: {', '.join(BEWARE_CLASSES)}"
            )
        if recipe.class_weights != "none":
            raise BadConfiguration(
                f"--rendered: class_weights is {recipe.class_weights!r}, expected 'none': "
                "the pixels of the classes are not known before"
            )
        self.steps = STEPS
        self._recipe, self._statistics, self._sources = recipe, card.depth, sources
        sizes = [source.size for source in sources]
        per_image = sum(BYTES_PER_PIXEL * width * height for width, height in sizes) / len(sizes)
        images = max(len(sources), int(memory_mb * 2**20 / per_image))
        self._shares = {size: sizes.count(size) / len(sizes) for size in sorted(set(sizes))}
        self._pools = {
            size: WindowPool(
                Size(height=size[1], width=size[0]),
                max(1, int(images * share)),
                len(BEWARE_CLASSES),
                device,
            )
            for size, share in self._shares.items()
        }
        self._random = torch.Generator(device=device)
        self._spawn, self._workers = processes.get_context("spawn"), workers
        self._queue, self._ending = self._spawn.Queue(maxsize=2 * workers), self._spawn.Event()
        self._processes: list[BaseProcess] = []
        self._arrived = threading.Event()
        self._failure: Exception | None = None
        # No image may take the place of another one while windows are cut out of that one.
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._receive, name="rendered images", daemon=True)
        self._thread.start()

    @property
    def kind(self) -> str:
        """What is rendered."""
        sources = "; ".join(
            f"seed {source.seed}, {source.size[0]}×{source.size[1]}"
            + ", disturbed" * source.disturbed
            + ", furnished" * source.furnished
            for source in self._sources
        )
        return f"images rendered meanwhile, of {len(self._sources)} kinds of worlds ({sources})"

    def close(self) -> None:
        """End the processes."""
        self._ending.set()
        self._thread.join(ENDING_S)
        for process in self._processes:
            process.join(ENDING_S)
            process.terminate()

    def batches(self, epoch: int) -> Iterator[Batch]:
        """Return the batches of an epoch; before the first, wait for images of each size, before
        a later one for any that came since. Raises `BadConfiguration` where no image comes, where
        no process renders any more, and where the images cannot be kept."""
        if not self._processes:
            self._start(JOBS_PER_EPOCH * (epoch - 1))
        seed = np.random.SeedSequence([self._recipe.seed, epoch]).generate_state(1, np.uint64)
        self._random.manual_seed(int(seed[0]))
        is_waiting = True
        while is_waiting:
            self._check_thread()
            if not self._arrived.wait(PATIENCE_S):
                raise BadConfiguration(f"--rendered: no image came within {PATIENCE_S:.0f} s")
            self._arrived.clear()
            is_waiting = not all(pool.count for pool in self._pools.values())
        if not any(process.is_alive() for process in self._processes):
            raise BadConfiguration(
                "--rendered: all processes that render have ended; if memory is short, "
                "use fewer --workers"
            )
        for _ in range(self.steps):
            self._check_thread()
            with self._lock:
                batch = self._batch()
            yield batch

    def _start(self, first_job: int) -> None:
        """Start the processes, each with its job `first_job`: those before it were rendered for
        the epochs before an interruption."""
        for number in range(self._workers):
            arguments = number, self._workers, first_job, self._sources, self._queue, self._ending
            process = self._spawn.Process(target=_render, args=arguments, daemon=True)
            process.start()
            self._processes.append(process)

    def _check_thread(self) -> None:
        """Raise `BadConfiguration` where no image is taken into the pools any more."""
        if self._failure is None and self._thread.is_alive():
            return
        error = self._failure
        why = "their thread has ended" if error is None else f"{type(error).__name__}: {error!s}"
        raise BadConfiguration(f"--rendered: the images cannot be kept: {why:.300}") from error

    def _batch(self) -> Batch:
        """Return a batch with windows of each size by its share of the images."""
        ends = np.round(np.cumsum(list(self._shares.values())) * self._recipe.batch).astype(int)
        parts = [
            pool.windows(int(number), self._recipe, self._statistics, self._random)
            for pool, number in zip(self._pools.values(), np.diff(ends, prepend=0), strict=True)
            if number
        ]
        return Batch(
            rgb=torch.cat([part.rgb for part in parts]),
            depth=torch.cat([part.depth for part in parts]),
            labels=torch.cat([part.labels for part in parts]),
        )

    def _receive(self) -> None:
        """Take images into the pools until the end; what goes wrong ends the training, which would
        else go on with the images that are there."""
        try:
            while not self._ending.is_set():
                self._take()
        except Exception as error:
            self._failure = error
        finally:
            self._arrived.set()

    def _take(self) -> None:
        """Take the images of a world into their pool, if some come in time."""
        try:
            number, images = self._queue.get(timeout=WAIT_S)
        except Empty:
            return
        except (OSError, EOFError):  # the process whose memory holds the images has ended
            return
        with self._lock:
            self._pools[self._sources[number].size].add(images)
        self._arrived.set()


def _render(
    number: int,
    workers: int,
    first_job: int,
    sources: tuple[Source, ...],
    queue: Any,
    ending: Any,
) -> None:
    """Render one source after the other, of each the shards of this process, until `ending` is set
    or the process that trains has ended."""
    import cv2

    from sim.dataset.generate import (
        POSES_PER_WORLD,
        SHARDS_PER_SPLIT,
        WORLDS_PER_JOB,
        render_images,
        shard_seed,
    )

    training = parent_process()

    def is_wanted() -> bool:
        # The parent first: killed while it holds the event's lock, it never gives that back.
        return (training is None or training.is_alive()) and not ending.is_set()

    with suppress(AttributeError):  # Windows has no priorities of this kind
        os.nice(8)
    cv2.setNumThreads(1)
    random = np.random.default_rng([number, first_job])
    for job in count(first_job):
        kind = (3 * number + job) % len(sources)
        source, shard = sources[kind], (number + workers * job) % SHARDS_PER_SPLIT
        images = render_images(
            seed=shard_seed(source.seed, "train", shard),
            worlds=WORLDS_PER_JOB,
            poses_per_world=POSES_PER_WORLD,
            size=source.size,
            disturbed=source.disturbed,
            furnished=source.furnished,
        )
        while world := list(islice(images, POSES_PER_WORLD)):
            samples = [
                Sample(rgb=image.rgb, depth=image.depth_mm, labels=image.labels) for image in world
            ]
            images_of_world = kind, PooledImages.of(samples, len(BEWARE_CLASSES), random)
            while is_wanted():
                with suppress(Full):
                    queue.put(images_of_world, timeout=WAIT_S)
                    break
            if not is_wanted():
                queue.cancel_join_thread()  # what is still in the queue is not wanted any more
                return
