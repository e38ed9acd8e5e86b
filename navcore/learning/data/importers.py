"""Importers of labels drawn in other programs: CVAT's "Segmentation mask 1.1" archives and
labelme's polygons.

Both contain colours and labels; depth comes from a folder of 16-bit PNGs of the same names. The
files are not trusted: sizes are limited before anything is unpacked, nothing is unpacked to disk,
and no path leads out of a folder.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.files import DAMAGED_ZIP
from navcore.learning.data.card import MAX_CLASSES, Sample, Split
from navcore.learning.data.class_names import BACKGROUND
from navcore.learning.data.images import (
    MAX_FILE_BYTES,
    LabelArray,
    RgbArray,
    decode_rgb,
    read_bytes,
    read_depth,
    read_rgb,
)
from navcore.learning.data.zip_archive import MAX_ENTRIES, open_zip

MAX_POINTS = 100_000
"""Largest number of points of a polygon."""
MASKS, IMAGES, SETS = "SegmentationClass/", "JPEGImages/", "ImageSets/Segmentation/"
_SPLIT_OF: dict[str, Split] = {
    "train": "train",
    "val": "valid",
    "valid": "valid",
    "validation": "valid",
    "test": "test",
}
_VOID_NAMES = ("void", "unlabeled", "_background_", "__ignore__")
NO_CLASSES = (BACKGROUND, *_VOID_NAMES)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportedSample:
    """An imported sample."""

    split: Split
    """Split of the sample; `train` if the source does not tell."""
    name: str
    """Name of the image without its ending."""
    sample: Sample
    """Colours, depth and labels."""


class CvatArchive:
    """A CVAT "Segmentation mask 1.1" archive: labelmap.txt, coloured masks, lists of names, and
    optionally the images."""

    def __init__(
        self,
        path: Path,
        *,
        depth_dir: Path,
        rgb_dir: Path | None = None,
        keep_background: bool = False,
    ) -> None:
        """Open an archive; raises `BadConfiguration` naming the file and the defect.

        `rgb_dir` is the folder of the images if the archive was exported without them. The label
        `background`, which CVAT gives to unlabelled pixels, is void unless `keep_background` makes
        it a class.
        """
        _check_folders(depth_dir, rgb_dir)
        self.path, self._depth_dir, self._rgb_dir = path, depth_dir, rgb_dir
        try:
            self._archive = open_zip(path, str(path))
        except DAMAGED_ZIP as error:
            raise BadConfiguration(
                f"{path}: not readable as a zip archive: {error!s:.200}"
            ) from None
        self._entries = {
            _safe(entry.filename, str(path)): entry
            for entry in self._archive.infolist()
            if not entry.is_dir()
        }
        colours = self._labelmap()
        kept = {
            name: colour
            for name, colour in colours.items()
            if name.casefold() not in (_VOID_NAMES if keep_background else NO_CLASSES)
        }
        if not 0 < len(kept) <= MAX_CLASSES:
            raise BadConfiguration(
                f"{path}: labelmap.txt names {len(kept)} classes, expected 1 to {MAX_CLASSES}"
            )
        self.class_names = tuple(kept)
        self._void = {_packed(colour) for name, colour in colours.items() if name not in kept} | {0}
        self._labels = {
            _packed(colour): number for number, colour in enumerate(kept.values(), start=1)
        }

    def __iter__(self) -> Iterator[ImportedSample]:
        """Yield the images that have a mask, sorted by name."""
        splits = self._splits()
        masks = sorted(
            key for key in self._entries if key.startswith(MASKS) and key.endswith(".png")
        )
        if not masks:
            raise BadConfiguration(
                f'{self.path}: no mask in {MASKS}; export as "Segmentation mask 1.1"'
            )
        bases = Counter(PurePosixPath(key).stem for key in masks)
        names = [key[len(MASKS) : -len(".png")] for key in masks]
        for key, name, flat in zip(masks, names, flat_names(names), strict=True):
            alone = bases[PurePosixPath(key).stem] == 1
            sample = _sample(
                self._rgb(name, alone=alone),
                _depth(self._depth_dir, name, alone=alone),
                self._mask(key),
                f"{self.path}: {name}",
            )
            yield ImportedSample(split=splits.get(name, "train"), name=flat, sample=sample)

    def _mask(self, key: str) -> LabelArray:
        """Return the labels of a coloured mask; raises `BadConfiguration` for an unknown colour."""
        mask = decode_rgb(self._bytes(key), f"{self.path}: {key}").astype(np.int64)
        packed = (mask[..., 0] << 16) | (mask[..., 1] << 8) | mask[..., 2]
        found, where = np.unique(packed, return_inverse=True)
        unknown = [
            value
            for value in found.tolist()
            if value not in self._labels and value not in self._void
        ]
        if unknown:
            colour = ",".join(map(str, unknown[0].to_bytes(3, "big")))
            raise BadConfiguration(f"{self.path}: {key}: colour {colour} is not in labelmap.txt")
        table = np.array([self._labels.get(value, 0) for value in found.tolist()], dtype=np.uint8)
        return table[where].reshape(packed.shape)

    def _rgb(self, name: str, *, alone: bool) -> RgbArray:
        for ending in (".jpg", ".jpeg", ".png"):
            if f"{IMAGES}{name}{ending}" in self._entries:
                return decode_rgb(
                    self._bytes(f"{IMAGES}{name}{ending}"), f"{self.path}: {name}{ending}"
                )
        if self._rgb_dir is None:
            raise BadConfiguration(
                f"{self.path}: no image {IMAGES}{name}; export with images, or give their folder"
            )
        return read_rgb(_found(self._rgb_dir, name, (".jpg", ".jpeg", ".png"), alone=alone))

    def _labelmap(self) -> dict[str, tuple[int, int, int]]:
        """Return colours by name from lines `name:r,g,b:parts:actions`."""
        colours: dict[str, tuple[int, int, int]] = {}
        for line in self._text("labelmap.txt").splitlines():
            if not line.strip() or line.startswith("#"):
                continue
            name, _, rest = line.partition(":")
            parts = rest.partition(":")[0].split(",")
            if len(parts) != 3 or not all(
                part.strip().isdecimal() and len(part) < 8 and int(part) < 256 for part in parts
            ):
                raise BadConfiguration(
                    f"{self.path}: labelmap.txt: {line!r:.120}, expected name:r,g,b:parts:actions"
                )
            red, green, blue = (int(part) for part in parts)
            colours[name.strip()] = (red, green, blue)
        if len(set(colours.values())) != len(colours):
            raise BadConfiguration(f"{self.path}: labelmap.txt gives two labels one colour")
        return colours

    def _splits(self) -> dict[str, Split]:
        splits: dict[str, Split] = {}
        for key in self._entries:
            if key.startswith(SETS) and key.endswith(".txt"):
                split = _SPLIT_OF.get(PurePosixPath(key).stem.casefold(), "train")
                splits |= {
                    line.strip(): split for line in self._text(key).splitlines() if line.strip()
                }
        return splits

    def _text(self, key: str) -> str:
        try:
            return self._bytes(key).decode("utf-8")
        except UnicodeDecodeError:
            raise BadConfiguration(f"{self.path}: {key}: not UTF-8 text") from None

    def _bytes(self, key: str) -> bytes:
        """Unpack a file in memory, limited to the size of an image whatever the archive claims."""
        entry = self._entries.get(key)
        if entry is None:
            raise BadConfiguration(
                f'{self.path}: {key} is missing; export as "Segmentation mask 1.1"'
            )
        try:
            with self._archive.open(entry) as file:
                content = file.read(MAX_FILE_BYTES + 1)
        except DAMAGED_ZIP as error:
            raise BadConfiguration(f"{self.path}: {key} is damaged: {error!s:.200}") from None
        if len(content) > MAX_FILE_BYTES:
            raise BadConfiguration(
                f"{self.path}: {key} unpacks to more than {MAX_FILE_BYTES} bytes"
            )
        return content


class LabelmeFolder:
    """A folder of labelme JSON files: polygons and rectangles per image, later ones over earlier
    ones."""

    def __init__(
        self,
        folder: Path,
        *,
        depth_dir: Path,
        class_names: Sequence[str] = (),
        split: Split = "train",
        keep_background: bool = False,
    ) -> None:
        """Open a folder; raises `BadConfiguration`.

        Without `class_names` the classes are the labels that occur, in alphabetical order.
        Unlabelled pixels are void, or with `keep_background` the class `background`, which comes
        first unless `class_names` has it elsewhere.
        """
        self.folder, self._depth_dir, self._split, self._keeps = (
            folder,
            depth_dir,
            split,
            keep_background,
        )
        self._files = sorted(folder.glob("*.json"))
        if not self._files:
            raise BadConfiguration(f"{folder}: no labelme file (*.json) is there")
        _check_folders(depth_dir)
        if len(self._files) > MAX_ENTRIES:
            raise BadConfiguration(f"{folder}: more than {MAX_ENTRIES} files")
        occurring = {
            shape["label"] for path in self._files for shape in _shapes(path, _document(path))
        } - set(_VOID_NAMES)
        names = tuple(class_names) or tuple(sorted(occurring))
        if keep_background and BACKGROUND not in class_names:
            names = (BACKGROUND, *(name for name in names if name != BACKGROUND))
        self.class_names = names
        if not 0 < len(self.class_names) <= MAX_CLASSES or not occurring <= set(self.class_names):
            unknown = ", ".join(sorted(occurring - set(self.class_names)))
            raise BadConfiguration(
                f"{folder}: labels {unknown!r:.200} are not among the classes; "
                f"expected 1 to {MAX_CLASSES}"
            )

    def __iter__(self) -> Iterator[ImportedSample]:
        """Yield the images, sorted by name."""
        for path, name in zip(
            self._files, flat_names([path.stem for path in self._files]), strict=True
        ):
            document = _document(path)
            rgb = self._rgb(path, document)
            labels = self._drawn(path, document, rgb.shape[:2])
            sample = _sample(rgb, _depth(self._depth_dir, path.stem), labels, str(path))
            yield ImportedSample(split=self._split, name=name, sample=sample)

    def _rgb(self, path: Path, document: dict[str, Any]) -> RgbArray:
        if isinstance(document.get("imageData"), str):
            try:
                return decode_rgb(
                    base64.b64decode(document["imageData"], validate=True), f"{path}: imageData"
                )
            except (binascii.Error, ValueError):
                raise BadConfiguration(f"{path}: imageData is not base64") from None
        named = document.get("imagePath")
        if not isinstance(named, str):
            raise BadConfiguration(f"{path}: neither imageData nor imagePath is there")
        return read_rgb(_within(path.parent, _safe(named, str(path))))

    def _drawn(self, path: Path, document: dict[str, Any], shape: tuple[int, ...]) -> LabelArray:
        """Return the labels (H, W) with each polygon filled."""
        labels = np.full(
            shape, self.class_names.index(BACKGROUND) + 1 if self._keeps else 0, dtype=np.uint8
        )
        for drawn in _shapes(path, document):
            number = (
                0 if drawn["label"] in _VOID_NAMES else self.class_names.index(drawn["label"]) + 1
            )
            cv2.fillPoly(labels, [_polygon(path, drawn)], number)
        return labels


def flat_names(names: Sequence[str]) -> list[str]:
    """Return a file name for each of some different names: without folders, whose names become part
    of it, and of the signs that a data set allows. Where that leaves nothing, or the same of two
    names, it ends with digits of the name's SHA-256."""
    flat = [
        "".join(
            sign if sign.isascii() and (sign.isalnum() or sign in "._-") else "_" for sign in name
        ).lstrip("._-")[:100]
        for name in names
    ]
    digests = [sha256(name.encode(errors="surrogatepass")).hexdigest()[:8] for name in names]
    counts = Counter(one.casefold() for one in flat)
    return [
        one if one and counts[one.casefold()] == 1 else f"{one[:91] or 'picture'}-{digest}"
        for one, digest in zip(flat, digests, strict=True)
    ]


