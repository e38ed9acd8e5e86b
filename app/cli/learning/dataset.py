"""`bewarenav dataset`: render, import and inspect labelled data sets."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console as Terminal
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from app.cli.options import EngineOptions, takes_options
from navcore.errors import BadConfiguration

if TYPE_CHECKING:  # at run time these would make every command wait for torch and the simulator
    from navcore.learning.data.importers import ImportedSample
    from navcore.learning.data.writer import EncodedSample
    from sim.dataset.generate import Split

AHEAD = 32
"""Number of jobs that may be ahead of the first one that is not written yet, 60 MB each at
424 × 240."""

OutArgument = Annotated[
    Path, typer.Argument(metavar="OUT", help="Folder to create; it must be empty if it exists.")
]
DepthOption = Annotated[
    Path,
    typer.Option("--depth-dir", metavar="DIR", help="16-bit depth PNGs named as the images."),
]
UnitsOption = Annotated[
    float,
    typer.Option(
        "--units-per-m",
        help="Depth units per metre in the PNGs; 1000 = millimetres.",
        min=1e-3,
        max=1e6,
    ),
]
BackgroundOption = Annotated[
    bool,
    typer.Option("--background", help="Make unlabelled pixels the class `background`, not void."),
]

dataset_cli = typer.Typer(
    help="Data sets for the segmentation: render, import and inspect them.", no_args_is_help=True
)
import_cli = typer.Typer(
    help="Make a data set of labels that people drew in other programs.", no_args_is_help=True
)
dataset_cli.add_typer(import_cli, name="import")


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Images of one split that one process renders."""

    split: Split
    """Split of the data set that the images belong to."""
    seed: int
    """Seed of the worlds."""
    count: int
    """Number of images."""
    size: tuple[int, int]
    """Columns and rows of the images."""
    disturbed: bool = False
    """Whether each world has a random light."""
    furnished: bool = False
    """Whether furniture has materials and tables have things on them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedImage:
    """An image, encoded by the process that rendered it: that takes as long as rendering it."""

    name: str
    """Name of the image."""
    sample: EncodedSample
    """The content of its files."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderSettings:
    """The argument and the options of `dataset render`."""

    out: OutArgument
    train: Annotated[
        int, typer.Option(min=0, max=1_000_000, help="Number of images of the train split.")
    ] = 4500
    valid: Annotated[
        int,
        typer.Option(
            min=0,
            max=1_000_000,
            help="Number of images of the valid split, which chooses the best epoch.",
        ),
    ] = 300
    test: Annotated[
        int, typer.Option(min=0, max=1_000_000, help="Number of images of the test split.")
    ] = 600
    seed: Annotated[
        int, typer.Option(min=0, max=1000, help="The same seed gives the same images.")
    ] = 0
    size: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WxH",
            help="Columns and rows of an image; several sizes take turns. 424x240 if left out.",
        ),
    ] = None
    light: Annotated[
        Literal["daylight", "random"],
        typer.Option(
            help="`random`: lamps with shadows, polished floors, wrong exposure and white balance, "
            "and motion blur, each in about half of the worlds; the same worlds without.",
        ),
    ] = "daylight"
    interiors: Annotated[
        Literal["plain", "furnished"],
        typer.Option(
            help="`furnished`: furniture of wood, fabric, metal and stone, tables and chairs on "
            "legs with things on them, and some images from a camera in a hand; all else of the "
            "worlds is the same without.",
        ),
    ] = "plain"
    where: EngineOptions = field(default_factory=EngineOptions)


