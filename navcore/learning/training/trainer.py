"""Training of the network, epoch by epoch (`Training.run`).

With the images of a data set every random choice depends only on the recipe's seed, the epoch and
the index of the image, so that a resumed run draws the same as an uninterrupted one. Another source
of images may draw otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from navcore.errors import BadConfiguration
from navcore.learning.data.card import Split
from navcore.learning.data.dataset import Dataset
from navcore.learning.training.batches import (
    Batch,
    BatchSource,
    CachedSplit,
    DatasetBatches,
    MapBatches,
)
from navcore.learning.training.checkpoint import Epoch, RunState, read_state, write_state
from navcore.learning.training.distributed import Ranks
from navcore.learning.training.evaluation import InferenceSettings, evaluate
from navcore.learning.training.initial_weights import (
    new_network,
    transferred_network,
    with_depth_of,
)
from navcore.learning.training.losses import jaccard_loss, pyramid_losses
from navcore.learning.training.metrics import (
    count_pixels,
    logarithmic_weights,
    mean_iou,
    median_frequency_weights,
)
from navcore.learning.training.recipe import Recipe, learning_rate, momentum
from navcore.perception.esanet import EsaNet
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard, digest, save

SELECTION_CACHE_MB = 256
"""Memory for decoded images of the selection split, megabytes."""
MODEL_NAME, STATE_NAME = "model.safetensors", "state.pt"


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """How the machine runs a training. With the images of a data set nothing here changes the
    result but by rounding, and by the batch norm of several processes, each of which normalises its
    own part of a batch."""

    device: torch.device
    """Device that computes."""
    bfloat16: bool
    """Whether to compute in bfloat16."""
    ranks: Ranks = field(default_factory=Ranks)
    """This process among those of the run."""
    cache_mb: int = 4096
    """Memory for decoded images, megabytes per process."""
    map_batches: MapBatches = map
    """Function that maps image indexes to batches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """Progress of a run, reported after every step."""

    epoch: int
    """Number of the epoch, from 1."""
    step: int
    """Number of the step in its epoch, from 1."""
    steps: int
    """Number of steps per epoch."""
    loss: float
    """Loss of this step, as `training_loss` computes it."""


ProgressListener = Callable[[Step | Epoch], None]
"""Function that is called after every step and every epoch."""


