"""Rendered images of known objects, to rehearse and to compare them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from navcore.learning.data.card import Sample
from navcore.learning.data.class_names import BEWARE_CLASSES
from navcore.learning.data.images import LabelArray
from sim.dataset.generate import Split, render_images, shard_seed
from web.interface.teaching import NOTHING_NAME

POSES_PER_WORLD = 4
RIM_PX = 33
"""Side in pixels of the square by which objects of rendered images are widened."""
_SEEDS, _FIRST_SEED = 300, 10
"""Number of seeds of rendered images, and the first one. Training images are of the split `train`:
no world of the split `test` of any seed is among them."""


def rendered(split: Split, count: int, class_names: Sequence[str], seed: int) -> Iterator[Sample]:
    """Yield images of random worlds with the labels of a network with these classes; void for
    objects that are none of them."""
    labels = labels_of(class_names)
    images = render_images(
        seed=shard_seed(seed % _SEEDS + _FIRST_SEED, split, 0),
        worlds=-(-count // POSES_PER_WORLD),
        poses_per_world=POSES_PER_WORLD,
    )
    for _, image in zip(range(count), images, strict=False):
        yield Sample(rgb=image.rgb, depth=image.depth_mm, labels=labels[image.labels])


def labels_of(class_names: Sequence[str]) -> LabelArray:
    """Return the table (256,) from the renderer's labels to those of a network with these classes;
    0 for objects that are none of them."""
    names = [name.casefold() for name in class_names]
    labels = np.zeros(256, dtype=np.uint8)
    for index, name in enumerate(BEWARE_CLASSES):
        labels[index + 1] = names.index(name) + 1 if name in names else 0
    return labels


def around_objects(sample: Sample, class_names: Sequence[str]) -> Sample:
    """Return a rendered image whose background is void but for a rim around the objects: elsewhere
    may stand what is to be taught, which the renderer calls background."""
    nothing = class_names.index(NOTHING_NAME) + 1 if NOTHING_NAME in class_names else 0
    objects = (sample.labels > 0) & (sample.labels != nothing)
    near = cv2.dilate(objects.view(np.uint8), np.ones((RIM_PX, RIM_PX), dtype=np.uint8)) > 0
    labels = np.where((sample.labels == nothing) & ~near, 0, sample.labels).astype(np.uint8)
    return dataclasses.replace(sample, labels=labels)
