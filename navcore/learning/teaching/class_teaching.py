"""Teaching a trained network further classes from few annotated images.

The classifier grows by the new classes, and of its 3×3 convolution the rows of the taught classes
alone are learned: the logits of all other classes stay as they are, so that a known class loses no
pixel but those that a taught one wins. Everything before the classifier is frozen, so that each
image is encoded once.

The upsampling behind the convolution is linear and is not trained, so the logit of a taught class
is a linear function of its row, and the cross entropy is convex in the rows: multinomial logistic
regression, with one minimum that L-BFGS with a line search (Nocedal & Wright, "Numerical
Optimization", 2006, chapter 7) finds in some 20 steps, without a learning rate; they begin at the
rows of the start, of a new class at zero. What is learned depends on the images alone. (Training
the upsampling as well, from random weights by stochastic steps, makes the logit a product of three
layers: with one seed of four the first steps, in which the random class had to be silenced, halved
the kernels of the upsampling, and 120 steps later the class was still found nowhere. Where it was
found, cups lost up to 0.3 of their IoU to it.)

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

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from navcore.errors import BadConfiguration
from navcore.learning.data.card import Sample
from navcore.learning.data.images import LabelArray
from navcore.learning.teaching.taught_rows import IMAGES_AT_ONCE, Encoded, TaughtRows
from navcore.learning.teaching.teaching_recipe import TeachingRecipe
from navcore.learning.training.augmentation import resized
from navcore.learning.training.batches import plain_batch
from navcore.learning.training.initial_weights import transferred_network
from navcore.learning.training.recipe import Recipe
from navcore.perception.esanet.network.model import EsaNet
from navcore.perception.esanet.network.preprocess import DepthStatistics, Size
from navcore.perception.esanet.weights.weights_file import TrainedNetwork, WeightsCard

ROUND = 5
"""Number of steps between two points of the curves."""
ENOUGH = 0.02
"""Share of the loss that a round must take off for another one to follow."""
HISTORY = 20
"""Number of steps that L-BFGS remembers."""
STEP_BYTES_PER_PIXEL = 120
"""Memory of a step for each pixel of the images that are looked at together, measured."""


def grown_network(start: TrainedNetwork, names: Sequence[str]) -> TrainedNetwork:
    """Return a copy of a network whose head has grown by the classes of `names` that it lacks.

    The weights of all others are kept. Those of a new class are 0, but for the upsampling, which is
    the mean of the known classes'.
    """
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
        # No input of a convolution changes, so those that run on bytes keep their ranges.
        ranges=card.ranges,
    )
    network = transferred_network(start, Recipe(variant=card.variant, width=card.width), grown)
    decoder, count = network.decoder, card.num_classes
    modules = (decoder.decoder_module_1, decoder.decoder_module_2, decoder.decoder_module_3)
    with torch.no_grad():
        for outputs in (decoder.conv_out, *(module.side_output for module in modules)):
            for parameter in outputs.parameters():
                parameter[count:] = 0
        for upsampling in (decoder.upsample1, decoder.upsample2):
            for parameter in upsampling.parameters():
                parameter[count:] = parameter[:count].mean(dim=0)
    return TrainedNetwork(network=network.eval(), card=grown)


def memory_needed(network: EsaNet, size: Size, images: int) -> int:
    """Return about how many bytes the encoded images and the steps of a training take besides the
    network."""
    pixels = size.height * size.width
    encoded = network.decoder.conv_out.in_channels * pixels // 16 * 2 + pixels * (2 + 1)
    return images * encoded + IMAGES_AT_ONCE * STEP_BYTES_PER_PIXEL * pixels


class ClassTeacher:
    """Learns the rows of the taught classes from encoded images; what comes of it depends on the
    images and the recipe alone."""

    def __init__(
        self,
        network: EsaNet,
        size: Size,
        recipe: TeachingRecipe,
        taught: Sequence[int],
        *,
        known: int,
    ) -> None:
        """`taught` are the numbers 0 … C−1 of the classes to learn; the first `known` classes of
        the network are those that it was trained on."""
        self.network, self.size, self.recipe = network.requires_grad_(False), size, recipe
        self.step = 0
        """Number of steps taken."""
        self.captured: list[Encoded] = []
        """Captured images to learn from."""
        self.rehearsed: list[Encoded] = []
        """Images on which known classes are rehearsed."""
        self._known, self._last, self._ended = known, math.inf, False
        self._rows = TaughtRows(network.decoder, taught)
        self._optimiser = torch.optim.LBFGS(
            self._rows.moved,
            max_eval=20 * ROUND,
            tolerance_grad=0.0,
            tolerance_change=0.0,
            history_size=HISTORY,
            line_search_fn="strong_wolfe",
        )

    def encoded(
        self, sample: Sample, statistics: DepthStatistics, *, own_labels: bool = False
    ) -> Encoded:
        """Return what of an image does not depend on the taught rows, its labels the targets.

        Pixels without a colour are void. With `own_labels`, before the first step, other void
        becomes the label that the network gives, and stays void where that is a taught class with a
        confidence below `confidence_threshold`.
        """
        batch = plain_batch([sample], self.size, statistics)
        decoder, labels = self.network.decoder, batch.labels[0].numpy()
        with torch.no_grad():
            skips, x = self.network.encode(batch.rgb, batch.depth)
            logits, features = decoder.with_features(self.network.context_module(x), skips)
            stay = [i for i in range(len(logits[0])) if i not in self._rows.taught]
            others = torch.logsumexp(logits[0, stay], dim=0)
        if own_labels:
            labels = np.where(labels > 0, labels, self._own_labels(logits[0]))
        if sample.uncoloured is not None:
            unknown = dataclasses.replace(sample, labels=sample.uncoloured.view(np.uint8))
            labels = np.where(resized(unknown, self.size).labels, 0, labels).astype(np.uint8)
        return Encoded(features=features[0].half(), others=others.half(), labels=labels)

    def predicted(self, image: Encoded, among: int | None = None) -> LabelArray:
        """Return the most likely class 0 … C−1 of every pixel (h, w) of an encoded image, `among`
        the first ones if given."""
        with torch.no_grad():
            logits = self.network.decoder.classified(image.features.float()[None])[:, :among]
        return np.asarray(logits[0].argmax(dim=0).to(torch.uint8).numpy())

    def losses(self, on_evaluation: Callable[[], None] = lambda: None) -> Iterator[float]:
        """Take the remaining steps in rounds, until one gains too little; yield the least loss of
        each.

        `on_evaluation` is called at every evaluation of the loss; when it raises, only another
        teacher can go on, from the last state. Raises `BadConfiguration` without images.
        """
        if not self.captured:
            raise BadConfiguration("teaching: there is no image to learn from")
        self._rows.measure(self.captured)
        self._rows.write()
        while not self._ended:
            before, self._last = self._last, self._take_round(on_evaluation)
            self._ended = self.step >= self.recipe.steps or self._last > (1 - ENOUGH) * before
            yield self._last

    def state(self) -> dict[str, object]:
        """Return what the remaining steps depend on besides recipe and images."""
        return {
            "step": self.step,
            "last": self._last,
            "ended": self._ended,
            "moved": [one.detach() for one in self._rows.moved],
            "optimiser": self._optimiser.state_dict(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state."""
        with torch.no_grad():
            for tensor, value in zip(self._rows.moved, state["moved"], strict=True):
                tensor.copy_(value)
        self._optimiser.load_state_dict(state["optimiser"])
        self.step, self._last = int(state["step"]), float(state["last"])
        self._ended = bool(state["ended"])

    def _take_round(self, on_evaluation: Callable[[], None]) -> float:
        """Take up to `ROUND` steps and return the least loss."""
        images = [*self.captured, *self.rehearsed]
        values: list[float] = []

        def evaluate() -> float:
            on_evaluation()
            self._optimiser.zero_grad()
            values.append(self._rows.loss(images, self.recipe.l2_penalty))
            return values[-1]

        steps = min(ROUND, self.recipe.steps - self.step)
        for group in self._optimiser.param_groups:
            group["max_iter"] = steps
        self._optimiser.step(evaluate)  # type: ignore[no-untyped-call]
        self.step += steps
        self._rows.write()
        if not math.isfinite(min(values)):
            raise BadConfiguration(f"teaching: the loss is {min(values)}")
        return min(values)

    def _own_labels(self, logits: Tensor) -> LabelArray:
        """Return the labels (h, w) that the start gives for logits (C, h, w)."""
        confidence, classes = torch.softmax(logits[: self._known], dim=0).max(dim=0)
        unsure = torch.isin(classes, torch.tensor(self._rows.taught)) & (
            confidence < self.recipe.confidence_threshold
        )
        return np.asarray(torch.where(unsure, 0, classes + 1).to(torch.uint8).numpy())