class Training:
    """One training run: a network, its optimiser, and their progress."""

    def __init__(
        self,
        recipe: Recipe,
        dataset: Dataset,
        out: Path,
        machine: Machine,
        *,
        start: TrainedNetwork | None = None,
        source: BatchSource | None = None,
    ) -> None:
        """Prepare a run from the weights `start` or from scratch, that learns from `source`, the
        train split of the data set if None; raises `BadConfiguration` if recipe, data and weights
        do not fit."""
        if start is not None:
            dataset = with_depth_of(start, dataset)
        self.recipe, self.dataset, self.out, self._machine = recipe, dataset, out, machine
        if recipe.selection != "last" and not dataset.count(recipe.selection):
            raise BadConfiguration(
                f"training: selection: the data set has no {recipe.selection} images; "
                "choose another split, or last"
            )
        if len(dataset.card.class_names) < 2:
            raise BadConfiguration("training: the data set has one class; expected two or more")
        self.source = source or DatasetBatches(
            dataset,
            recipe,
            ranks=machine.ranks,
            cache_mb=machine.cache_mb,
            map_batches=machine.map_batches,
        )
        self.identity = recipe.identity(
            dataset.card,
            start=digest(start.network.state_dict(), {}) if start else None,
            source=self.source.kind,
        )
        self._selection = (
            None if recipe.selection == "last" else _selection(dataset, recipe.selection)
        )
        self.steps = self.source.steps
        card = self.card()
        network = (
            transferred_network(start, recipe, card)
            if start
            else new_network(recipe, card.num_classes)
        )
        self.network = network.to(machine.device)
        self.network = self.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._optimiser = torch.optim.SGD(
            self.network.parameters(),
            lr=1.0,
            momentum=0.9,
            nesterov=True,
            weight_decay=recipe.weight_decay,
        )
        self._class_weights = (
            torch.from_numpy(class_weights(recipe, dataset)).float().to(machine.device)
        )
        self.state = RunState(
            identity=self.identity, network={}, optimiser={}, labels=dataset.labels_digest()
        )
        if recipe.averaging:
            self.state.average = {
                key: value.clone() for key, value in self.network.state_dict().items()
            }

    def resume(self) -> None:
        """Continue the interrupted run in this folder; at most one epoch is lost."""
        self.state = read_state(self.out / STATE_NAME, self.identity, self.state.labels)
        self.network.load_state_dict(self.state.network)
        self._optimiser.load_state_dict(self.state.optimiser)
        self.state.average = {
            key: value.to(self._machine.device) for key, value in self.state.average.items()
        }

    def run(
        self, on_progress: ProgressListener = lambda progress: None, *, until: int | None = None
    ) -> RunState:
        """Train to the last epoch, or to epoch `until`; write the state and the best network after
        each epoch."""
        learner = self._learner()
        for number in range(len(self.state.history) + 1, (until or self.recipe.epochs) + 1):
            loss, rate = self._epoch(learner, number, on_progress)
            self._average_buffers()
            miou = self._validate(number)
            epoch = Epoch(number=number, loss=loss, learning_rate=rate, miou=miou)
            self._keep(epoch)
            on_progress(epoch)
        return self.state

    def card(self) -> WeightsCard:
        """Return the card of the network that this run trains: with the depth statistics of the
        network that it starts from, whose weights were learned with them."""
        names = self.dataset.card.class_names
        return WeightsCard(
            variant=self.recipe.variant,
            num_classes=len(names),
            width=self.recipe.width,
            class_names=names,
            depth=self.dataset.card.depth,
            source_sha256=self.identity,
            size=self.recipe.size,
        )

    def _epoch(
        self, learner: nn.Module, number: int, on_progress: ProgressListener
    ) -> tuple[float, float]:
        """Train one epoch; return the mean loss and the last learning rate."""
        self.network.train()
        losses = []
        for step, batch in enumerate(self.source.batches(number), start=1):
            rate = self._set_rate(number, step)
            loss = self._step(learner, batch)
            if self.recipe.averaging:
                self._average((number - 1) * self.steps + step)
            if not math.isfinite(loss):
                raise BadConfiguration(
                    f"training: the loss is {loss} in epoch {number}; lower learning_rate"
                )
            losses.append(loss)
            on_progress(Step(epoch=number, step=step, steps=self.steps, loss=loss))
        return self._machine.ranks.mean(sum(losses) / len(losses), self._machine.device), rate

    def _step(self, learner: nn.Module, batch: Batch) -> float:
        """Take one step of the optimiser; return the loss."""
        self._optimiser.zero_grad()
        loss = training_loss(
            learner,
            batch,
            self._class_weights,
            bfloat16=self._machine.bfloat16,
            jaccard=self.recipe.jaccard,
        )
        torch.autograd.backward(loss)
        self._optimiser.step()
        return loss.item()

    def _average(self, taken: int) -> None:
        """Move the averaged weights towards the current ones; faster in the first steps of the run,
        to forget the initial ones. `taken` is the number of steps of the run."""
        share = 1 - min(self.recipe.averaging, (1 + taken) / (10 + taken))
        for key, value in self.network.state_dict().items():
            average = self.state.average[key]
            if average.is_floating_point():
                average.lerp_(value, share)
            else:
                average.copy_(value)

    def _average_buffers(self) -> None:
        """Average the running means over all processes, each of which has those of its own
        images."""
        buffers = dict(self.network.named_buffers())
        averaged = [self.state.average[key] for key in buffers if key in self.state.average]
        self._machine.ranks.average([*buffers.values(), *averaged])

    def _set_rate(self, number: int, step: int) -> float:
        """Set learning rate and momentum of a step; return the learning rate."""
        step_index, steps = number - 1, self.recipe.epochs
        if self.recipe.schedule == "batch":
            step_index = step_index * self.steps + step - 1
            steps *= self.steps
        rate = learning_rate(self.recipe, step_index, steps)
        for parameters in self._optimiser.param_groups:
            parameters["lr"] = rate
            parameters["momentum"] = momentum(self.recipe, step_index, steps)
        return rate

    def _validate(self, number: int) -> float | None:
        if self._selection is None or (
            number % self.recipe.validate_every and number != self.recipe.epochs
        ):
            return None
        inference = InferenceSettings(
            size=self.recipe.size, batch=self.recipe.batch, bfloat16=self._machine.bfloat16
        )
        return mean_iou(
            evaluate(self._candidate(), self._selection, inference, ranks=self._machine.ranks)
        )

    def _candidate(self) -> EsaNet:
        """Return the network to validate and save: the averaged one if there is one."""
        if not self.state.average:
            return self.network
        candidate = self.card().architecture.skeleton()
        candidate.load_state_dict(self.state.average, assign=True)
        return candidate.to(memory_format=torch.channels_last)  # type: ignore[call-overload,no-any-return]

    def _keep(self, epoch: Epoch) -> None:
        """Record the epoch and write to disk: first the network if it is the best, then the
        state."""
        state = self.state
        state.history.append(epoch)
        better = epoch.miou is not None and epoch.miou > state.best_miou
        if better or self._selection is None:
            state.best_epoch, state.best_miou = (
                epoch.number,
                -1.0 if epoch.miou is None else epoch.miou,
            )
        state.network, state.optimiser = self.network.state_dict(), self._optimiser.state_dict()
        if self._machine.ranks.first:
            if state.best_epoch == epoch.number:
                save(self._candidate(), self.card(), self.out / MODEL_NAME)
            write_state(self.out / STATE_NAME, state)
        self._machine.ranks.wait()

    def _learner(self) -> nn.Module:
        """Return the network, wrapped to average the gradients if there are several processes."""
        if self._machine.ranks.count == 1:
            return self.network
        return DistributedDataParallel(self.network, forward_sync_buffers=False)


