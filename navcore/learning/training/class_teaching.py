"""Teaching a trained network further classes from few annotated images.

The classifier grows by the new classes, and only the rows of the taught ones are trained: the
logits of all other classes stay as they are, so that a known class loses no pixel but those that a
taught one wins. Everything before the classifier is frozen, so that each image is encoded once and
a step costs a crop of its features. (Training the last decoder module as well finds a new class no
better: IoU 0.83 and 0.84 of a shoe in held-back frames after 60 steps; but of six known classes it
lost three, with 8 images to rehearse on.)

What was known is not unlearned, because every pixel that an annotation says nothing about is a
target, too: the label that the network itself gave before (Li & Hoiem, "Learning without
Forgetting", 2016), however unsure of it. As only the rows of the taught classes are trained, their
gradient is the same whichever other class is the target, and that of distilling the old
probabilities. Only its own label of a taught class must be sure (pseudo-labels as in PLOP,
Douillard et al., CVPR 2021). Void in their place would leave these pixels to whatever the new class
takes; background would teach the network that known objects are nothing. Classes that no captured
image shows are rehearsed on images with known labels.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from navcore.errors import BadConfiguration
from navcore.learning.data.card import Sample
from navcore.learning.data.images import LabelArray
from navcore.learning.training.batches import plain_batch
from navcore.learning.training.evaluation import InferenceSettings, logits_of
from navcore.learning.training.initial_weights import transferred_network
from navcore.learning.training.losses import jaccard_loss, weighted_cross_entropy
from navcore.learning.training.recipe import Recipe
from navcore.learning.training.teaching_recipe import TeachingRecipe
from navcore.perception.esanet.network.model import EsaNet
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard

_STRIDE = 4
"""Stride of the features."""
WARM_SHARE = 0.1
"""Share of the steps in which the learning rate rises."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Encoded:
    """Features of an image before the classifier, and its targets."""

    features: Tensor
    """(C, h/4, w/4) half-precision input of the classifier."""
    labels: LabelArray
    """(h, w) targets: 0 = void, else class + 1."""


class Classifier(nn.Module):
    """The part of the decoder that has a row for each class."""

    def __init__(self, network: EsaNet) -> None:
        super().__init__()
        decoder = network.decoder
        self.conv_out = decoder.conv_out
        self.upsample1, self.upsample2 = decoder.upsample1, decoder.upsample2

    def forward(self, features: Tensor) -> Tensor:
        """Map features (B, C, h/4, w/4) to logits (B, classes, h, w)."""
        logits: Tensor = self.upsample2(self.upsample1(self.conv_out(features)))
        return logits


def grown_network(start: TrainedNetwork, names: Sequence[str], seed: int) -> TrainedNetwork:
    """Return a copy of a network whose head has grown by the classes of `names` that it lacks; the
    weights of all others are kept."""
    card = start.card
    known = {name.casefold() for name in card.class_names}
    new = tuple(name for name in names if name.casefold() not in known)
    classes = (*card.class_names, *new)
    grown = WeightsCard(
        variant=card.variant,
        num_classes=len(classes),
        width=card.width,
        class_names=classes,
        depth=card.depth,
        source_sha256=card.source_sha256,
        size=card.size,
    )
    recipe = Recipe(variant=card.variant, width=card.width, seed=seed)
    network = transferred_network(start, recipe, grown) if new else copy.deepcopy(start.network)
    return TrainedNetwork(network=network.eval(), card=grown)


def with_own_labels(
    network: EsaNet,
    sample: Sample,
    annotated: LabelArray,
    inference: InferenceSettings,
    statistics: DepthStatistics,
    sure: float,
    taught: Sequence[int],
) -> LabelArray:
    """Return targets (H, W): the annotation and, where it says nothing, the network's own label;
    void where that is one of the classes `taught` (0 … C−1) with a confidence below `sure`."""
    logits = logits_of(network, plain_batch([sample], inference.size, statistics), inference)
    whole = functional.interpolate(
        logits, size=sample.labels.shape, mode="bilinear", align_corners=False
    )
    confidence, classes = (one.numpy() for one in torch.softmax(whole[0], dim=0).max(dim=0))
    counts = (confidence >= sure) | ~np.isin(classes, taught)
    own = np.where(counts, classes + 1, 0).astype(np.uint8)
    return np.where(annotated > 0, annotated, own)


