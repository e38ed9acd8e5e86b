"""Report of a trained network: table, confusion matrix, `metrics.json` and model card."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from rich.console import Console as Terminal
from rich.table import Table

from navcore.learning.data.card import Split
from navcore.learning.data.writer import write_text
from navcore.learning.training.batches import CachedSplit
from navcore.learning.training.evaluation import InferenceSettings, evaluate
from navcore.learning.training.metrics import ious, mean_iou
from navcore.learning.training.trainer import MODEL_NAME, Training
from navcore.perception.esanet.weights import weights_file as weights

Confusion = npt.NDArray[np.int64]


def report(training: Training, *, command: Sequence[str], seconds: float) -> dict[str, Any]:
    """Evaluate the saved network in float32 and write the report beside it; return the content of
    `metrics.json`."""
    dataset, out = training.dataset, training.out
    split: Split = (
        "test" if dataset.count("test") else "valid" if dataset.count("valid") else "train"
    )
    trained = weights.load(out / MODEL_NAME)
    network = trained.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    inference = InferenceSettings(size=training.recipe.size, batch=training.recipe.batch)
    confusion = evaluate(network, CachedSplit(dataset, split, cache_mb=0), inference)
    metrics = {
        **figures(confusion, dataset.card.class_names, split, dataset.count(split)),
        "best_epoch": training.state.best_epoch,
        "selection_miou": training.state.best_miou if training.state.best_miou >= 0 else None,
        "history": [dataclasses.asdict(epoch) for epoch in training.state.history],
        "seconds": round(seconds, 1),
    }
    write_text(out / "metrics.json", json.dumps(metrics, indent=1))
    draw_confusion(confusion, dataset.card.class_names, out / "confusion.png")
    write_card(training, metrics, command)
    show(confusion, dataset.card.class_names, split)
    return metrics


def figures(
    confusion: Confusion, class_names: Sequence[str], split: str, images: int
) -> dict[str, Any]:
    """Return mIoU, pixel accuracy and IoU per class (None without true pixels) as a JSON object."""
    labelled = int(confusion.sum())
    return {
        "split": split,
        "pictures": images,
        "miou": _number(mean_iou(confusion)),
        "pixel_accuracy": _number(float(np.trace(confusion)) / labelled if labelled else math.nan),
        "iou": {
            name: _number(value)
            for name, value in zip(class_names, ious(confusion).tolist(), strict=True)
        },
        "confusion": confusion.tolist(),
    }


def show(confusion: Confusion, class_names: Sequence[str], split: str) -> None:
    """Print IoU, precision and recall per class."""
    table = Table(
        "class",
        "IoU",
        "precision",
        "recall",
        "pixels",
        title=f"{split}: mIoU {mean_iou(confusion):.4f}",
    )
    hits, true, predicted = np.diag(confusion), confusion.sum(axis=1), confusion.sum(axis=0)
    for index, name in enumerate(class_names):
        shares = (
            float(ious(confusion)[index]),
            _share(hits[index], predicted[index]),
            _share(hits[index], true[index]),
        )
        table.add_row(name, *(f"{share:.4f}" for share in shares), str(true[index]))
    Terminal().print(table)


def draw_confusion(confusion: Confusion, class_names: Sequence[str], path: Path) -> None:
    """Draw the confusion matrix as shares of each true class."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    shares = confusion / np.maximum(1, confusion.sum(axis=1, keepdims=True))
    side = 2.5 + 0.45 * len(class_names)
    figure, axes = plt.subplots(figsize=(side, side), layout="constrained")
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1)
    axes.set_xticks(range(len(class_names)), class_names, rotation=90)
    axes.set_yticks(range(len(class_names)), class_names)
    axes.set(xlabel="labelled as", ylabel="is")
    if len(class_names) <= 40:
        for (row, col), share in np.ndenumerate(shares):
            if share >= 0.005:
                colour = "white" if share > 0.5 else "black"
                axes.text(
                    col, row, f"{100 * share:.0f}", ha="center", va="center", size=7, color=colour
                )
    figure.savefig(path, dpi=110)
    plt.close(figure)


def write_card(training: Training, metrics: dict[str, Any], command: Sequence[str]) -> None:
    """Write `card.json` and `card.md`: the model, its training and its evaluation."""
    recipe, dataset = training.recipe, training.dataset
    model = training.out / MODEL_NAME
    card = {
        "model": MODEL_NAME,
        "model_sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        "run": training.identity,
        "recipe": dataclasses.asdict(recipe),
        "source": training.source.kind,
        "data": dataclasses.asdict(dataset.card),
        "command": " ".join(command),
        "figures": {
            key: metrics[key]
            for key in (
                "split",
                "pictures",
                "miou",
                "pixel_accuracy",
                "iou",
                "best_epoch",
                "seconds",
            )
        },
        "made_with": {
            "torch": torch.__version__,
            "python": platform.python_version(),
            "machine": platform.machine(),
        },
    }
    write_text(training.out / "card.json", json.dumps(card, indent=1))
    write_text(training.out / "card.md", _card_text(training, metrics, card["command"]))


def _card_text(training: Training, metrics: dict[str, Any], command: object) -> str:
    """Return the card as Markdown."""
    recipe, data = training.recipe, training.dataset.card
    rows = "\n".join(f"| {name} | {_text(value)} |" for name, value in metrics["iou"].items())
    size = f"{recipe.size.width}×{recipe.size.height}"
    judged = f"mIoU {_text(metrics['miou'])}, pixel accuracy {_text(metrics['pixel_accuracy'])}"
    return "\n\n".join(
        (
            f"# {MODEL_NAME}",
            f"ESANet {recipe.variant}, width {recipe.width:g}, {size}, "
            f"{len(data.class_names)} classes.",
            f"Trained on {training.source.kind or f'{data.counts.train} images'} with",
            f"    {command}",
            f"Seed {recipe.seed}, epoch {metrics['best_epoch']} of {recipe.epochs} kept; the whole "
            "recipe, the data set's source and the hashes are in `card.json`.",
            f"On the {metrics['pictures']} images of the split `{metrics['split']}`: {judged}.",
            f"| class | IoU |\n|---|---|\n{rows}",
            f"Source of the data: `{json.dumps(dict(data.source))}`\n",
        )
    )


def _number(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 6)


def _text(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}"


def _share(part: int, whole: int) -> float:
    return float(part) / float(whole) if whole else math.nan
