"""A network is trained on worlds that processes render meanwhile."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from queue import Full
from typing import Any

import numpy as np
import pytest
import torch

from app.learning import rendered_batches, training
from app.learning.rendered_batches import RenderedBatches, Source
from navcore.errors import BadConfiguration
from navcore.learning.data.class_names import BEWARE_CLASSES
from navcore.learning.data.dataset import DatasetWriter, load_dataset
from navcore.learning.training.batches import Batch
from navcore.learning.training.window_pool import PooledImages
from navcore.perception.esanet.weights import weights_file as weights
from sim.dataset import generate
from sim.dataset.generate import LabelledImage
from tests.navcore.learning.made import data_set, sample, tiny_recipe

SOURCES = (
    Source(seed=21, size=(64, 48), disturbed=True, furnished=True),
    Source(seed=22, size=(96, 64), disturbed=False, furnished=False),
)


@pytest.mark.long
def test_a_network_learns_from_worlds_that_are_rendered_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rendered_batches, "STEPS", 3)
    monkeypatch.setattr(training, "RenderedBatches", partial(RenderedBatches, sources=SOURCES))
    writer = DatasetWriter(tmp_path / "d", class_names=BEWARE_CLASSES)
    one = sample(0)
    writer.add("valid", "0", one.rgb, one.depth, one.labels)
    writer.finish()
    run = training.train(
        tiny_recipe(class_weights="none", epochs=2, selection="last"),
        load_dataset(tmp_path / "d"),
        tmp_path / "out",
        resume=False,
        device="cpu",
        workers=2,  # one for each size
        cache_mb=4,
        rendered=True,
    )
    assert run is not None and [epoch.number for epoch in run.state.history] == [1, 2]
    assert run.steps == 3
    trained = weights.load(tmp_path / "out" / "model.safetensors")
    assert trained.card.class_names == BEWARE_CLASSES
    learned = trained.network.state_dict()["encoder_rgb.bn1.num_batches_tracked"]
    assert int(learned) == 6


def pooled() -> PooledImages:
    return PooledImages.of([sample(0)], len(BEWARE_CLASSES), np.random.default_rng(0))


@pytest.fixture
def batches(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[RenderedBatches]:
    """Batches of images that the test hands over by itself."""
    monkeypatch.setattr(rendered_batches, "_render", wait_for_the_end)
    card = dataclasses.replace(data_set(tmp_path).card, class_names=BEWARE_CLASSES)
    recipe = tiny_recipe(class_weights="none")
    sources = (Source(seed=1, size=(64, 64), disturbed=False, furnished=False),)
    made = RenderedBatches(
        recipe, card, torch.device("cpu"), workers=1, memory_mb=1, sources=sources
    )
    yield made
    made.close()


def wait_for_the_end(*arguments: Any) -> None:
    """Stands for the process that renders."""
    arguments[-1].wait()


def test_no_image_is_replaced_while_windows_are_cut(
    batches: RenderedBatches, monkeypatch: pytest.MonkeyPatch
) -> None:
    (pool,) = batches._pools.values()
    batches._queue.put((0, pooled()))
    assert batches._arrived.wait(30.0)
    added = threading.Event()
    cut = pool.windows
    monkeypatch.setattr(pool, "add", lambda images: added.set())

    def windows(*arguments: Any) -> Batch:
        batches._queue.put((0, pooled()))
        assert not added.wait(1.0)
        return cut(*arguments)

    monkeypatch.setattr(pool, "windows", windows)
    next(batches.batches(1))
    assert added.wait(5.0)


def test_an_error_of_the_thread_that_keeps_the_images_ends_the_training(
    batches: RenderedBatches,
) -> None:
    wrong = dataclasses.replace(pooled(), labels=torch.zeros((1, 5, 5), dtype=torch.uint8))
    batches._queue.put((0, wrong))
    with pytest.raises(BadConfiguration, match="cannot be kept"):
        next(batches.batches(1))


def test_no_epoch_begins_without_an_image_since_the_last_one(
    batches: RenderedBatches, monkeypatch: pytest.MonkeyPatch
) -> None:
    batches._queue.put((0, pooled()))
    next(batches.batches(1))
    monkeypatch.setattr(rendered_batches, "PATIENCE_S", 0.01)
    with pytest.raises(BadConfiguration, match="no image came within"):
        next(batches.batches(2))
    batches._queue.put((0, pooled()))
    assert batches._arrived.wait(30.0)
    next(batches.batches(3))


class CannotBeRead:
    """Stands for images that raise an error when they are taken out of the queue."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _unreadable, ()


