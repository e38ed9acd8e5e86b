"""IoU of two networks on the same images, and the interval of their difference."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.learning.training.metrics import confusion_matrix

RESAMPLES = 500
"""Number of times that the images are drawn again for an interval."""
Classes = npt.NDArray[np.uint8]
Counts = npt.NDArray[np.int64]


class PairedCounts:
    """Pixels per image (or group of images) and class: hits, union of found and true, true ones."""

    def __init__(self, classes: int) -> None:
        self._classes = classes
        self._counts: list[Counts] = []

    def add(self, truth: Classes, was: Classes, now: Classes) -> None:
        """Add an image: its labels, and the classes that the old and the new network find."""
        self._counts.append(
            np.stack([_counts(truth, found, self._classes) for found in (was, now)])
        )

    def merge(self, other: PairedCounts) -> None:
        """Add all images of `other` as one group, which is drawn as one for an interval."""
        if other._counts:
            self._counts.append(np.sum(other._counts, axis=0))

    def pixels(self, index: int) -> int:
        """Return the number of true pixels of a class."""
        return int(sum(counts[0, 2, index] for counts in self._counts))

    def ious(self, index: int) -> tuple[float, float] | None:
        """Return the IoU of a class by the old and by the new network; None without true pixels."""
        if not self.pixels(index):
            return None
        total = np.sum(self._counts, axis=0)[..., index]
        old, new = (float(hits / union) for hits, union, _ in total)
        return old, new

    def interval(self, index: int) -> tuple[float, float] | None:
        """Return the 95 % interval of new − old of a class by a seeded bootstrap over the images;
        None with fewer than two that show it."""
        counts = np.array(self._counts)[..., index] if self._counts else np.empty((0, 2, 3))
        shown = counts[counts[:, 0, 2] > 0]
        if len(shown) < 2:
            return None
        # Images without the class count as well: what is falsely found there is in the union.
        rng = np.random.default_rng(0)
        drawn = counts[rng.integers(len(counts), size=(RESAMPLES, len(counts)))].sum(axis=1)
        drawn = drawn[drawn[:, 0, 2] > 0]
        change = drawn[:, 1, 0] / drawn[:, 1, 1] - drawn[:, 0, 0] / drawn[:, 0, 1]
        low, high = np.percentile(change, [2.5, 97.5])
        return float(low), float(high)


def _counts(truth: Classes, found: Classes, classes: int) -> Counts:
    """Return hits, union and true pixels (3, C) of an image."""
    confusion = confusion_matrix(truth, found, classes)
    hits, true = np.diag(confusion), confusion.sum(axis=1)
    return np.stack([hits, true + confusion.sum(axis=0) - hits, true])
