"""Training: it learns, it goes on after a kill as if nothing had happened, and several processes
agree with one."""

from __future__ import annotations

import dataclasses
import itertools
import multiprocessing
import os
import pickle
import shutil
import socket
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from app.learning.training import train
from navcore.errors import BadConfiguration
from navcore.learning.data.dataset import load_dataset
from navcore.learning.training.batches import CachedSplit, epoch_batches, training_batch
from navcore.learning.training.checkpoint import Epoch, RunState
from navcore.learning.training.distributed import Ranks
from navcore.learning.training.evaluation import InferenceSettings, evaluate, predict
from navcore.learning.training.initial_weights import new_network, transferred_network
from navcore.learning.training.metrics import (
    confusion_matrix,
    count_pixels,
    median_frequency_weights,
)
from navcore.learning.training.recipe import Recipe, learning_rate, momentum
from navcore.learning.training.trainer import (
    MODEL_NAME,
    STATE_NAME,
    Machine,
    ProgressListener,
    Step,
    Training,
    class_weights,
    training_loss,
)
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size
from navcore.perception.esanet.weights import weights_file as weights
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard
from tests.navcore.learning.made import NAMES, data_set, tiny_recipe

CPU = torch.device("cpu")
HERE = Machine(device=CPU, bfloat16=False)


def begun(recipe: Recipe, data: Path, out: Path, machine: Machine = HERE) -> Training:
    out.mkdir(exist_ok=True)
    return Training(recipe, load_dataset(data), out, machine)


def same(one: dict[str, Tensor], other: dict[str, Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[key], other[key]) for key in one)


@pytest.mark.long
@pytest.mark.parametrize("averaging", [0.0, 0.9])
def test_a_resumed_run_equals_the_uninterrupted_one_bit_for_bit(
    averaging: float, tmp_path: Path
) -> None:
    data_set(tmp_path / "d")
    recipe = tiny_recipe(averaging=averaging, schedule="batch")
    whole = begun(recipe, tmp_path / "d", tmp_path / "whole").run()
    begun(recipe, tmp_path / "d", tmp_path / "cut").run(until=1)
    torch.manual_seed(77)  # whatever else drew numbers meanwhile
    again = begun(recipe, tmp_path / "d", tmp_path / "cut")
    again.resume()
    resumed = again.run()
    assert same(whole.network, resumed.network)
    assert same(whole.average, resumed.average)
    assert whole.history == resumed.history
    assert (whole.best_epoch, whole.best_miou) == (resumed.best_epoch, resumed.best_miou)
    kept = [
        weights.load(tmp_path / name / MODEL_NAME).network.state_dict() for name in ("whole", "cut")
    ]
    assert same(*kept)


def test_it_learns_and_keeps_the_best_epoch(tmp_path: Path) -> None:
    data_set(tmp_path / "d", train=16)
    news: list[Step | Epoch] = []
    training = begun(tiny_recipe(epochs=8, learning_rate=0.04), tmp_path / "d", tmp_path / "out")
    state = training.run(news.append)
    assert state.history[-1].loss < 0.6 * state.history[0].loss
    mious = [epoch.miou for epoch in state.history if epoch.miou is not None]
    assert state.best_miou == max(mious)
    assert state.best_epoch == mious.index(max(mious)) + 1
    assert [one.step for one in news if isinstance(one, Step)] == [1, 2, 3, 4] * 8

    trained = weights.load(tmp_path / "out" / MODEL_NAME)
    assert trained.card.size == training.recipe.size
    assert (trained.card.class_names, trained.card.depth) == (NAMES, training.dataset.card.depth)
    images = CachedSplit(training.dataset, "valid", cache_mb=1)
    confusion = evaluate(
        trained.network, images, InferenceSettings(size=training.recipe.size, batch=2)
    )
    by_hand = np.zeros((2, 2), dtype=np.int64)
    for index in range(3):
        (classes,) = predict(
            trained.network,
            [images[index]],
            InferenceSettings(size=training.recipe.size),
            trained.card.depth,
        )
        by_hand += confusion_matrix(images[index].labels, classes, 2)
    np.testing.assert_array_equal(confusion, by_hand)