@dataset_cli.command()
@takes_options
def render(settings: RenderSettings) -> None:
    """Render labelled images of random worlds; no world of one split is in another."""
    from navcore.learning.data.class_names import BEWARE_CLASSES
    from navcore.learning.data.writer import DatasetWriter
    from sim.dataset.generate import POSES_PER_WORLD

    counts: dict[Split, int] = {
        "train": settings.train,
        "valid": settings.valid,
        "test": settings.test,
    }
    sizes = [_size(text) for text in settings.size or ["424x240"]]
    disturbed = settings.light == "random"
    furnished = settings.interiors == "furnished"
    jobs = _jobs(counts, settings.seed, sizes, disturbed=disturbed, furnished=furnished)
    source = {
        "made_by": "bewarenav dataset render",
        "seed": settings.seed,
        "poses_per_world": POSES_PER_WORLD,
    }
    source |= {"light": settings.light} if disturbed else {}
    source |= {"interiors": settings.interiors} if furnished else {}
    writer = DatasetWriter(
        settings.out, class_names=BEWARE_CLASSES, units_per_m=1000.0, source=source
    )
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with (
        Progress(*columns, console=Terminal(stderr=True)) as bar,
        closing(_rendered(jobs, settings.where)) as results,
    ):
        task = bar.add_task("rendering", total=sum(counts.values()))
        for split, images in results:
            for image in images:
                writer.add_encoded(split, image.name, image.sample)
                bar.advance(task)
    writer.finish()
    typer.echo(_summary(settings.out, settings.train, settings.valid, settings.test))


@dataset_cli.command()
def info(folder: Annotated[Path, typer.Argument(help="A data set folder.")]) -> None:
    """Check every image of a data set and describe it."""
    from navcore.learning.data.card import SPLITS
    from navcore.learning.data.dataset import load_dataset
    from navcore.learning.training.metrics import count_pixels

    dataset = load_dataset(folder)
    card = dataset.card
    sizes = ", ".join(f"{width}×{height}" for height, width in card.sizes) or "not told"
    typer.echo(f"{len(dataset)} images, sizes {sizes}")
    typer.echo(f"depth: {card.depth}\nsource: {dict(card.source)}")
    table = Table(
        "class",
        *(f"{split} ({dataset.count(split)})" for split in SPLITS),
        title="share of the labelled pixels",
    )
    columns = []
    for split in SPLITS:
        labels = (dataset.read(split, index).labels for index in range(dataset.count(split)))
        of_class = count_pixels(labels, len(card.class_names)).of_class
        columns.append(of_class / max(1, int(of_class.sum())))
    for name, *shares in zip(card.class_names, *columns, strict=True):
        table.add_row(name, *(f"{100 * share:.3f} %" for share in shares))
    Terminal().print(table)


@import_cli.command()
def cvat(
    archive: Annotated[
        Path,
        typer.Argument(metavar="FILE.zip", help='Exported by CVAT as "Segmentation mask 1.1".'),
    ],
    out: OutArgument,
    depth_dir: DepthOption,
    rgb_dir: Annotated[
        Path | None,
        typer.Option("--rgb-dir", help="Folder of the images, if they are not in the archive."),
    ] = None,
    background: BackgroundOption = False,
    units_per_m: UnitsOption = 1000.0,
) -> None:
    """Import masks drawn in CVAT."""
    from navcore.learning.data.importers import CvatArchive

    source = CvatArchive(archive, depth_dir=depth_dir, rgb_dir=rgb_dir, keep_background=background)
    origin = f"CVAT archive {archive.name}"
    _write(source, source.class_names, out, units_per_m=units_per_m, origin=origin)


@import_cli.command()
def labelme(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder with one JSON file per image.")
    ],
    out: OutArgument,
    depth_dir: Annotated[
        Path | None, typer.Option("--depth-dir", metavar="DIR", help="Depth PNGs; usually FOLDER.")
    ] = None,
    classes: Annotated[
        str, typer.Option("--classes", help="Class names in their order, comma-separated.")
    ] = "",
    split: Annotated[str, typer.Option("--split", help="train, valid or test.")] = "train",
    background: BackgroundOption = False,
    units_per_m: UnitsOption = 1000.0,
) -> None:
    """Import polygons drawn in labelme."""
    from navcore.learning.data.card import SPLITS
    from navcore.learning.data.importers import LabelmeFolder

    chosen = next((known for known in SPLITS if known == split), None)
    if chosen is None:
        raise BadConfiguration(f"--split {split!r:.40}: expected one of {', '.join(SPLITS)}")
    names = [name.strip() for name in classes.split(",") if name.strip()]
    source = LabelmeFolder(
        folder,
        depth_dir=depth_dir or folder,
        class_names=names,
        split=chosen,
        keep_background=background,
    )
    origin = f"labelme folder {folder.name}"
    _write(source, source.class_names, out, units_per_m=units_per_m, origin=origin)


