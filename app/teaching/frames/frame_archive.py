"""Captured frames as a zip archive of a data set, out and in.

An archive comes from anywhere: its names must be plain paths inside, sizes are bounded before
anything is unpacked, and every image is read before the first is stored.
"""

from __future__ import annotations

import dataclasses
import json
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO, BinaryIO, cast, get_args

from app.teaching.frames.frame_record import UNITS_PER_M, TrainingSplit, has_depth
from app.teaching.frames.frame_store import FrameStore, Upload
from app.teaching.frames.staging import EXPORTED, UNPACKED
from navcore.errors import BadConfiguration, Refused, StorageFailed
from navcore.files import DAMAGED_ZIP, link_or_copy
from navcore.learning.data.card import CARD_NAME, KINDS, SPLITS, Split
from navcore.learning.data.dataset import Dataset, load_dataset
from navcore.learning.data.writer import write_text
from navcore.learning.data.zip_archive import open_zip
from web.interface.teaching import MAX_FRAMES_BYTES, Annotation

PART_BYTES = 1 << 20
"""Size of the parts in which a file is unpacked."""
_SPLITS = "splits"
"""Key of the card's source: splits of the frames in trainings, by name."""
_LISTS = {f"{split}_{kind}.txt" for split in SPLITS for kind in KINDS}


def exported(store: FrameStore) -> BinaryIO:
    """Return a temporary file, open at its beginning, with all frames as a zip archive; it is gone
    when it is closed.

    Raises `Refused` without a frame, `StorageFailed` when the disk is full. The store is locked
    only while the files are linked.
    """
    if not store.all():
        raise Refused("there is no captured frame to export")
    try:
        with store.temporary(EXPORTED) as name:
            folder = Path(name)
            with store.held():
                files = _linked(store, folder)
            content = empty_file(store)
            with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
                for path in files:
                    archive.write(folder / path, path)
    except OSError as error:
        raise StorageFailed(f"the frames cannot be exported: {error.strerror or error}") from error
    content.seek(0)
    return content


def empty_file(store: FrameStore) -> BinaryIO:
    """Return a temporary file on the disk of the frames, since the system's folder for such files
    may be memory; it is gone when it is closed. Raises `OSError`."""
    store.folder.mkdir(parents=True, exist_ok=True)
    return cast(BinaryIO, tempfile.TemporaryFile(dir=store.folder))


def _linked(store: FrameStore, folder: Path) -> list[str]:
    """Link the frames into a folder, with a card that says which were trained on and which were
    held back, and return the paths of the files."""
    dataset = load_dataset(store.folder)
    images = [path for listed in dataset.files.values() for triple in listed for path in triple]
    files = [*sorted(_LISTS), *images]
    for path in files:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        link_or_copy(store.folder / path, folder / path)
    card = dataclasses.asdict(dataset.card)
    card["source"] |= {_SPLITS: store.splits()}
    write_text(folder / CARD_NAME, json.dumps(card, indent=1))
    return [CARD_NAME, *files]


def add_archive(store: FrameStore, file: BinaryIO) -> int:
    """Add the frames of an archive, an open file, and return their number; all that have depth, or
    none.

    Raises `BadConfiguration` with what is damaged, `Refused` when they do not fit into the folder,
    `StorageFailed`. It is unpacked there; one archive at a time can be added.
    """
    try:
        unpacked = store.temporary(UNPACKED)
    except OSError as error:
        raise StorageFailed(f"the archive cannot be unpacked: {error.strerror or error}") from error
    with unpacked as name:
        folder = Path(name)
        _unpack(file, folder)
        try:
            return _add_all(store, load_dataset(folder))
        except BadConfiguration as error:
            text = str(error).replace(f"{folder.resolve()}/", "").replace(str(folder.resolve()), "")
            raise BadConfiguration(f"the archive: {text}") from None


def _add_all(store: FrameStore, dataset: Dataset) -> int:
    if dataset.card.depth.units_per_m != UNITS_PER_M:
        raise BadConfiguration(
            f"depth in {dataset.card.depth.units_per_m:g} units per metre, expected {UNITS_PER_M:g}"
        )
    places = [(split, index) for split in SPLITS for index in range(dataset.count(split))]
    store.refuse_unless_fit([_size_of(dataset, *place) for place in places])
    # All of them are read before the first is stored; without depth are some of before such images
    # were refused.
    with_depth = [place for place in places if has_depth(dataset.read(*place).depth)]
    splits = _splits_of(dataset)
    return store.add_uploads(_upload(dataset, *place, splits) for place in with_depth)


def _size_of(dataset: Dataset, split: Split, index: int) -> int:
    return sum((dataset.folder / path).stat().st_size for path in dataset.files[split][index])


def _splits_of(dataset: Dataset) -> dict[str, TrainingSplit]:
    """Return the splits of frames in trainings before their export, by name, as the card tells."""
    told = dataset.card.source.get(_SPLITS)
    known = told.items() if isinstance(told, dict) else ()
    return {name: split for name, split in known if split in get_args(TrainingSplit)}


def _upload(
    dataset: Dataset, split: Split, index: int, splits: Mapping[str, TrainingSplit]
) -> Upload:
    sample = dataset.read(split, index)
    return Upload(
        rgb=sample.rgb,
        depth_mm=sample.depth,
        annotation=Annotation(class_names=dataset.card.class_names, labels=sample.labels),
        uncoloured=sample.uncoloured,
        # What another data set does not train on is held back here, too.
        split=splits.get(dataset.name(split, index)) if split == "train" else "valid",
    )


def _unpack(packed: BinaryIO, folder: Path) -> None:
    """Write the entries of an archive below a folder."""
    with _reading(), open_zip(packed, "the archive") as archive:
        entries = [entry for entry in archive.infolist() if not entry.is_dir()]
        if sum(entry.file_size for entry in entries) > MAX_FRAMES_BYTES:
            raise BadConfiguration(f"the archive unpacks to more than {MAX_FRAMES_BYTES} bytes")
        for entry in entries:
            target = folder / _inside(entry.filename)
            with archive.open(entry) as file, _writing():
                target.parent.mkdir(parents=True, exist_ok=True)
                with target.open("wb") as out:
                    while part := _part(file):
                        out.write(part)


@contextmanager
def _reading() -> Iterator[None]:
    """Say in words what is damaged in an archive."""
    try:
        yield
    except DAMAGED_ZIP as error:
        raise BadConfiguration(f"the archive is damaged: {error!s:.200}") from None


@contextmanager
def _writing() -> Iterator[None]:
    """Say in words that the disk is full."""
    try:
        yield
    except OSError as error:
        raise StorageFailed(f"the archive cannot be unpacked: {error.strerror or error}") from None


def _part(file: IO[bytes]) -> bytes:
    """Return the next bytes of an entry; empty at its end."""
    with _reading():
        return file.read(PART_BYTES)


def _inside(name: str) -> str:
    path = PurePosixPath(name)
    known = name == CARD_NAME or name in _LISTS
    plain = len(path.parts) == 3 and path.parts[0] in SPLITS and path.parts[1] in KINDS
    if not (known or plain) or ".." in path.parts or "\\" in name or "\0" in name:
        raise BadConfiguration(
            f"the archive holds {name!r:.120}, expected the files of a data set: {CARD_NAME}, "
            "lists, and train/rgb/NAME.png"
        )
    return name