@pytest.mark.long
def test_bfloat16_learns_nearly_the_same(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    losses: dict[bool, list[float]] = {False: [], True: []}
    # The loss after the few steps of one epoch differs by chance, by some per cent a seed.
    for bfloat16, seed in itertools.product(losses, range(5)):
        machine = Machine(device=CPU, bfloat16=bfloat16)
        recipe = tiny_recipe(epochs=1, seed=seed)
        state = begun(recipe, tmp_path / "d", tmp_path / f"{bfloat16} {seed}", machine).run()
        losses[bfloat16].append(state.history[0].loss)
        assert all(value.dtype != torch.bfloat16 for value in state.network.values())
    assert np.mean(losses[True]) == pytest.approx(np.mean(losses[False]), rel=0.05)
    assert losses[True] != losses[False]


def test_the_jaccard_loss_counts_as_often_as_the_recipe_says(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    first: list[float] = []
    for weight in (0.0, 1.0, 3.0):
        news: list[Step | Epoch] = []
        begun(tiny_recipe(epochs=1, jaccard=weight), tmp_path / "d", tmp_path / str(weight)).run(
            news.append
        )
        assert isinstance(news[0], Step)
        first.append(news[0].loss)
    without, once, thrice = first
    assert 0 < once - without < 1
    assert thrice - without == pytest.approx(3 * (once - without), rel=1e-4)


def test_what_could_teach_nothing_is_refused_before_it_begins(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    for label in (tmp_path / "d").glob("valid/label/*.npy"):
        np.save(label, np.zeros_like(np.load(label)))
    with pytest.raises(BadConfiguration, match="nothing is labelled in the valid images"):
        begun(tiny_recipe(), tmp_path / "d", tmp_path / "out")
    begun(tiny_recipe(selection="last"), tmp_path / "d", tmp_path / "out")
    with pytest.raises(BadConfiguration, match="one image each"):
        epoch_batches(8, 4, seed=0, epoch=1, ranks=4)


def test_class_weights_follow_the_recipe(tmp_path: Path) -> None:
    dataset = data_set(tmp_path / "d")
    counts = count_pixels((dataset.read("train", index).labels for index in range(8)), 2)
    expected = median_frequency_weights(counts)
    np.testing.assert_allclose(class_weights(tiny_recipe(), dataset), expected)
    np.testing.assert_allclose(
        class_weights(tiny_recipe(weight_power=0.5), dataset), np.sqrt(expected)
    )
    np.testing.assert_array_equal(
        class_weights(tiny_recipe(class_weights="none"), dataset), [1.0, 1.0]
    )


def test_runs_that_cannot_be_are_refused(tmp_path: Path) -> None:
    data_set(tmp_path / "d", valid=0)
    with pytest.raises(BadConfiguration, match="no valid images"):
        begun(tiny_recipe(), tmp_path / "d", tmp_path / "out")
    with pytest.raises(BadConfiguration, match="do not fill"):
        begun(tiny_recipe(batch=9, selection="test"), tmp_path / "d", tmp_path / "out")
    with pytest.raises(BadConfiguration, match="lower learning_rate"):
        begun(
            tiny_recipe(learning_rate=10.0, epochs=40, selection="last"),
            tmp_path / "d",
            tmp_path / "out",
        ).run()


def test_a_run_is_not_resumed_on_edited_labels_but_on_a_copy(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    dataset, out = data_set(tmp_path / "d"), tmp_path / "out"
    recipe = tiny_recipe(epochs=1)
    begun(recipe, tmp_path / "d", out).run()
    copy = shutil.copytree(tmp_path / "d", tmp_path / "copy", copy_function=shutil.copyfile)
    begun(recipe, copy, out).resume()
    path = copy / dataset.files["train"][0][2]
    labels = np.load(path)
    labels[0, 0] = 1 - min(labels[0, 0], 1)
    np.save(path, labels)
    with pytest.raises(BadConfiguration, match="labels of the data set, or its lists, were edited"):
        begun(recipe, copy, out).resume()
    assert not caplog.messages

    state = torch.load(out / STATE_NAME, weights_only=True)
    del state["labels"]  # as earlier releases wrote it
    torch.save(state, out / STATE_NAME)
    edited = begun(recipe, copy, out)
    edited.resume()
    assert "is of an earlier release" in caplog.text
    assert edited.state.labels == load_dataset(copy).labels_digest()


def test_another_order_of_the_images_is_another_data_set(tmp_path: Path) -> None:
    before = data_set(tmp_path / "d").labels_digest()
    for kind in ("rgb", "depth", "label"):
        path = tmp_path / "d" / f"train_{kind}.txt"
        path.write_text("".join(reversed(path.read_text().splitlines(keepends=True))))
    assert load_dataset(tmp_path / "d").labels_digest() != before


def test_the_state_of_another_run_is_refused(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    out = tmp_path / "out"
    begun(tiny_recipe(epochs=1), tmp_path / "d", out).run()
    with pytest.raises(BadConfiguration, match="another recipe"):
        begun(tiny_recipe(epochs=2), tmp_path / "d", out).resume()
    with pytest.raises(BadConfiguration, match="--resume"):
        train(tiny_recipe(epochs=1), load_dataset(tmp_path / "d"), out, resume=False)
    with pytest.raises(BadConfiguration, match="no run to continue"):
        train(
            tiny_recipe(epochs=1), load_dataset(tmp_path / "d"), tmp_path / "elsewhere", resume=True
        )
    whole = (out / STATE_NAME).read_bytes()
    for content in (
        whole[:1000],
        pickle.dumps({"format": "bewarenav-training-1"}),
        pickle.dumps(_Hostile(out / "struck")),
    ):
        (out / STATE_NAME).write_bytes(content)
        with pytest.raises(BadConfiguration, match=STATE_NAME):
            begun(tiny_recipe(epochs=1), tmp_path / "d", out).resume()
    assert not (out / "struck").exists()


class _Hostile:
    """Its pickle would make a file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self._path,)


def test_the_mirrored_picture_is_labelled_as_the_mirror(tmp_path: Path) -> None:
    dataset = data_set(tmp_path / "d", train=1, valid=1, test=1)
    from navcore.learning.training.augmentation import flipped

    network = new_network(tiny_recipe(), 2)
    inference = InferenceSettings(size=tiny_recipe().size, mirrored_too=True)
    one = dataset.read("test", 0)
    (classes,) = predict(network, [one], inference, dataset.card.depth)
    (mirrored,) = predict(network, [flipped(one)], inference, dataset.card.depth)
    assert (classes == mirrored[:, ::-1]).mean() > 0.999


@pytest.mark.long
def test_two_processes_take_the_steps_that_one_would_take(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    recipe = tiny_recipe(epochs=2, batch=8, learning_rate=1e-3)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    context = multiprocessing.get_context("spawn")
    children = [
        context.Process(target=_one_of_two, args=(rank, port, recipe, tmp_path))
        for rank in range(2)
    ]
    for child in children:
        child.start()
    for child in children:
        child.join(120)
        assert child.exitcode == 0
    states = [torch.load(tmp_path / f"rank{rank}.pt", weights_only=True) for rank in range(2)]
    assert same(*states)
    written = torch.load(tmp_path / "out" / STATE_NAME, weights_only=True)
    assert same(states[0], written["network"])

    expected = _by_hand(recipe, tmp_path / "d")
    for key, value in expected.items():
        torch.testing.assert_close(states[0][key], value, rtol=1e-4, atol=1e-5)
    # The control: the weights have moved much further than that.
    start = new_network(recipe, 2).state_dict()
    assert max(float((start[key] - value).abs().max()) for key, value in expected.items()) > 1e-3


def _one_of_two(rank: int, port: int, recipe: Recipe, folder: Path) -> None:
    """What torchrun would start."""
    os.environ |= {
        "RANK": str(rank),
        "LOCAL_RANK": str(rank),
        "WORLD_SIZE": "2",
        "MASTER_ADDR": "127.0.0.1",
        "MASTER_PORT": str(port),
    }
    torch.set_num_threads(1)
    original, kept = Training.run, []

    def run(self: Training, watch: ProgressListener) -> RunState:
        kept.append(self)
        return original(self, watch)

    Training.run = run  # type: ignore[assignment,method-assign]
    train(recipe, load_dataset(folder / "d"), folder / "out", resume=False, device="cpu", workers=1)
    torch.save(kept[0].network.state_dict(), folder / f"rank{rank}.pt")


def _by_hand(recipe: Recipe, data: Path) -> dict[str, Tensor]:
    """The parameters after the run: in each step the mean of both halves' gradients, by one
    process."""
    dataset = load_dataset(data)
    network = new_network(recipe, 2).to(memory_format=torch.channels_last).train()  # type: ignore[call-overload]
    optimiser = torch.optim.SGD(
        network.parameters(), lr=1.0, momentum=0.9, nesterov=True, weight_decay=recipe.weight_decay
    )
    images = CachedSplit(dataset, "train", cache_mb=16)
    loss_weights = torch.from_numpy(class_weights(recipe, dataset)).float()
    for epoch in range(1, recipe.epochs + 1):
        group = optimiser.param_groups[0]
        group["lr"], group["momentum"] = (
            how(recipe, epoch - 1, recipe.epochs) for how in (learning_rate, momentum)
        )
        halves = [
            epoch_batches(8, recipe.batch, seed=0, epoch=epoch, rank=rank, ranks=2)
            for rank in range(2)
        ]
        for step in zip(*halves, strict=True):
            optimiser.zero_grad()
            for indexes in step:
                batch = training_batch(
                    images, indexes, recipe.size, recipe.augmentation, seed=0, epoch=epoch
                )
                torch.autograd.backward(
                    training_loss(network, batch, loss_weights, bfloat16=False) / 2
                )
            optimiser.step()
    return {key: value.detach() for key, value in network.named_parameters()}


def test_a_run_goes_on_from_trained_weights(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    first = begun(tiny_recipe(epochs=2), tmp_path / "d", tmp_path / "first")
    first.run()
    start = weights.load(tmp_path / "first" / MODEL_NAME)
    recipe = tiny_recipe(epochs=1, crop=Size(height=32, width=32))
    out = tmp_path / "second"
    out.mkdir()
    second = Training(recipe, load_dataset(tmp_path / "d"), out, HERE, start=start)
    assert same(
        second.network.state_dict(),
        weights.load(tmp_path / "first" / MODEL_NAME).network.state_dict(),
    )
    second.run()
    first_weights = weights.load(tmp_path / "first" / MODEL_NAME).network.state_dict()
    assert not same(second.network.state_dict(), first_weights)
    assert same(start.network.state_dict(), first_weights)
    with pytest.raises(
        BadConfiguration, match="another recipe or other data"
    ):  # the start is part of what a run is
        begun(recipe, tmp_path / "d", out).resume()


def started(recipe: Recipe, data: Path, out: Path) -> Training:
    """A run from a network of many steps and another depth, of the classes of a larger data set."""
    network = new_network(recipe, 2)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            assert module.num_batches_tracked is not None
            module.num_batches_tracked += 50_000
    card = WeightsCard(
        variant=recipe.variant,
        num_classes=2,
        width=recipe.width,
        class_names=NAMES,
        depth=DepthStatistics(mean=3.0, std=1.5, units_per_m=1.0),
        source_sha256="0" * 64,
    )
    start = TrainedNetwork(network=network, card=card)
    out.mkdir(exist_ok=True)
    return Training(recipe, load_dataset(data), out, HERE, start=start)


def test_the_average_forgets_the_weights_that_a_run_starts_from(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    recipe = tiny_recipe(averaging=0.999, selection="last")
    training = started(recipe, tmp_path / "d", tmp_path / "out")
    before = {key: value.clone() for key, value in training.network.state_dict().items()}
    shares: list[float] = []

    def note(_: Step | Epoch) -> None:
        key = "decoder.conv_out.bias"
        here, now = training.state.average[key], training.network.state_dict()[key]
        shares.append(float((here - before[key]).norm() / (now - before[key]).norm()))

    training.run(note, until=1)
    assert shares[0] == pytest.approx(9 / 11, rel=1e-3)  # of the first step


def test_the_average_has_the_running_means_of_all_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data_set(tmp_path / "d")
    training = begun(tiny_recipe(averaging=0.9), tmp_path / "d", tmp_path / "out")
    training._machine = dataclasses.replace(HERE, ranks=Ranks(count=2))
    key = "encoder_rgb.bn1.running_mean"
    training.state.average[key].fill_(1.0)
    # The other process has three everywhere.
    monkeypatch.setattr(torch.distributed, "all_reduce", lambda tensor: tensor.add_(3.0))
    training._average_buffers()
    assert float(training.state.average[key].mean()) == 2.0
    assert float(training.network.state_dict()[key].mean()) == 1.5
    weight = "encoder_rgb.conv1.weight"
    assert torch.equal(training.state.average[weight], training.network.state_dict()[weight])


def test_a_run_from_trained_weights_keeps_their_depth_in_the_units_of_its_images(
    tmp_path: Path,
) -> None:
    data_set(tmp_path / "d")
    training = started(tiny_recipe(), tmp_path / "d", tmp_path / "out")
    kept = DepthStatistics(mean=3000.0, std=1500.0, units_per_m=1000.0)
    assert training.card().depth == kept
    batch = next(training.source.batches(1))
    plain = load_dataset(tmp_path / "d").card.depth
    millimetres = batch.depth * 1500 + 3000
    assert float(millimetres.mean()) == pytest.approx(plain.mean, rel=0.05)


def test_what_was_learned_is_carried_over_to_other_classes(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    begun(tiny_recipe(epochs=1), tmp_path / "d", tmp_path / "first").run()
    start = weights.load(tmp_path / "first" / MODEL_NAME)
    kept = start.card.class_names[1]
    card = dataclasses.replace(
        start.card, num_classes=3, class_names=("puddle", kept.capitalize(), "ladder")
    )
    recipe = tiny_recipe(epochs=1)
    taught, fresh = (
        transferred_network(start, recipe, card).state_dict(),
        new_network(recipe, 3).state_dict(),
    )
    learned = start.network.state_dict()
    others = [key for key in taught if taught[key].shape == learned[key].shape]
    assert all(torch.equal(taught[key], learned[key]) for key in others)
    per_class = taught.keys() - others
    assert "decoder.conv_out.weight" in per_class and len(per_class) < 20
    for key in per_class:
        assert torch.equal(taught[key][1], learned[key][1])
        assert torch.equal(taught[key][[0, 2]], fresh[key][[0, 2]])


def test_a_run_does_not_start_from_another_kind_of_network(tmp_path: Path) -> None:
    data_set(tmp_path / "d")
    begun(tiny_recipe(epochs=1), tmp_path / "d", tmp_path / "first").run()
    start = weights.load(tmp_path / "first" / MODEL_NAME)
    with pytest.raises(
        BadConfiguration, match=r"r18-nbt1d × 0\.125; the recipe asks for r18-nbt1d × 0\.25"
    ):
        Training(tiny_recipe(width=0.25), load_dataset(tmp_path / "d"), tmp_path, HERE, start=start)
