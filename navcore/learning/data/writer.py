"""Writer of data sets for `navcore.learning.data.dataset`; lists and card are written last, so that
an incomplete data set is recognised."""

from __future__ import annotations

import dataclasses
import io
import json
import os
import re
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navcore.errors import BadConfiguration, StorageFailed
from navcore.learning.data.card import (
    CARD_NAME,
    KINDS,
    SPLITS,
    Counts,
    DatasetCard,
    DepthSums,
    Files,
    Split,
    check_sample,
)
from navcore.learning.data.images import (
    DepthArray,
    LabelArray,
    RgbArray,
    encode_grey,
    encode_rgb,
    write_bytes,
)
from navcore.perception.esanet.network.preprocess import DepthStatistics

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


@dataclass(frozen=True, slots=True, kw_only=True)
class EncodedSample:
    """A sample as the content of its files, so that several processes can encode for one writer."""

    rgb: bytes
    """Colours, PNG or JPEG."""
    rgb_ending: str
    """Ending of the file of the colours."""
    depth: bytes
    """Depth, 16-bit PNG."""
    labels: bytes
    """Labels, as `numpy.save` writes them."""
    size: tuple[int, int]
    """Height and width, pixels."""
    depth_sums: DepthSums
    """Sums of its depth."""


def encode_sample(
    rgb: RgbArray,
    depth: DepthArray,
    labels: LabelArray,
    *,
    num_classes: int,
    where: str,
    jpeg_quality: int | None = None,
) -> EncodedSample:
    """Encode (H, W, 3) uint8 colours, (H, W) uint16 depth in the data set's unit with 0 = not
    measured, and (H, W) uint8 labels with 0 = void, else class + 1.

    Colours are PNG unless `jpeg_quality` is given. Raises `BadConfiguration` naming `where` for a
    wrong shape or label.
    """
    check_sample(rgb, depth, labels, num_classes, where)
    sums, array = DepthSums(), io.BytesIO()
    sums.add(depth)
    np.save(array, np.ascontiguousarray(labels), allow_pickle=False)
    return EncodedSample(
        rgb=encode_rgb(rgb, jpeg_quality=jpeg_quality),
        rgb_ending="png" if jpeg_quality is None else "jpg",
        depth=encode_grey(depth),
        labels=array.getvalue(),
        size=(labels.shape[0], labels.shape[1]),
        depth_sums=sums,
    )


