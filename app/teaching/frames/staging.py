"""Frames on their way into the folder: written beside it, then moved in as one.

The moves begin with a mark in the staged folder. What a crash leaves of one with the mark is moved
in at the next start, what it leaves of another one is removed: all of it comes in, or none.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import shutil
from pathlib import Path

import numpy as np

from app.teaching.frames.frame_record import FrameRecord
from navcore.files import sync_folder, write_whole
from navcore.learning.data.images import (
    DepthArray,
    LabelArray,
    MaskArray,
    RgbArray,
    encode_grey,
    encode_rgb,
)

EXPORTED, UNPACKED, STAGED = ".export-", ".import-", ".staged-"
"""Beginnings of the names of temporary folders in that of the frames."""
MARK = "complete"
"""File in a staged folder of which everything is written."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NewFrame:
    """A frame to store, whose labels are numbers of the classes of the folder."""

    record: FrameRecord
    """Its record."""
    rgb: RgbArray
    """(H, W, 3) colours."""
    depth_mm: DepthArray
    """(H, W) depth in millimetres, 0 = not measured."""
    labels: LabelArray
    """(H, W) labels."""
    uncoloured: MaskArray | None
    """(H, W) pixels whose colour is not known; None where all are."""


def stage(staged: Path, new: NewFrame) -> None:
    """Write the files of a frame; raises `OSError`, `StorageFailed`."""
    colours, depth, label = (staged / path for path in new.record.files)
    record = staged / new.record.path
    for path in (colours, depth, label, record):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(colours, encode_rgb(new.rgb, uncoloured=new.uncoloured))
    write_whole(depth, encode_grey(new.depth_mm))
    write_whole(label, as_npy(new.labels))
    write_whole(record, new.record.as_json())


def move_in(staged: Path, folder: Path) -> None:
    """Move staged frames into their folder, also where a crash comes between; raises `OSError`,
    `StorageFailed`."""
    sync_folder(staged / "train")
    write_whole(staged / MARK, b"")
    sync_folder(folder)
    _move(staged, folder)


def _move(staged: Path, folder: Path) -> None:
    """Move the files of a staged folder, the records last."""
    for kind in sorted(staged.glob("train/*"), key=lambda path: path.name == "camera"):
        target = folder / "train" / kind.name
        target.mkdir(parents=True, exist_ok=True)
        for path in kind.iterdir():
            path.replace(target / path.name)
        sync_folder(target)


def settle(folder: Path) -> None:
    """Move in or remove what a session that was killed has left in a folder of frames."""
    for staged in sorted(folder.glob(f"{STAGED}*")):
        with contextlib.suppress(OSError):
            if (staged / MARK).exists():
                _move(staged, folder)
            shutil.rmtree(staged)
    for prefix in (EXPORTED, UNPACKED):
        for left in folder.glob(f"{prefix}*"):
            shutil.rmtree(left, ignore_errors=True)


def as_npy(labels: LabelArray) -> bytes:
    """Return the file of (H, W) labels."""
    content = io.BytesIO()
    np.save(content, np.ascontiguousarray(labels), allow_pickle=False)
    return content.getvalue()