def _polygon(path: Path, drawn: dict[str, Any]) -> npt.NDArray[np.int32]:
    """Return the corners (N, 2) in pixels; labelme gives a rectangle by two corners."""
    points, kind = drawn.get("points"), drawn.get("shape_type", "polygon")
    try:
        corners = np.array(points, dtype=np.float64)
        good = corners.ndim == 2 and corners.shape[1] == 2 and len(corners) <= MAX_POINTS
        good = good and bool(np.isfinite(corners).all()) and float(np.abs(corners).max()) < 1e5
    except (ValueError, TypeError, OverflowError):
        good = False
    if (
        not good
        or kind not in ("polygon", "rectangle")
        or len(corners) < (3 if kind == "polygon" else 2)
    ):
        raise BadConfiguration(
            f"{path}: shape {drawn['label']!r:.60} of type {kind!r:.40}: "
            "expected a polygon or a rectangle"
        )
    if kind == "rectangle":
        (x0, y0), (x1, y1) = corners[:2]
        corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    # The coordinates of a pixel are those of its upper left corner; cv2 fills the pixels that the
    # outline touches.
    return np.asarray(np.floor(corners), dtype=np.int32)


def _shapes(path: Path, document: dict[str, Any]) -> list[dict[str, Any]]:
    shapes = document.get("shapes")
    if not isinstance(shapes, list) or not all(
        isinstance(shape, dict) and _named(shape) for shape in shapes
    ):
        raise BadConfiguration(
            f"{path}: not a labelme file: expected `shapes`, each with a `label`"
        )
    return shapes