class DatasetWriter:
    """Writer of a data set: call `add` per image, then `finish`."""

    def __init__(
        self,
        folder: Path,
        *,
        class_names: Sequence[str],
        units_per_m: float = 1000.0,
        source: Mapping[str, object] | None = None,
        jpeg_quality: int | None = None,
    ) -> None:
        """Create `folder`, which must be empty. Colours are stored as PNG unless `jpeg_quality` is
        given.

        Raises `BadConfiguration` or `StorageFailed`.
        """
        unmeasured = DepthStatistics(mean=0.0, std=1.0, units_per_m=units_per_m)
        self._card = DatasetCard(
            class_names=tuple(class_names), depth=unmeasured, source=dict(source or {})
        )
        self._folder, self._jpeg_quality = folder, jpeg_quality
        self._files: dict[Split, list[Files]] = {split: [] for split in SPLITS}
        self._names: set[tuple[str, str]] = set()
        self._sums = {split: DepthSums() for split in SPLITS}
        self._sizes: set[tuple[int, int]] = set()
        self._finished = False
        self._is_new_folder = not folder.exists()
        _make_empty(folder)

    def add(
        self, split: Split, name: str, rgb: RgbArray, depth: DepthArray, labels: LabelArray
    ) -> None:
        """Encode and write a sample, see `encode_sample`; raises `BadConfiguration` for a wrong
        name, shape or label."""
        self._check(split, name)
        sample = encode_sample(
            rgb,
            depth,
            labels,
            num_classes=len(self._card.class_names),
            where=f"{split}/{name}",
            jpeg_quality=self._jpeg_quality,
        )
        self.add_encoded(split, name, sample)

    def add_encoded(self, split: Split, name: str, sample: EncodedSample) -> None:
        """Write a sample; raises `BadConfiguration` for a wrong name."""
        self._check(split, name)
        files = (
            f"{split}/rgb/{name}.{sample.rgb_ending}",
            f"{split}/depth/{name}.png",
            f"{split}/label/{name}.npy",
        )
        for file, content in zip(files, (sample.rgb, sample.depth, sample.labels), strict=True):
            write_bytes(self._folder / file, content)
        self._names.add((split, name.casefold()))
        self._files[split].append(files)
        self._sums[split].include(sample.depth_sums)
        self._sizes.add(sample.size)

    def finish(self) -> DatasetCard:
        """Write the lists and then the card, after which `load_dataset` accepts the folder."""
        if self._finished:
            raise BadConfiguration(f"{self._folder}: the data set is finished already")
        if not self._names:
            raise BadConfiguration(f"{self._folder}: a data set without any image")
        card = dataclasses.replace(
            self._card,
            depth=self._depth(),
            counts=Counts(**{split: len(files) for split, files in self._files.items()}),
            sizes=tuple(sorted(self._sizes)),
        )
        for split, files in self._files.items():
            for column, kind in enumerate(KINDS):
                write_text(
                    self._folder / f"{split}_{kind}.txt",
                    "".join(f"{triple[column]}\n" for triple in files),
                )
        write_text(self._folder / CARD_NAME, json.dumps(dataclasses.asdict(card), indent=1))
        self._finished = True
        return card

    def discard(self) -> None:
        """Remove what was written, and the folder too if it was created for the data set."""
        for split in SPLITS:
            shutil.rmtree(self._folder / split, ignore_errors=True)
            for kind in KINDS:
                (self._folder / f"{split}_{kind}.txt").unlink(missing_ok=True)
        (self._folder / CARD_NAME).unlink(missing_ok=True)
        if self._is_new_folder:
            with suppress(OSError):  # something else was put there meanwhile
                self._folder.rmdir()

    def _check(self, split: str, name: str) -> None:
        if self._finished:
            raise BadConfiguration(
                f"{self._folder}: the data set is finished; nothing can be added"
            )
        if split not in SPLITS:
            raise BadConfiguration(
                f"data set: split {split!r:.40}, expected one of {', '.join(SPLITS)}"
            )
        if not _NAME.fullmatch(name):
            raise BadConfiguration(
                f"data set: {name!r:.120} is no name for an image: "
                "expected letters, digits and . _ -"
            )
        if (split, name.casefold()) in self._names:
            raise BadConfiguration(f"data set: {split} has an image {name!r} already")

    def _depth(self) -> DepthStatistics:
        used = [self._sums["train"]] if self._files["train"] else list(self._sums.values())
        sums = DepthSums(
            pixels=sum(part.pixels for part in used),
            total=sum(part.total for part in used),
            squares=sum(part.squares for part in used),
        )
        return sums.statistics(units_per_m=self._card.depth.units_per_m)


def write_text(target: Path, text: str) -> None:
    """Write a text file, replacing `target` atomically; raises `StorageFailed`."""
    partial = target.with_name(f".{target.name}.{os.getpid()}.partial")
    try:
        try:
            with partial.open("w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise StorageFailed(f"{target}: cannot be written: {error.strerror or error}") from error


def _make_empty(folder: Path) -> None:
    """Create the folders of a new data set; raises `BadConfiguration` unless the folder is
    empty."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise BadConfiguration(f"{folder}: not empty; a data set is written into a new folder")
        for split in SPLITS:
            for kind in KINDS:
                (folder / split / kind).mkdir(parents=True)
    except OSError as error:
        raise StorageFailed(f"{folder}: cannot be written: {error.strerror or error}") from error