def _unreadable() -> None:
    raise RuntimeError("received 0 items of ancdata")


def test_an_error_of_the_queue_ends_a_training_that_has_images_already(
    batches: RenderedBatches,
) -> None:
    batches._queue.put((0, pooled()))
    steps = batches.batches(1)
    next(steps)
    batches._queue.put(CannotBeRead())
    batches._thread.join(30.0)
    with pytest.raises(BadConfiguration, match="cannot be kept: RuntimeError: received 0 items"):
        next(steps)


def test_the_end_of_the_thread_that_keeps_the_images_is_noticed(batches: RenderedBatches) -> None:
    batches._queue.put((0, pooled()))
    steps = batches.batches(1)
    next(steps)
    batches._ending.set()
    batches._thread.join(30.0)
    with pytest.raises(BadConfiguration, match="cannot be kept: their thread has ended"):
        next(steps)


def test_a_resumed_training_goes_on_with_other_worlds_and_windows(
    batches: RenderedBatches, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts, drawn, start = list[int](), list[int](), batches._start

    def noted(first_job: int) -> None:
        starts.append(first_job)
        start(first_job)

    monkeypatch.setattr(batches, "_start", noted)
    for epoch in (4, 5, 4):
        batches._queue.put((0, pooled()))
        next(batches.batches(epoch))
        drawn.append(batches._random.initial_seed())
    assert starts == [3 * rendered_batches.JOBS_PER_EPOCH]
    assert drawn[0] == drawn[2] != drawn[1]


def test_a_process_renders_from_its_first_job_on_and_ends_with_the_training(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    source, seeds, tries = SOURCES[0], list[int](), list[int]()

    class FullQueue:
        def put(self, images: object, timeout: float) -> None:
            tries.append(1)
            assert len(tries) == 1, "the training has ended"
            raise Full

        def cancel_join_thread(self) -> None:
            pass

    def one_image(*, seed: int, **_: object) -> Iterator[LabelledImage]:
        seeds.append(seed)
        shown = sample(0)
        yield LabelledImage(
            world_seed=seed, name="0", rgb=shown.rgb, depth_mm=shown.depth, labels=shown.labels
        )

    class Parent:
        def is_alive(self) -> bool:
            return not tries

    monkeypatch.setattr(rendered_batches, "parent_process", Parent)
    monkeypatch.setattr(generate, "render_images", one_image)
    monkeypatch.setattr("os.nice", lambda more: None)
    monkeypatch.setattr("cv2.setNumThreads", lambda count: None)
    rendered_batches._render(2, 4, 5, (source,), FullQueue(), threading.Event())
    assert seeds == [generate.shard_seed(source.seed, "train", 2 + 4 * 5)] and tries == [1]


def test_a_data_set_without_images_to_report_on_is_refused(tmp_path: Path) -> None:
    dataset = data_set(tmp_path / "d", valid=0, test=0)
    with pytest.raises(BadConfiguration, match="no valid and no test images"):
        training.train(
            tiny_recipe(class_weights="none"),
            dataset,
            tmp_path / "out",
            resume=False,
            device="cpu",
            rendered=True,
        )


def test_other_classes_and_weights_by_pixels_are_refused(tmp_path: Path) -> None:
    recipe, device = tiny_recipe(class_weights="none"), torch.device("cpu")
    card = data_set(tmp_path).card
    with pytest.raises(BadConfiguration, match="classes are floor, book; expected"):
        RenderedBatches(recipe, card, device, workers=1, memory_mb=1)
    rendered = dataclasses.replace(card, class_names=BEWARE_CLASSES)
    with pytest.raises(BadConfiguration, match="class_weights is 'median', expected 'none'"):
        RenderedBatches(
            dataclasses.replace(recipe, class_weights="median"),
            rendered,
            device,
            workers=1,
            memory_mb=1,
        )