class ClassTeacher:
    """Trains the head of a network on encoded images; a step depends on the seed and its number
    alone, so that a resumed run draws the same."""

    def __init__(
        self, network: EsaNet, size: Size, recipe: TeachingRecipe, taught: Sequence[int]
    ) -> None:
        """`taught` are the numbers 0 … C−1 of the classes to learn."""
        self.network, self.size, self.recipe = network, size, recipe
        self.step = 0
        """Number of steps taken."""
        for parameter in network.parameters():
            parameter.requires_grad_(False)
        self.classifier = Classifier(network)
        for parameter in self.classifier.parameters():
            parameter.requires_grad_(True)
        self._rows = torch.zeros(network.num_classes)
        self._rows[list(taught)] = 1
        self._optimiser = torch.optim.Adam(self.classifier.parameters(), lr=recipe.learning_rate)
        self.captured: list[Encoded] = []
        """Captured images to learn from."""
        self.rehearsed: list[Encoded] = []
        """Images on which known classes are rehearsed."""

    def encoded(self, sample: Sample, statistics: DepthStatistics) -> Encoded:
        """Return the features of an image, whose labels are the targets."""
        batch = plain_batch([sample], self.size, statistics)
        with torch.no_grad():
            skips, fused = self.network.encode(batch.rgb, batch.depth)
            decoder = self.network.decoder
            x = self.network.context_module(fused)
            modules = (decoder.decoder_module_1, decoder.decoder_module_2, decoder.decoder_module_3)
            for module, skip in zip(modules, reversed(skips), strict=True):
                x = module.merge(module.refine(x), skip)
        return Encoded(
            features=x[0].half().clone(),
            labels=batch.labels[0].numpy(),
        )

    def predicted(self, image: Encoded) -> LabelArray:
        """Return the most likely class 0 … C−1 of every pixel (h, w) of an encoded image."""
        with torch.no_grad():
            logits = self.classifier(image.features.float()[None])
        return np.asarray(logits[0].argmax(dim=0).to(torch.uint8).numpy())

    def losses(self) -> Iterator[float]:
        """Take the remaining steps; yield the loss of each. Raises `BadConfiguration` without
        images."""
        if not self.captured:
            raise BadConfiguration("teaching: there is no image to learn from")
        while self.step < self.recipe.steps:
            yield self._take_step()

    def state(self) -> dict[str, object]:
        """Return what the remaining steps depend on besides recipe and images."""
        return {
            "step": self.step,
            "classifier": self.classifier.state_dict(),
            "optimiser": self._optimiser.state_dict(),
        }

    def restore(self, state: dict[str, object]) -> None:
        """Continue from a state."""
        self.classifier.load_state_dict(state["classifier"])  # type: ignore[arg-type]
        self._optimiser.load_state_dict(state["optimiser"])  # type: ignore[arg-type]
        self.step = int(state["step"])  # type: ignore[call-overload]

    def _take_step(self) -> float:
        recipe = self.recipe
        rng = np.random.default_rng([recipe.seed, self.step])
        crops = [self._crop(self._chosen(rng), rng) for _ in range(recipe.batch)]
        features, labels = (torch.stack(parts) for parts in zip(*crops, strict=True))
        for parameters in self._optimiser.param_groups:
            parameters["lr"] = recipe.learning_rate * _rate(self.step, recipe.steps)
        self._optimiser.zero_grad()
        logits = self.classifier(features.float()).contiguous()
        weights = torch.ones(logits.shape[1])
        loss = weighted_cross_entropy(logits, labels.long() - 1, weights)
        if recipe.jaccard:
            loss = loss + recipe.jaccard * jaccard_loss(logits, labels)
        torch.autograd.backward(loss)
        self._keep_other_rows()
        self._optimiser.step()
        self.step += 1
        value = loss.item()
        if not math.isfinite(value):
            raise BadConfiguration(f"teaching: the loss is {value}; lower the learning rate")
        return value

    def _keep_other_rows(self) -> None:
        """Leave the rows of all other classes as they are: Adam changes nothing whose gradients
        were always 0."""
        for parameter in self.classifier.parameters():
            assert parameter.grad is not None
            parameter.grad *= self._rows.view(-1, *(1 for _ in parameter.shape[1:]))

    def _chosen(self, rng: np.random.Generator) -> Encoded:
        rehearse = self.rehearsed and rng.random() >= self.recipe.captured_share
        images = self.rehearsed if rehearse else self.captured
        return images[int(rng.integers(len(images)))]

    def _crop(self, image: Encoded, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """Return a random window of features and targets."""
        height, width = image.labels.shape
        side_rows, side_cols = min(self.recipe.crop, height), min(self.recipe.crop, width)
        row, col = (
            int(rng.integers(height - side_rows + 1)),
            int(rng.integers(width - side_cols + 1)),
        )
        if rng.random() < self.recipe.focus and (at := _focus(image.labels, rng)) is not None:
            row = int(np.clip(at[0] - int(rng.integers(side_rows)), 0, height - side_rows))
            col = int(np.clip(at[1] - int(rng.integers(side_cols)), 0, width - side_cols))
        row, col = row // _STRIDE * _STRIDE, col // _STRIDE * _STRIDE
        features = image.features[
            :,
            row // _STRIDE : (row + side_rows) // _STRIDE,
            col // _STRIDE : (col + side_cols) // _STRIDE,
        ]
        labels = image.labels[row : row + side_rows, col : col + side_cols]
        return features, torch.from_numpy(np.ascontiguousarray(labels))


def _focus(labels: LabelArray, rng: np.random.Generator) -> tuple[int, int] | None:
    """Return a random pixel of a random class of the image, small classes first."""
    classes, counts = np.unique(labels[labels > 0], return_counts=True)
    if not len(classes):
        return None
    shares = 1 / np.sqrt(counts)
    rows, cols = np.nonzero(labels == rng.choice(classes, p=shares / shares.sum()))
    at = int(rng.integers(len(rows)))
    return int(rows[at]), int(cols[at])


def _rate(step: int, steps: int) -> float:
    """Return the learning rate of a step, relative to the largest: up in the first tenth, then down
    as a cosine."""
    warm = max(1, round(WARM_SHARE * steps))
    if step < warm:
        return (step + 1) / warm
    return 0.5 * (1 + math.cos(math.pi * (step - warm) / max(1, steps - warm)))