def _write(
    images: Iterable[ImportedSample],
    class_names: tuple[str, ...],
    out: Path,
    *,
    units_per_m: float,
    origin: str,
) -> None:
    from navcore.learning.data.writer import DatasetWriter

    source = {"imported_from": origin}
    writer = DatasetWriter(out, class_names=class_names, units_per_m=units_per_m, source=source)
    try:
        for image in images:
            sample = image.sample
            writer.add(image.split, image.name, sample.rgb, sample.depth, sample.labels)
        counts = writer.finish().counts
    except BaseException:
        writer.discard()  # else the same command, corrected, is refused: the folder is not empty
        raise
    typer.echo(_summary(out, counts.train, counts.valid, counts.test))
    typer.echo(f"classes: {', '.join(class_names)}")
    if "background" not in (name.casefold() for name in class_names):
        typer.echo(
            "no class is called background: unless one class stands for the rest, a network "
            "trained on this data set alone finds one of the classes in every pixel"
        )


def _summary(out: Path, train: int, valid: int, test: int) -> str:
    return f"{out}: {train} images to train, {valid} to validate and {test} to test with"


def _jobs(
    counts: Mapping[Split, int],
    seed: int,
    sizes: Sequence[tuple[int, int]],
    *,
    disturbed: bool = False,
    furnished: bool = False,
) -> list[Job]:
    """Return the shards of every split; several sizes take turns over the shards, so that every
    split has a share of each."""
    from sim.dataset.generate import (
        POSES_PER_WORLD,
        SHARDS_PER_SPLIT,
        WORLDS_PER_JOB,
        shard_seed,
    )

    most = POSES_PER_WORLD * WORLDS_PER_JOB
    if max(counts.values()) > most * SHARDS_PER_SPLIT:
        raise BadConfiguration(
            f"a split of {max(counts.values())} images, allowed up to {most * SHARDS_PER_SPLIT}"
        )
    return [
        Job(
            split=split,
            seed=shard_seed(seed, split, shard),
            count=min(most, count - shard * most),
            size=sizes[shard % len(sizes)],
            disturbed=disturbed,
            furnished=furnished,
        )
        for split, count in counts.items()
        for shard in range(-(-count // most))
    ]


def _rendered(
    jobs: list[Job], where: EngineOptions
) -> Generator[tuple[Split, list[RenderedImage]]]:
    """Yield the images of each job, in the order of the jobs."""
    from app.fleet.engine import TRIES, Lost, in_order

    with closing(in_order(where.chosen(), _render, jobs, ahead=AHEAD)) as results:
        for rendered in results:
            if isinstance(rendered, Lost):
                raise BadConfiguration(
                    f"a process that renders failed {TRIES} times: {rendered.cause}; "
                    "if memory is short, use fewer --workers"
                )
            yield rendered


def _render(job: Job) -> tuple[Split, list[RenderedImage]]:
    import cv2

    from navcore.learning.data.class_names import BEWARE_CLASSES
    from navcore.learning.data.writer import encode_sample
    from sim.dataset.generate import POSES_PER_WORLD, render_images

    cv2.setNumThreads(1)
    images = render_images(
        seed=job.seed,
        worlds=-(-job.count // POSES_PER_WORLD),
        poses_per_world=POSES_PER_WORLD,
        size=job.size,
        disturbed=job.disturbed,
        furnished=job.furnished,
    )
    return job.split, [
        RenderedImage(
            name=image.name,
            sample=encode_sample(
                image.rgb,
                image.depth_mm,
                image.labels,
                num_classes=len(BEWARE_CLASSES),
                where=f"{job.split}/{image.name}",
            ),
        )
        for image in islice(images, job.count)
    ]


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if not (16 <= width <= 4096 and 16 <= height <= 4096):
        raise BadConfiguration(
            f"--size {text!r}: expected WxH in pixels, 16 to 4096 each, e.g. 424x240"
        )
    return width, height
