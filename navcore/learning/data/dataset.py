"""Data sets of labelled RGB-D images, in the layout in which the official ESANet code reads SUN
RGB-D.

    {train,test}_{rgb,depth,label}.txt    one path per line, relative to the folder
    valid_{rgb,depth,label}.txt           an extension: the split that chooses the best epoch
    dataset.json                          an extension: the card with class names and depth

Colours are PNG or JPEG, transparent where they are not known, depth is 16-bit PNG (0 = not
measured), labels are `.npy` uint8: 0 = void, else class + 1.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from navcore.errors import BadConfiguration
from navcore.learning.data.card import (
    CARD_NAME,
    KINDS,
    MAX_IMAGES,
    SPLITS,
    Counts,
    DatasetCard,
    DepthSums,
    Files,
    Sample,
    Split,
    check_labels,
    check_sample,
)
from navcore.learning.data.images import (
    LabelArray,
    MaskArray,
    decode_rgb,
    decode_uncoloured,
    read_bytes,
    read_depth,
    read_labels,
)
from navcore.learning.data.writer import DatasetWriter
from navcore.perception.esanet.network.preprocess import DepthStatistics
from navcore.toml_config import from_table

__all__ = ["Dataset", "DatasetCard", "DatasetWriter", "Sample", "load_dataset", "measure_depth"]
MAX_CARD_BYTES = 1 << 20
MAX_LIST_BYTES = 1 << 27


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """A data set whose lists are checked; the images are read one by one."""

    folder: Path
    """Absolute path of the folder."""
    card: DatasetCard
    """Classes and statistics of the data set."""
    files: Mapping[Split, tuple[Files, ...]]
    """Files by split, in the order of the lists."""

    def __len__(self) -> int:
        """Return the number of images in all splits."""
        return sum(len(files) for files in self.files.values())

    def count(self, split: Split) -> int:
        """Return the number of images in a split."""
        return len(self.files[split])

    def name(self, split: Split, index: int) -> str:
        """Return the file name of an image without its ending."""
        return PurePosixPath(self.files[split][index][0]).stem

    def read(self, split: Split, index: int) -> Sample:
        """Read a sample, void where its colour is not known; raises `BadConfiguration` naming a
        file that is damaged or does not fit."""
        rgb_path, depth_path, label_path = (
            _inside(self.folder, path) for path in self.files[split][index]
        )
        content = read_bytes(rgb_path)
        rgb = decode_rgb(content, str(rgb_path))
        depth, labels = read_depth(depth_path), read_labels(label_path)
        check_sample(rgb, depth, labels, len(self.card.class_names), str(rgb_path))
        uncoloured = decode_uncoloured(content, str(rgb_path))
        return Sample(
            rgb=rgb, depth=depth, labels=_coloured(labels, uncoloured), uncoloured=uncoloured
        )

    def read_labels(self, split: Split, index: int) -> LabelArray:
        """Read only the labels (H, W); raises `BadConfiguration` as `read` does."""
        rgb_path, _, path = (_inside(self.folder, path) for path in self.files[split][index])
        labels = read_labels(path)
        check_labels(labels, len(self.card.class_names), str(path))
        uncoloured = decode_uncoloured(read_bytes(rgb_path), str(rgb_path))
        if uncoloured is not None and uncoloured.shape != labels.shape:
            raise BadConfiguration(
                f"{rgb_path}: {uncoloured.shape}, its labels {labels.shape}; expected one size"
            )
        return _coloured(labels, uncoloured)

    def labels_digest(self) -> str:
        """Return a SHA-256 of the lists and of the bytes of all label files, hexadecimal; raises
        `BadConfiguration`."""
        digest = hashlib.sha256(json.dumps(self.files, sort_keys=True).encode())
        for path in (files[2] for split in SPLITS for files in self.files[split]):
            digest.update(hashlib.sha256(read_bytes(_inside(self.folder, path))).digest())
        return digest.hexdigest()


def _coloured(labels: LabelArray, uncoloured: MaskArray | None) -> LabelArray:
    """Return the labels (H, W), void where the colour is not known, so that nothing learns to tell
    a class by black pixels."""
    return labels if uncoloured is None else np.where(uncoloured, np.uint8(0), labels)


def load_dataset(
    folder: Path, *, class_names: Sequence[str] | None = None, depth: DepthStatistics | None = None
) -> Dataset:
    """Read the card and the lists of a data set and check that every file exists.

    A data set in the official layout has no card and needs `class_names` and `depth`, which
    `measure_depth` returns. Raises `BadConfiguration` naming the file and the defect.
    """
    folder = folder.resolve()
    files: dict[Split, tuple[Files, ...]] = {split: _read_lists(folder, split) for split in SPLITS}
    if not any(files.values()):
        raise BadConfiguration(
            f"{folder}: no data set: none of "
            f"{', '.join(f'{split}_rgb.txt' for split in SPLITS)} has an entry"
        )
    counts = Counts(**{split: len(listed) for split, listed in files.items()})
    card = _card(folder, counts, class_names, depth)
    for listed in files.values():
        for path in (path for triple in listed for path in triple):
            _inside(folder, path)
    return Dataset(folder=folder, card=card, files=files)


def dataset_for(folder: Path, *, class_names: Sequence[str], depth: DepthStatistics) -> Dataset:
    """Load a data set for a network, whose classes and depth units it must have.

    Raises `BadConfiguration` if the data set's own card differs, else as `load_dataset` does.
    """
    dataset = load_dataset(folder, class_names=class_names, depth=depth)
    path = dataset.folder / CARD_NAME
    if path.is_file():
        own = _read_card(path)
        if [name.casefold() for name in own.class_names] != [
            name.casefold() for name in class_names
        ]:
            raise BadConfiguration(
                f"{path}: the classes are {', '.join(own.class_names)}; the network's are "
                f"{', '.join(class_names)}: labels are numbers, so names and order must be the same"
            )
        if own.depth.units_per_m != depth.units_per_m:
            raise BadConfiguration(
                f"{path}: depth in {own.depth.units_per_m:g} units per metre, "
                f"the network takes {depth.units_per_m:g}"
            )
    return dataset


def measure_depth(folder: Path, *, units_per_m: float) -> DepthStatistics:
    """Measure the depth statistics of the train split of a data set without a card."""
    folder, sums = folder.resolve(), DepthSums()
    for _, path, _ in _read_lists(folder, "train"):
        sums.add(read_depth(_inside(folder, path)))
    return sums.statistics(units_per_m=units_per_m)


def _card(
    folder: Path, counts: Counts, class_names: Sequence[str] | None, depth: DepthStatistics | None
) -> DatasetCard:
    """Return the card of the folder; the arguments take precedence."""
    path = folder / CARD_NAME
    if path.is_file():
        card = _read_card(path)
        if card.counts != counts:
            raise BadConfiguration(
                f"{path}: counts {card.counts}, the lists have {counts}: "
                "they do not belong together"
            )
        return dataclasses.replace(
            card, class_names=tuple(class_names or card.class_names), depth=depth or card.depth
        )
    if class_names is None or depth is None:
        raise BadConfiguration(
            f"{path}: no such file; without it give class names and depth statistics"
        )
    return DatasetCard(class_names=tuple(class_names), depth=depth, counts=counts)


def _read_card(path: Path) -> DatasetCard:
    try:
        table: Any = json.loads(_read_text(path, MAX_CARD_BYTES))
    except (ValueError, RecursionError) as error:
        raise BadConfiguration(f"{path}: not readable as JSON: {error!s:.200}") from None
    source = table.pop("source", {}) if isinstance(table, dict) else {}
    if not isinstance(source, dict):
        raise BadConfiguration(f"{path}: source: expected a table")
    return dataclasses.replace(from_table(DatasetCard, table, str(path)), source=source)


def _read_lists(folder: Path, split: Split) -> tuple[Files, ...]:
    """Read the files of a split; empty if all three lists are missing."""
    paths = [folder / f"{split}_{kind}.txt" for kind in KINDS]
    missing = [path for path in paths if not path.is_file()]
    if missing:
        if len(missing) < len(paths):
            raise BadConfiguration(
                f"{missing[0]}: no such file; the other lists of {split} are there"
            )
        return ()
    lists = [_read_text(path, MAX_LIST_BYTES).splitlines() for path in paths]
    lengths = [len(lines) for lines in lists]
    if len(set(lengths)) != 1 or lengths[0] > MAX_IMAGES:
        raise BadConfiguration(
            f"{paths[0]}: {split} lists {lengths} colours, depths and labels; "
            "expected the same number of each"
        )
    return tuple(zip(*lists, strict=True))


def _inside(folder: Path, path: str) -> Path:
    """Return the path of a file, which must be inside the folder after links are resolved."""
    relative = PurePosixPath(path)
    if not path or relative.is_absolute() or ".." in relative.parts or "\0" in path:
        raise BadConfiguration(f"{folder}: lists {path!r:.200}, expected a path inside the folder")
    found = (folder / relative).resolve()
    if not found.is_relative_to(folder):
        raise BadConfiguration(f"{folder}: {path!r:.200} leads out of the folder")
    if not found.is_file():
        raise BadConfiguration(f"{found}: no such file, but the data set lists it")
    return found


def _read_text(path: Path, limit: int) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(limit + 1)
        if len(content) > limit:
            raise BadConfiguration(f"{path}: more than {limit} bytes")
        return content.decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadConfiguration(f"{path}: not readable: {error}") from None