def _named(shape: dict[str, Any]) -> bool:
    return isinstance(shape.get("label"), str) and bool(shape["label"].strip())


def _document(path: Path) -> dict[str, Any]:
    try:
        document: Any = json.loads(read_bytes(path))
    except (ValueError, RecursionError) as error:
        raise BadConfiguration(f"{path}: not readable as JSON: {error!s:.200}") from None
    if not isinstance(document, dict):
        raise BadConfiguration(f"{path}: not a labelme file: expected a table")
    return document


def _sample(rgb: RgbArray, depth: npt.NDArray[np.uint16], labels: LabelArray, where: str) -> Sample:
    shapes = {"colours": rgb.shape[:2], "depth": depth.shape, "labels": labels.shape}
    if len(set(shapes.values())) != 1:
        raise BadConfiguration(
            f"{where}: sizes differ: "
            f"{', '.join(f'{kind} {shape}' for kind, shape in shapes.items())}"
        )
    return Sample(rgb=rgb, depth=depth, labels=labels)


def _depth(folder: Path, name: str, *, alone: bool = True) -> npt.NDArray[np.uint16]:
    return read_depth(_found(folder, name, (".depth.png", "_depth.png", ".png"), alone=alone))


def _found(folder: Path, name: str, endings: Sequence[str], *, alone: bool) -> Path:
    """Return the file of a name in the folder; the folders of the source may be missing there, if
    `alone` says that no other image has the same name but for its folder."""
    for stem in (name, PurePosixPath(name).name) if alone else (name,):
        for ending in endings:
            path = _within(folder, _safe(stem + ending, str(folder)))
            if path.is_file():
                return path
    raise BadConfiguration(
        f"{folder}: no file for image {name!r:.120}; expected {name}{endings[0]}"
        + ("" if alone else ", with its folder: another image of the archive has its name")
    )


def _check_folders(*folders: Path | None) -> None:
    for folder in folders:
        if folder is not None and not folder.is_dir():
            raise BadConfiguration(f"{folder}: no such folder")


def _within(folder: Path, relative: str) -> Path:
    path = (folder / relative).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise BadConfiguration(f"{folder}: {relative!r:.200} leads out of the folder")
    return path


def _safe(name: str, where: str) -> str:
    """Return the name, which must be a relative path without `..` on every system."""
    path = PurePosixPath(name)
    if (
        not name
        or "\0" in name
        or path.is_absolute()
        or ".." in path.parts
        or "\\" in name
        or PureWindowsPath(name).drive
    ):
        raise BadConfiguration(f"{where}: names {name!r:.200}, expected a path inside")
    return name


def _packed(colour: tuple[int, int, int]) -> int:
    return colour[0] << 16 | colour[1] << 8 | colour[2]
