"""The labelling folder: images corrected by operators, as a data set for `bewarenav train --data
FOLDER`.

Every image goes to the split `train`. The operator has confirmed one region of its labels. The rest
are the segmenter's labels where their confidence sufficed. The label is void, and not learned from,
elsewhere and on the rim of the region, where the network sees a class that is not on the list, and
where the colour is not known. The lists and the card are complete after every image; what
a crash left incomplete is dropped, and what it left out is listed, with the next one.
"""

from __future__ import annotations

import dataclasses
import json
import threading
import uuid
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from app.insight.detections import StoredView, unpacked
from navcore.errors import BadConfiguration, Refused, StorageFailed
from navcore.learning.data.card import (
    CARD_NAME,
    KINDS,
    SPLITS,
    Counts,
    DatasetCard,
    DepthSums,
    Files,
    check_labels,
)
from navcore.learning.data.class_names import BACKGROUND, BEWARE_CLASSES
from navcore.learning.data.images import (
    decode_uncoloured,
    read_depth,
    read_labels,
    read_rgb,
    write_bytes,
    write_grey,
)
from navcore.learning.data.writer import write_text
from navcore.mission.beware_list import NOTHING
from web.interface.insight import LabellingState

MAX_PICTURES = 500
MAX_BYTES = 500_000_000
UNITS_PER_M = 1000.0
"""Unit of the depth images: millimetres."""
RIM_PX = 3
"""Width of the void rim around the confirmed region, pixels."""
MIN_BOX_PX = 6
"""Smallest side of an operator's box, pixels."""
MIN_FOREGROUND = 0.05
"""Share of a box below which the extracted foreground is not trusted."""


