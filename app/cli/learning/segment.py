"""`bewarenav segment`: label one image with a network, or measure it on a data set."""

from __future__ import annotations

import colorsys
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from navcore.errors import BadConfiguration, StorageFailed

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from navcore.learning.data.card import Sample
    from navcore.learning.training.evaluation import InferenceSettings
    from navcore.perception.esanet.network.preprocess import Size
    from navcore.perception.esanet.weights.weights_file import TrainedNetwork

OPACITY = 0.55
"""Opacity of the class colours over the image."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentSettings:
    """The argument and the options of the command."""

    weights: Annotated[
        Path, typer.Argument(metavar="MODEL.safetensors", help="A trained or converted network.")
    ]
    rgb: Annotated[Path | None, typer.Option("--rgb", help="A colour image, PNG or JPEG.")] = None
    depth: Annotated[
        Path | None, typer.Option("--depth", help="The depth image of --rgb, 16-bit PNG.")
    ] = None
    units_per_m: Annotated[
        float,
        typer.Option(
            help="Depth units per metre in the PNG; 1000 = millimetres.", min=1e-3, max=1e6
        ),
    ] = 1000.0
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DIR", help="A data set instead of one image."),
    ] = None
    split: Annotated[str, typer.Option(help="Split of the data set: train, valid or test.")] = (
        "test"
    )
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write overlays and masks here.")
    ] = None
    size: Annotated[
        str, typer.Option(metavar="WxH", help="Working size; the training size if left out.")
    ] = ""
    mirrored_too: Annotated[
        bool, typer.Option("--mirrored-too", help="Average with the mirrored image.")
    ] = False


def segment(settings: SegmentSettings) -> None:
    """Label an image pair or a split of a data set; print the IoU of every class if the data set
    has labels."""
    import torch

    from navcore.learning.training.evaluation import InferenceSettings
    from navcore.perception.esanet.weights.weights_file import load

    data, rgb, depth, out = settings.data, settings.rgb, settings.depth, settings.out
    if (data is None) == (rgb is None or depth is None):
        raise BadConfiguration("segment: say either --rgb and --depth, or --data")
    trained = load(settings.weights)
    trained.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    inference = InferenceSettings(
        size=_size(settings.size, trained), mirrored_too=settings.mirrored_too
    )
    if data is not None:
        _label_data_set(trained, inference, data, settings.split, out)
    elif rgb is not None and depth is not None:
        _label_image(trained, inference, rgb, depth, settings.units_per_m, out)


def _label_image(
    trained: TrainedNetwork,
    inference: InferenceSettings,
    rgb: Path,
    depth: Path,
    units_per_m: float,
    out: Path | None,
) -> None:
    import numpy as np

    from navcore.learning.data.card import Sample, check_sample
    from navcore.learning.data.images import read_depth, read_rgb
    from navcore.learning.training.evaluation import predict

    colours, distances = read_rgb(rgb), read_depth(depth)
    scaled = np.rint(distances * (trained.card.depth.units_per_m / units_per_m))
    distances = np.minimum(scaled, np.iinfo(np.uint16).max).astype(np.uint16)
    sample = Sample(rgb=colours, depth=distances, labels=np.zeros(distances.shape, dtype=np.uint8))
    check_sample(
        sample.rgb, sample.depth, sample.labels, trained.card.num_classes, f"{rgb}, {depth}"
    )
    (classes,) = predict(trained.network, [sample], inference, trained.card.depth)
    for index in np.argsort(-np.bincount(classes.ravel(), minlength=trained.card.num_classes)):
        share = float((classes == index).mean())
        if share:
            typer.echo(f"{100 * share:6.2f} %  {trained.card.class_names[index]}")
    if out is not None:
        _draw(out, rgb.stem, sample, classes)


def _label_data_set(
    trained: TrainedNetwork, inference: InferenceSettings, data: Path, split: str, out: Path | None
) -> None:
    import numpy as np

    from app.learning.report import figures, show
    from navcore.learning.data.card import SPLITS
    from navcore.learning.data.dataset import dataset_for
    from navcore.learning.data.writer import write_text
    from navcore.learning.training.evaluation import predict
    from navcore.learning.training.metrics import confusion_matrix

    card = trained.card
    dataset = dataset_for(data, class_names=card.class_names, depth=card.depth)
    chosen = next((known for known in SPLITS if known == split and dataset.count(known)), None)
    if chosen is None:
        raise BadConfiguration(f"--split {split!r:.40}: the data set has no such images")
    confusion = np.zeros((card.num_classes, card.num_classes), dtype=np.int64)
    for index in range(dataset.count(chosen)):
        sample = dataset.read(chosen, index)
        (classes,) = predict(trained.network, [sample], inference, card.depth)
        confusion += confusion_matrix(sample.labels, classes, card.num_classes)
        if out is not None:
            _draw(out, dataset.name(chosen, index), sample, classes)
    show(confusion, card.class_names, chosen)
    if out is not None:
        measured = figures(confusion, card.class_names, chosen, dataset.count(chosen))
        write_text(out / "metrics.json", json.dumps(measured, indent=1))


def palette(count: int) -> npt.NDArray[np.uint8]:
    """Return (count, 3) uint8 RGB colours far apart; the first, usually the background, is grey."""
    import numpy as np

    hues = [colorsys.hsv_to_rgb((0.618034 * index) % 1, 0.9, 0.95) for index in range(count)]
    hues[0] = (0.5, 0.5, 0.5)
    return np.asarray(np.rint(np.array(hues) * 255), dtype=np.uint8)


def _draw(out: Path, name: str, sample: Sample, classes: npt.NDArray[np.uint8]) -> None:
    """Write `NAME.mask.png` (class + 1, as in labels) and `NAME.overlay.png` (class colours)."""
    import numpy as np

    from navcore.learning.data.images import write_grey, write_rgb

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageFailed(f"{out}: cannot be made: {error.strerror or error}") from error
    colours = palette(256)[classes].astype(np.float32)
    strength = np.where(classes[..., None] == 0, 0.0, OPACITY).astype(np.float32)
    mixed = sample.rgb * (1 - strength) + colours * strength
    write_grey(out / f"{name}.mask.png", (classes + 1).astype(np.uint8))
    write_rgb(out / f"{name}.overlay.png", np.rint(mixed).astype(np.uint8))


def _size(text: str, trained: TrainedNetwork) -> Size:
    from navcore.perception.esanet.network.limits import STRIDE
    from navcore.perception.esanet.network.preprocess import Size, check_size

    if not text:
        return trained.card.size or Size(height=480, width=640)  # of the public checkpoints
    columns, _, rows = text.lower().partition("x")
    if not (columns.isdecimal() and rows.isdecimal() and len(text) < 12):
        raise BadConfiguration(f"--size {text!r:.40}: expected WxH in pixels, e.g. 448x256")
    size = Size(height=int(rows), width=int(columns))
    check_size(size, STRIDE)
    return size
