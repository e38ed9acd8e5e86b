"""`bewarenav dataset info` and `dataset import`: look at a data set, and make one of what people
labelled elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console as Terminal
from rich.table import Table

if TYPE_CHECKING:
    from navcore.learning.data.importers import (
        Labelled,
    )  # at run time it would make every command wait for torch

import_cli = typer.Typer(
    help="Make a data set of labels that people drew elsewhere.", no_args_is_help=True
)
OutArgument = Annotated[
    Path, typer.Argument(metavar="OUT", help="Folder to make; it must be empty if it is there.")
]
DepthOption = Annotated[
    Path,
    typer.Option("--depth-dir", metavar="DIR", help="16-bit depth PNGs of the pictures' names."),
]
UnitsOption = Annotated[
    float, typer.Option("--units-per-m", help="Of the depth PNGs; 1000 = millimetres.")
]

BackgroundOption = Annotated[
    bool, typer.Option("--background", help="Make what nobody drew on a class, not void.")
]


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
        typer.Option("--rgb-dir", help="The pictures, where they are not in the archive."),
    ] = None,
    background: BackgroundOption = False,
    units_per_m: UnitsOption = 1000.0,
) -> None:
    """Import masks drawn in CVAT."""
    from navcore.learning.data.importers import CvatArchive

    source = CvatArchive(archive, depth_dir=depth_dir, rgb_dir=rgb_dir, keep_background=background)
    _write(
        source,
        source.class_names,
        out,
        units_per_m,
        {"imported_from": f"CVAT archive {archive.name}"},
    )


@import_cli.command()
def labelme(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="With one JSON file per picture.")
    ],
    out: OutArgument,
    depth_dir: Annotated[
        Path | None, typer.Option("--depth-dir", metavar="DIR", help="Depth PNGs; usually FOLDER.")
    ] = None,
    classes: Annotated[
        str, typer.Option("--classes", help="Names in their order, comma-separated.")
    ] = "",
    split: Annotated[str, typer.Option("--split", help="train, valid or test.")] = "train",
    background: BackgroundOption = False,
    units_per_m: UnitsOption = 1000.0,
) -> None:
    """Import polygons drawn in labelme."""
    from navcore.errors import BadConfiguration
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
    _write(
        source,
        source.class_names,
        out,
        units_per_m,
        {"imported_from": f"labelme folder {folder.name}"},
    )


def info(folder: Annotated[Path, typer.Argument(help="A data set folder.")]) -> None:
    """Check every picture of a data set and say what is in it."""
    from navcore.learning.data.card import SPLITS
    from navcore.learning.data.dataset import load_dataset
    from navcore.learning.training.metrics import count_pixels

    dataset = load_dataset(folder)
    card = dataset.card
    typer.echo(
        f"{len(dataset)} pictures, sizes {', '.join(f'{width}×{height}' for height, width in card.sizes) or 'not told'}"
    )
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


def _write(
    pictures: Iterable[Labelled],
    class_names: tuple[str, ...],
    out: Path,
    units_per_m: float,
    source: dict[str, object],
) -> None:
    from navcore.learning.data.dataset import DatasetWriter

    writer = DatasetWriter(out, class_names=class_names, units_per_m=units_per_m, source=source)
    for picture in pictures:
        sample = picture.sample
        writer.add(picture.split, picture.name, sample.rgb, sample.depth, sample.labels)
    counts = writer.finish().counts
    typer.echo(
        f"{out}: {counts.train} pictures to train, {counts.valid} to validate and {counts.test} to test with"
    )
    typer.echo(f"classes: {', '.join(class_names)}")
    if "background" not in (name.casefold() for name in class_names):
        typer.echo(
            "no class is called background: unless one is the rest, what learns from this alone sees one of them everywhere"
        )