def _selection(dataset: Dataset, split: Split) -> CachedSplit:
    if not any(dataset.read_labels(split, index).any() for index in range(dataset.count(split))):
        raise BadConfiguration(
            f"training: selection: nothing is labelled in the {split} images; "
            "choose another split, or last"
        )
    return CachedSplit(dataset, split, cache_mb=SELECTION_CACHE_MB)


def training_loss(
    learner: nn.Module, batch: Batch, weights: Tensor, *, bfloat16: bool, jaccard: float = 0.0
) -> Tensor:
    """Return the sum of the losses of the four scales, plus `jaccard` times the Jaccard loss of the
    finest one: a scalar with its gradient."""
    device = weights.device
    rgb = batch.rgb.to(device).contiguous(memory_format=torch.channels_last)
    with torch.autocast(device.type, torch.bfloat16, enabled=bfloat16):
        outputs: Sequence[Tensor] = learner(rgb, batch.depth.to(device))
    # Cross entropy is several times as fast on class maps that are contiguous planes.
    logits = [output.float().contiguous() for output in outputs]
    labels = batch.labels.to(device)
    losses = pyramid_losses(logits, labels, weights)
    total = losses[0] + losses[1] + losses[2] + losses[3]
    return total + jaccard * jaccard_loss(logits[0], labels) if jaccard else total


def class_weights(recipe: Recipe, dataset: Dataset) -> npt.NDArray[np.float64]:
    """Return the class weights (C,) of the loss: 0 for a class that is not in the train split; all
    1 for `none`."""
    num_classes = len(dataset.card.class_names)
    if recipe.class_weights == "none":
        return np.ones(num_classes)
    counts = count_pixels(
        (dataset.read_labels("train", index) for index in range(dataset.count("train"))),
        num_classes,
    )
    weights = (
        median_frequency_weights(counts)
        if recipe.class_weights == "median"
        else logarithmic_weights(counts)
    )
    powered: npt.NDArray[np.float64] = weights**recipe.weight_power
    return powered
