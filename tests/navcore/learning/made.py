"""Small data sets for the tests: a floor with a red, near square on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from navcore.learning.data.card import Sample, Split
from navcore.learning.data.dataset import Dataset, DatasetWriter, load_dataset
from navcore.learning.training.recipe import Recipe
from navcore.perception.esanet.network.preprocess import Size

NAMES = ("floor", "book")
SIDE = 64


def sample(seed: int, *, height: int = SIDE, width: int = SIDE) -> Sample:
    """Noise, a square of label 2, floor of label 1, and a row of void."""
    random = np.random.default_rng(seed)
    rgb = random.integers(90, 120, size=(height, width, 3), dtype=np.uint8)
    depth = random.integers(1900, 2100, size=(height, width), dtype=np.uint16)
    labels = np.ones((height, width), dtype=np.uint8)
    row, col = random.integers(0, height // 2), random.integers(0, width // 2)
    square = np.s_[row : row + height // 3, col : col + width // 3]
    rgb[square], labels[square] = (220, 20, 30), 2
    depth[square] -= 200
    depth[random.random(size=depth.shape) < 0.05] = 0
    labels[0] = 0
    return Sample(rgb=rgb, depth=depth, labels=labels)


def data_set(folder: Path, *, train: int = 8, valid: int = 3, test: int = 2) -> Dataset:
    """Write one of 64×64 pictures and read it back."""
    writer = DatasetWriter(folder, class_names=NAMES, source={"made_by": "a test"})
    counts: dict[Split, int] = {"train": train, "valid": valid, "test": test}
    seed = 0
    for split, count in counts.items():
        for index in range(count):
            seed += 1
            one = sample(seed)
            writer.add(split, f"{index:04}", one.rgb, one.depth, one.labels)
    writer.finish()
    return load_dataset(folder)


def tiny_recipe(**changes: object) -> Recipe:
    """The smallest network on 64×64 pictures, in float32."""
    told = {
        "width": 0.125,
        "size": Size(height=SIDE, width=SIDE),
        "epochs": 3,
        "batch": 4,
        "precision": "float32",
    }
    return Recipe(**{**told, **changes})  # type: ignore[arg-type]
