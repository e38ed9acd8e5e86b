"""Benchmark of the training: images per second, forward, backward and optimiser."""

from __future__ import annotations

import os
import time

import torch
from rich.table import Table

from app.learning.training import keep_freed_memory
from navcore.learning.training.batches import Batch
from navcore.learning.training.initial_weights import new_network
from navcore.learning.training.recipe import Recipe
from navcore.learning.training.trainer import training_loss
from navcore.perception.esanet.network.preprocess import Size

SIZES = (Size(height=256, width=320), Size(height=256, width=448))
WIDTHS = (0.5, 0.25)
"""Channels of the network relative to the paper's."""
CLASSES, BATCH = 12, 8
STEPS = 5
"""Number of measured steps, after one to warm up; the median counts."""


def training_table() -> Table:
    """Measure training steps without reading images, on all cores; return a table."""
    before = torch.get_num_threads()
    torch.set_num_threads(os.cpu_count() or 1)
    keep_freed_memory()
    table = Table("size", "width", "precision", "images/s", title="training, without reading")
    for size in SIZES:
        for width in WIDTHS:
            for precision in ("float32", "bfloat16"):
                recipe = Recipe(width=width, size=size, batch=BATCH)
                rate = _images_per_s(recipe, bfloat16=precision == "bfloat16")
                table.add_row(f"{size.width}×{size.height}", f"{width:g}", precision, f"{rate:.1f}")
    torch.set_num_threads(before)
    return table


def _images_per_s(recipe: Recipe, *, bfloat16: bool) -> float:
    network = new_network(recipe, CLASSES).to(memory_format=torch.channels_last).train()  # type: ignore[call-overload]
    optimiser = torch.optim.SGD(network.parameters(), lr=1e-3, momentum=0.9, nesterov=True)
    shape = (recipe.batch, recipe.size.height, recipe.size.width)
    images, weights = torch.randn(shape[0], 4, *shape[1:]), torch.ones(CLASSES)
    labels = torch.randint(0, CLASSES + 1, shape, dtype=torch.uint8)
    batch = Batch(rgb=images[:, :3], depth=images[:, 3:], labels=labels)
    seconds = []
    for _ in range(STEPS + 1):
        started = time.perf_counter()
        optimiser.zero_grad()
        torch.autograd.backward(training_loss(network, batch, weights, bfloat16=bfloat16))
        optimiser.step()
        seconds.append(time.perf_counter() - started)
    return recipe.batch / sorted(seconds[1:])[STEPS // 2]
