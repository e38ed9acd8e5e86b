"""Comparison of two networks, class by class, on images that neither was trained on."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from app.teaching.training.paired_counts import PairedCounts
from navcore.learning.data.card import Sample
from navcore.learning.data.images import LabelArray
from navcore.learning.training.evaluation import InferenceSettings, predict
from navcore.perception.esanet.network.preprocess import DepthStatistics
from navcore.perception.esanet.weights.weights_file import TrainedNetwork
from web.interface.teaching import NOTHING_NAME, ClassFigures

LEAST_IOU = 0.3
"""IoU in the captured images below which a taught class is not found."""


def compared(
    old: TrainedNetwork,
    new: TrainedNetwork,
    captured: Sequence[Sample],
    rendered: Sequence[Sample],
    inference: InferenceSettings,
    depth: DepthStatistics,
    on_progress: Callable[[int], None] = lambda done: None,
) -> tuple[list[ClassFigures], float | None]:
    """Return the figures per class, and the share of the captured pixels without an annotation on
    which both networks agree (None without such pixels).

    The labels of both are those of `new`, whose first classes are those of `old`; `depth` are the
    statistics of both in the unit of the images. An annotated class is judged on the captured
    images, with the truth of `truth_of`. All other classes are judged on the rendered images, whose
    labels are exact.
    """

    def found_by_both(sample: Sample) -> tuple[LabelArray, LabelArray]:
        was, now = (predict(one.network, [sample], inference, depth)[0] for one in (old, new))
        return was, now

    classes = len(new.card.class_names)
    on_captured, on_rendered = PairedCounts(classes), PairedCounts(classes)
    alike = unnamed = done = 0
    marked = {int(label) for sample in captured for label in np.unique(sample.labels) if label}
    annotated = [label for label in marked if new.card.class_names[label - 1] != NOTHING_NAME]
    for sample in captured:
        was, now = found_by_both(sample)
        truth, silent = truth_of(sample.labels, was + 1, annotated), sample.labels == 0
        if sample.uncoloured is not None:
            truth, silent = np.where(sample.uncoloured, 0, truth), silent & ~sample.uncoloured
        alike += int((silent & (was == now)).sum())
        unnamed += int(silent.sum())
        on_captured.add(truth, was, now)
        on_progress(done := done + 1)
    for sample in rendered:
        was, now = found_by_both(sample)
        on_rendered.add(sample.labels, was, now)
        on_progress(done := done + 1)
    figures = []
    for index, name in enumerate(new.card.class_names):
        is_captured = index + 1 in annotated
        pair = on_captured if is_captured else on_rendered
        known = index < len(old.card.class_names)
        figures.append(_figures(pair, index, name, known=known, captured=is_captured))
    return figures, round(alike / unnamed, 4) if unnamed else None


def truth_of(
    annotation: LabelArray, own: npt.NDArray[np.integer], annotated: Sequence[int]
) -> LabelArray:
    """Return the true labels (h, w) of an annotated image: its annotation and, where that names
    nothing, the old network's own label, except for the labels `annotated` in any image: of those
    the annotations tell more, and there it is void."""
    silent = np.where(np.isin(own, annotated), 0, own)
    return np.where(annotation > 0, annotation, silent).astype(np.uint8)


def not_found(figures: Sequence[ClassFigures], taught: Sequence[str]) -> tuple[str, ...]:
    """Return the taught classes that the new network does not find in images it was not trained
    on."""
    wanted = {name.casefold() for name in taught}
    return tuple(
        one.name
        for one in figures
        if one.name.casefold() in wanted and (one.new is None or one.new < LEAST_IOU)
    )


def _figures(
    pair: PairedCounts, index: int, name: str, *, known: bool, captured: bool
) -> ClassFigures:
    ious, change = pair.ious(index), pair.interval(index) if known else None
    return ClassFigures(
        name=name,
        pixels=pair.pixels(index),
        old=round(ious[0], 4) if ious and known else None,
        new=round(ious[1], 4) if ious else None,
        change=(round(change[0], 4), round(change[1], 4)) if change else None,
        images="captured" if captured else "rendered",
    )