class LabellingFolder:
    """A bounded data set on disk; safe to use from any thread."""

    def __init__(
        self, folder: Path, *, max_pictures: int = MAX_PICTURES, max_bytes: int = MAX_BYTES
    ) -> None:
        self.folder, self._max_pictures, self._max_bytes = folder, max_pictures, max_bytes
        self._lock = threading.Lock()
        self._files: list[Files] = []
        self._class_names: list[str] = []
        self._sizes: set[tuple[int, int]] = set()
        self._sums = DepthSums()
        self._bytes_used = 0
        self._opened = False

    def state(self) -> LabellingState:
        """Return the number of images and bytes in the folder, and write nothing; raises
        `StorageFailed` when the folder cannot be read."""
        with self._lock:
            self._open()
            return LabellingState(
                folder=str(self.folder),
                pictures=len(self._files),
                bytes_used=self._bytes_used,
                max_pictures=self._max_pictures,
                max_bytes=self._max_bytes,
            )

    def add(self, view: StoredView, *, names: dict[int, str], said: str | None) -> None:
        """Add a view whose region shows the class `said`, or no class of the list for None.

        Both are classes of the network; `names` those of the beware list by id. Raises `Refused`
        when the folder is full, `StorageFailed` when it cannot be written.
        """
        with self._lock:
            self._open()
            if len(self._files) >= self._max_pictures or self._bytes_used >= self._max_bytes:
                raise Refused(
                    f"the labelling folder {self.folder} is full ({len(self._files)} images); "
                    "train with it, then move it"
                )
            self._name_classes([*names.values(), *([said] if said else [])])
            labels = self._labels(view, names, said or BACKGROUND)
            self._write(view.rgb_png, np.asarray(unpacked(view.depth_png), dtype=np.uint16), labels)

    def _labels(self, view: StoredView, names: dict[int, str], said: str) -> npt.NDArray[np.uint8]:
        class_ids, region = unpacked(view.class_ids_png), unpacked(view.mask_png) > 0
        # What is no class of the list any more is known to be none of the background: void.
        values = np.zeros(256, dtype=np.uint8)
        values[NOTHING] = self._value(BACKGROUND)
        for class_id, name in names.items():
            values[class_id] = self._value(name)
        labels = values[class_ids]
        labels[unpacked(view.unsure_png) > 0] = 0
        around = (
            cv2.dilate(
                region.view(np.uint8), np.ones((2 * RIM_PX + 1, 2 * RIM_PX + 1), dtype=np.uint8)
            )
            > 0
        )
        labels[around] = 0
        labels[region] = self._value(said)
        if (uncoloured := decode_uncoloured(view.rgb_png, str(self.folder))) is not None:
            labels[uncoloured] = 0
        return np.asarray(labels, dtype=np.uint8)

    def _value(self, name: str) -> int:
        return [known.casefold() for known in self._class_names].index(name.casefold()) + 1

    def _name_classes(self, names: Sequence[str]) -> None:
        """Append new class names; the labels on disk keep their meaning."""
        for name in names:
            if name.casefold() not in (known.casefold() for known in self._class_names):
                self._class_names.append(name)

    def _open(self) -> None:
        """Read the folder as it is on the disk, at first and after it was moved away; an incomplete
        image is left out."""
        if self._opened and all((self.folder / files[0]).exists() for files in self._files[:1]):
            return
        class_names, found, sums, sizes = (
            list(BEWARE_CLASSES),
            list[Files](),
            type(self._sums)(),
            set[tuple[int, int]](),
        )
        if (self.folder / CARD_NAME).exists():
            class_names = self._names_on_card()
            for label in sorted(self.folder.glob("train/label/*.npy")):
                files = _files_of(label.stem)
                try:
                    depth, labels = (
                        read_depth(self.folder / files[1]),
                        read_labels(self.folder / files[2]),
                    )
                    check_labels(labels, len(class_names), str(self.folder / files[2]))
                    read_rgb(self.folder / files[0])
                except BadConfiguration:
                    continue
                found.append(files)
                sums.add(depth)
                sizes.add((labels.shape[0], labels.shape[1]))
        self._class_names, self._files, self._sums, self._sizes = class_names, found, sums, sizes
        self._bytes_used = sum(map(self._size_of, found))
        self._opened = True

    def _names_on_card(self) -> list[str]:
        try:
            return [
                str(name)
                for name in json.loads((self.folder / CARD_NAME).read_text(encoding="utf-8"))[
                    "class_names"
                ]
            ]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise StorageFailed(
                f"{self.folder / CARD_NAME} cannot be read: {error}; move the folder away"
            ) from None

    def _size_of(self, files: Files) -> int:
        return sum((self.folder / path).stat().st_size for path in files)

    def _write(
        self,
        rgb_png: bytes,
        depth_mm: npt.NDArray[np.uint16],
        labels: npt.NDArray[np.uint8],
    ) -> None:
        files, sums = _files_of(uuid.uuid4().hex[:16]), dataclasses.replace(self._sums)
        sums.add(depth_mm)
        try:
            sums.statistics(units_per_m=UNITS_PER_M)
        except BadConfiguration as error:
            raise Refused(f"the image cannot be learned from: {error}") from None
        partial = self.folder / f"{files[2]}.partial.npy"
        try:
            for split in SPLITS:
                for kind in KINDS:
                    (self.folder / split / kind).mkdir(parents=True, exist_ok=True)
            self._write_card(
                sums
            )  # first: no label may be on the disk without the name of its class
            write_bytes(self.folder / files[0], rgb_png)
            write_grey(self.folder / files[1], depth_mm)
            np.save(partial, labels, allow_pickle=False)
            partial.replace(
                self.folder / files[2]
            )  # the last of the three files: an image is complete or absent
        except OSError as error:
            raise StorageFailed(
                f"{self.folder}: the image cannot be written: {error.strerror or error}"
            ) from error
        self._files.append(files)
        self._bytes_used += self._size_of(files)
        self._sums = sums
        self._sizes.add((labels.shape[0], labels.shape[1]))
        self._publish()

    def _publish(self) -> None:
        """Write the lists and the card."""
        for split in SPLITS:
            for column, kind in enumerate(KINDS):
                lines = [files[column] for files in self._files] if split == "train" else []
                write_text(
                    self.folder / f"{split}_{kind}.txt", "".join(f"{line}\n" for line in lines)
                )
        self._write_card(self._sums)

    def _write_card(self, sums: DepthSums) -> None:
        card = DatasetCard(
            class_names=tuple(self._class_names),
            depth=sums.statistics(units_per_m=UNITS_PER_M),
            counts=Counts(train=len(self._files)),
            sizes=tuple(sorted(self._sizes)),
            source={"made_by": "corrections in the operator console"},
        )
        write_text(self.folder / CARD_NAME, json.dumps(dataclasses.asdict(card), indent=1))


def _files_of(name: str) -> Files:
    return f"train/rgb/{name}.png", f"train/depth/{name}.png", f"train/label/{name}.npy"


def region_in(rgb: npt.NDArray[np.uint8], box: tuple[int, int, int, int]) -> npt.NDArray[np.bool_]:
    """Return (H, W) the foreground within a box (left, top, right, bottom), by GrabCut; the whole
    box if there is too little.

    Raises `BadConfiguration` for a box outside the image or too small.
    """
    height, width = rgb.shape[:2]
    left, top, right, bottom = box
    if (
        not (0 <= left < right <= width and 0 <= top < bottom <= height)
        or min(right - left, bottom - top) < MIN_BOX_PX
    ):
        raise BadConfiguration(
            f"box {box}: expected left < right ≤ {width}, top < bottom ≤ {height}, "
            f"each side {MIN_BOX_PX} pixels or more"
        )
    region = np.zeros((height, width), dtype=np.bool_)
    region[top:bottom, left:right] = True
    if region.all():
        return region
    kinds = np.where(region, np.uint8(cv2.GC_PR_FGD), np.uint8(cv2.GC_BGD))
    cv2.setRNGSeed(0)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(
        np.ascontiguousarray(rgb[..., ::-1]), kinds, (0, 0, 0, 0), *models, 3, cv2.GC_INIT_WITH_MASK
    )
    found = (kinds == cv2.GC_FGD) | (kinds == cv2.GC_PR_FGD)
    return found if found.sum() >= MIN_FOREGROUND * region.sum() else region
