"""Comparison of two networks, class by class, on images that neither was trained on."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from navcore.learning.data.card import Sample
from navcore.learning.training.evaluation import InferenceSettings, predict
from navcore.learning.training.metrics import confusion_matrix, ious
from navcore.perception.esanet.weights.weights_file import TrainedNetwork
from web.interface.teaching import NOTHING_NAME, ClassFigures

Confusion = npt.NDArray[np.int64]


def compared(
    old: TrainedNetwork,
    new: TrainedNetwork,
    captured: Sequence[Sample],
    rendered: Sequence[Sample],
    inference: InferenceSettings,
    on_progress: Callable[[int], None] = lambda done: None,
) -> tuple[list[ClassFigures], float | None]:
    """Return the figures per class, and the share of the captured pixels without an annotation on
    which both networks agree (None without such pixels).

    The labels of both are those of `new`, whose first classes are those of `old`. An annotated
    class is judged on the captured images: what an annotation names none of is not of an annotated
    class, so the old network's own label is its truth. All other classes are judged on the rendered
    images, whose labels are exact.
    """
    classes = len(new.card.class_names)
    on_captured, on_rendered = _Pair(classes), _Pair(classes)
    alike = unnamed = done = 0
    annotated: set[int] = set()
    for sample in captured:
        was, now = (
            predict(one.network, [sample], inference, one.card.depth)[0] for one in (old, new)
        )
        silent = sample.labels == 0
        alike += int((silent & (was == now)).sum())
        unnamed += int(silent.sum())
        annotated |= set(np.unique(sample.labels[~silent]).tolist())
        truth = np.where(silent, was + 1, sample.labels).astype(np.uint8)
        on_captured.add(truth, was, now)
        on_progress(done := done + 1)
    for sample in rendered:
        was, now = (
            predict(one.network, [sample], inference, one.card.depth)[0] for one in (old, new)
        )
        on_rendered.add(sample.labels, was, now)
        on_progress(done := done + 1)
    figures = []
    for index, name in enumerate(new.card.class_names):
        is_annotated = index + 1 in annotated and name != NOTHING_NAME
        pair = on_captured if is_annotated else on_rendered
        known = index < len(old.card.class_names)
        figures.append(
            ClassFigures(
                name=name,
                pixels=int(pair.old[index].sum()),
                old=_figure(pair.old, index) if known else None,
                new=_figure(pair.new, index),
                images="captured" if is_annotated else "rendered",
            )
        )
    return figures, round(alike / unnamed, 4) if unnamed else None


class _Pair:
    """Confusion matrices (C, C) of both networks on the same images."""

    def __init__(self, classes: int) -> None:
        self.old: Confusion = np.zeros((classes, classes), dtype=np.int64)
        self.new: Confusion = np.zeros((classes, classes), dtype=np.int64)

    def add(
        self,
        truth: npt.NDArray[np.uint8],
        was: npt.NDArray[np.uint8],
        now: npt.NDArray[np.uint8],
    ) -> None:
        """Add an image."""
        self.old += confusion_matrix(truth, was, len(self.old))
        self.new += confusion_matrix(truth, now, len(self.new))


def _figure(confusion: Confusion, index: int) -> float | None:
    value = float(ious(confusion)[index])
    return None if np.isnan(value) else round(value, 4)
