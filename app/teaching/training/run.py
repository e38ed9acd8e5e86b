"""A training run: the program of the process that the console starts.

It takes the lowest priority and few threads, writes its progress into its folder, saves its state
at every validation, and ends by itself when it is asked to. The folder becomes a version when
`version.json` is written, last.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from app.teaching.networks.versions import MODEL_NAME, write_version
from app.teaching.training.comparison import compared, not_found, truth_of
from app.teaching.training.plan import DATA_NAME, START_NAME, TrainingPlan, read_plan
from app.teaching.training.progress import RunProgress, read_progress, write_progress
from app.teaching.training.rehearsal import around_objects, rendered
from app.teaching.training.validation_images import AT_MOST, write_validation_images
from navcore.errors import BadConfiguration, StorageFailed
from navcore.files import write_whole
from navcore.learning.data.card import Sample
from navcore.learning.data.dataset import Dataset, load_dataset
from navcore.learning.data.images import RgbArray
from navcore.learning.teaching.class_teaching import ClassTeacher, grown_network, memory_needed
from navcore.learning.teaching.taught_rows import Encoded
from navcore.learning.teaching.teaching_recipe import TeachingRecipe
from navcore.learning.training.augmentation import resized
from navcore.learning.training.evaluation import InferenceSettings
from navcore.learning.training.initial_weights import with_depth_of
from navcore.learning.training.metrics import confusion_matrix, ious
from navcore.perception.esanet.inference.network_file import nearest_size
from navcore.perception.esanet.network.limits import STRIDE
from navcore.perception.esanet.network.preprocess import Size, check_size
from navcore.perception.esanet.weights.weights_file import WeightsCard, digest, load, save
from sim.dataset.generate import Split
from web.interface.teaching import CurvePoint, NetworkVersion

STATE_NAME = "state.pt"
WRITE_EVERY_S = 1.0
"""Time between two writes of the progress, seconds."""
SPARE_BYTES = 500_000_000
"""Memory that a training leaves to the robot."""


class Cancelled(Exception):  # noqa: N818 - no error
    """The run was asked to end."""


class TeachingRun:
    """One run, from its plan to a version."""

    def __init__(self, folder: Path, is_cancelled: Callable[[], bool] = lambda: False) -> None:
        self.folder, self._is_cancelled = folder, is_cancelled
        self.plan: TrainingPlan = read_plan(folder)
        self.recipe: TeachingRecipe = self.plan.recipe
        self.progress: RunProgress = dataclasses.replace(read_progress(folder), message="")
        self._written_s = -WRITE_EVERY_S
        self.start = load(folder / self.plan.start_path)
        self.dataset: Dataset = with_depth_of(self.start, load_dataset(folder / DATA_NAME))
        self.inference = InferenceSettings(size=self._working_size(), batch=1)
        self.grown = grown_network(self.start, self.plan.class_names)
        self._validation: list[RgbArray] = []

    def _taught(self) -> list[int]:
        """Return the numbers of the annotated classes in the grown network."""
        names = [name.casefold() for name in self.grown.card.class_names]
        return [names.index(name.casefold()) for name in self.plan.class_names]

    def _working_size(self) -> Size:
        """Return the size at which the network works from now on."""
        if self.plan.size is not None:
            size = Size(height=self.plan.size[0], width=self.plan.size[1])
            check_size(size, STRIDE)
            return size
        if self.start.card.size is not None:
            return self.start.card.size
        height, width = max(self.dataset.card.sizes)
        return nearest_size(Size(height=height, width=width))

    def run(self) -> NetworkVersion:
        """Train, compare and write the version; raises `Cancelled`, and `BadConfiguration` where
        memory is too short."""
        self._check_memory()
        self._teach()
        return self._finish()

    def _check_memory(self) -> None:
        """Raise `BadConfiguration` where the images do not fit into memory beside the robot."""
        images = len(self.dataset) + self.recipe.rehearsal
        needed = memory_needed(self.grown.network, self.inference.size, images) + SPARE_BYTES
        available = available_bytes()
        if available is not None and needed > available:
            raise BadConfiguration(
                f"{images} images take {needed / 1e9:.1f} GB of memory, {available / 1e9:.1f} GB "
                "are free; delete images or their marks, or rehearse with fewer"
            )

    def _teach(self) -> None:
        """Learn the rows of the taught classes; what that takes of memory is free afterwards."""
        rehearsed = [
            around_objects(one, self.grown.card.class_names)
            for one in self._rendered("train", self.recipe.rehearsal)
        ]
        teacher = ClassTeacher(
            self.grown.network,
            self.inference.size,
            self.recipe,
            self._taught(),
            known=self.start.card.num_classes,
        )
        held = self._encode(teacher, rehearsed)
        self._resume(teacher)
        self._train(teacher, held)

    def _rendered(self, split: Split, count: int) -> Iterator[Sample]:
        """Yield rendered images with the labels of the grown network."""
        images = rendered(split, count, self.grown.card.class_names, self.recipe.seed)
        for index, sample in enumerate(images):
            self._tell("rendering", index, count)
            yield sample

    def captured(self, split: Any) -> Iterator[Sample]:
        """Yield the captured images of a split, with the labels of the grown network."""
        names = [name.casefold() for name in self.grown.card.class_names]
        labels = np.zeros(256, dtype=np.uint8)
        for index, name in enumerate(self.dataset.card.class_names):
            labels[index + 1] = names.index(name.casefold()) + 1 if name.casefold() in names else 0
        for index in range(self.dataset.count(split)):
            sample = self.dataset.read(split, index)
            yield dataclasses.replace(sample, labels=labels[sample.labels])

    def _encode(self, teacher: ClassTeacher, rehearsed: Sequence[Sample]) -> list[Encoded]:
        """Encode all images; return the held-back ones, with their true labels."""
        statistics, total = self.dataset.card.depth, len(self.dataset) + len(rehearsed)
        done, held, annotated = 0, [], [number + 1 for number in self._taught()]
        for split in ("train", "valid"):
            for sample in self.captured(split):
                self._tell("encoding", done, total)
                encoded = teacher.encoded(sample, statistics, own_labels=True)
                if split == "train":
                    teacher.captured.append(encoded)
                else:
                    annotation = resized(sample, self.inference.size).labels
                    truth = truth_of(annotation, encoded.labels, annotated)
                    held.append(dataclasses.replace(encoded, labels=truth))
                    if len(self._validation) < AT_MOST:
                        self._validation.append(sample.rgb)
                done += 1
        for sample in rehearsed:
            self._tell("encoding", done, total)
            teacher.rehearsed.append(teacher.encoded(sample, statistics))
            done += 1
        return held

    def _train(self, teacher: ClassTeacher, held: Sequence[Encoded]) -> None:
        def tell() -> None:
            self._tell("training", teacher.step, self.recipe.steps)

        for loss in teacher.losses(tell):
            self._validate(teacher, held, loss)

    def _validate(self, teacher: ClassTeacher, held: Sequence[Encoded], loss: float) -> None:
        """Judge the held-back images, draw them, and save the state."""
        classes = len(self.grown.card.class_names)
        total = np.zeros((classes, classes), dtype=np.int64)
        found = [teacher.predicted(encoded) for encoded in held]
        for encoded, predicted in zip(held, found, strict=True):
            total += confusion_matrix(encoded.labels, predicted, classes)
        self.progress.losses.append(CurvePoint(step=teacher.step, value=round(loss, 6)))
        taught = ious(total)[self._taught()]
        if not np.isnan(taught).all():  # at the working size nothing may be left of small objects
            miou = round(float(np.nanmean(taught)), 4)
            self.progress.mious.append(CurvePoint(step=teacher.step, value=miou))
        self.progress.looks = write_validation_images(
            self.folder, self._validation, found[:AT_MOST], self.grown.card.class_names
        )
        self._save_state(teacher)
        self._tell("training", teacher.step, self.recipe.steps, at_once=True)

    def _finish(self) -> NetworkVersion:
        """Compare, save the network, and write the version."""
        tests = list(self._rendered("test", self.recipe.rendered_test))
        held = list(self.captured("valid"))
        count = len(tests) + len(held)
        self._tell("comparing", 0, count, at_once=True)
        figures, kept = compared(
            self.start,
            self.grown,
            held,
            tests,
            self.inference,
            self.dataset.card.depth,
            lambda done: self._tell("comparing", done, count),
        )
        target = self.folder / MODEL_NAME
        save(self.grown.network, self._card(), target, half=True)
        version = NetworkVersion(
            name=self.plan.name,
            origin="training",
            sha256=hashlib.sha256(target.read_bytes()).hexdigest(),
            class_names=self.grown.card.class_names,
            taught=self.plan.class_names,
            start_name=self.plan.start_name,
            created_unix_s=round(time.time(), 1),
            figures=tuple(figures),
            kept_share=kept,
            not_found=not_found(figures, self.plan.class_names),
        )
        write_version(self.folder, version)
        with contextlib.suppress(OSError):
            (self.folder / STATE_NAME).unlink(missing_ok=True)
            (self.folder / START_NAME).unlink(missing_ok=True)
        shutil.rmtree(self.folder / DATA_NAME, ignore_errors=True)
        with contextlib.suppress(StorageFailed):  # the version is there, which says the same
            self._tell("done", self.recipe.steps, self.recipe.steps, at_once=True)
        return version

    def _card(self) -> WeightsCard:
        """Return the card with the identity of the network."""
        recipe = json.dumps(dataclasses.asdict(self.recipe), sort_keys=True)
        identity = digest(self.grown.network.state_dict(), {"recipe": recipe})
        return dataclasses.replace(
            self.grown.card, source_sha256=identity, size=self.inference.size
        )

    def _save_state(self, teacher: ClassTeacher) -> None:
        content = io.BytesIO()
        torch.save(teacher.state(), content)
        write_whole(self.folder / STATE_NAME, content.getvalue())

    def _resume(self, teacher: ClassTeacher) -> None:
        """Continue from the last saved state, if there is one."""
        path = self.folder / STATE_NAME
        if not path.exists():
            self.progress.losses, self.progress.mious = [], []
            return
        try:
            teacher.restore(torch.load(path, weights_only=True))
        except Exception as error:  # a damaged file can make the reader fail in any way
            raise BadConfiguration(
                f"{path}: the training cannot be resumed: {error!s:.200}"
            ) from None

    def _tell(self, phase: Any, done: int, of: int, *, at_once: bool = False) -> None:
        """Write the progress, at most once a second; raises `Cancelled` when asked to end."""
        if self._is_cancelled() and phase != "done":
            raise Cancelled
        now = time.monotonic()
        self.progress.phase, self.progress.done, self.progress.of = phase, done, of
        if at_once or now - self._written_s >= WRITE_EVERY_S:
            self._written_s = now
            write_progress(self.folder, self.progress)


def available_bytes() -> int | None:
    """Return the memory that is free, or can be made so; None where that is not known."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return next(
            int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable")
        )
    except (OSError, StopIteration):
        return None
