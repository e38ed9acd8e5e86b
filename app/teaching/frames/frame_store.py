"""Folder of captured frames: a data set in the layout of the official code that grows by captures
and annotations.

Colours, depth and labels lie as `navcore.learning.data.dataset` reads them, all in the split
`train`; camera and pose of each frame lie beside them. A frame is complete when its record is
there, which comes last, and annotated when its labels are not all void. Every write replaces a file
in one go, and what comes together is staged and moved in. No name is given twice: the card keeps
the last one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import tempfile
import threading
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from app.teaching.frames.frame_record import (
    UNITS_PER_M,
    FrameRecord,
    TrainingSplit,
    depth_mm_of,
    read_record,
    record_of,
)
from app.teaching.frames.rules import CaptureRules
from app.teaching.frames.staging import STAGED, NewFrame, as_npy, move_in, settle, stage
from app.teaching.frames.thumbnails import is_near_duplicate, near_duplicates
from navcore.errors import BadConfiguration, NotKnown, Outdated, Refused, StorageFailed
from navcore.files import write_whole
from navcore.learning.data.card import (
    CARD_NAME,
    KINDS,
    MAX_CLASSES,
    SPLITS,
    Counts,
    DatasetCard,
    DepthSums,
)
from navcore.learning.data.images import (
    DepthArray,
    LabelArray,
    MaskArray,
    RgbArray,
    png_size,
    read_depth,
    read_labels,
    read_rgb,
)
from navcore.learning.data.writer import write_text
from navcore.perception.esanet.network.preprocess import DepthStatistics
from navcore.robot.frame import Frame
from web.interface.teaching import NOTHING_NAME, Annotation, CapturedFrame, FrameSource

DEFAULT = CaptureRules()
_LAST_ID = "last_id"
"""Key of the card's source: number of the last frame."""
VERSION_BYTES = 6
"""Size of the version of an annotation; an ETag has up to 15 decimal digits."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class _Stored:
    """A frame of the folder, the labels that occur in its annotation and the version of that, and
    the size of its images and labels in bytes."""

    record: FrameRecord
    labels: tuple[int, ...]
    version: int
    size_bytes: int


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Upload:
    """An uploaded image with its annotation."""

    rgb: RgbArray
    """(H, W, 3) colours."""
    depth_mm: DepthArray
    """(H, W) depth in millimetres, 0 = not measured."""
    annotation: Annotation
    """Its annotation."""
    uncoloured: MaskArray | None = None
    """(H, W) pixels whose colour is not known; None where all are."""
    split: TrainingSplit | None = None
    """Split of the image in trainings elsewhere; None before the first one."""


class NoDepth(Refused):
    """The image has no depth to learn from; others may have."""


class FrameStore:
    """Bounded folder of frames; safe to use from any thread."""

    def __init__(self, folder: Path, rules: CaptureRules = DEFAULT) -> None:
        self.folder, self.rules = folder, rules
        self._lock = threading.RLock()
        self._stored: dict[str, _Stored] | None = None
        self._class_names: list[str] = [NOTHING_NAME]
        self._last_id = 0
        self.dropped = 0
        """Number of near-duplicates that were not kept since the start."""

    def all(self) -> list[CapturedFrame]:
        """Return all frames, oldest first."""
        with self._lock:
            return [self._shown(one) for one in self._open().values()]

    @property
    def bytes_used(self) -> int:
        """Size of the stored frames in bytes."""
        with self._lock:
            return sum(one.size_bytes for one in self._open().values())

    def add_frame(self, frame: Frame, source: FrameSource) -> CapturedFrame | None:
        """Store a frame that is placed in the map; None for a near-duplicate of a stored one.

        Raises `Refused` when the folder is full, `StorageFailed` when it cannot be written.
        """
        with self._lock:
            depth_mm = depth_mm_of(frame)
            record = record_of(self._next_name(), frame.rgb, depth_mm, source, frame)
            if self._is_known(record):
                self.dropped += 1
                return None
            self._last_id = int(record.id)
            self._refuse_when_full()
            new = NewFrame(
                record=record,
                rgb=frame.rgb,
                depth_mm=depth_mm,
                labels=np.zeros_like(depth_mm, dtype=np.uint8),
                uncoloured=frame.uncoloured,
            )
            return self._add([new])[0]

    def add_uploads(self, uploads: Iterable[Upload]) -> int:
        """Store uploaded images, near-duplicates or not, and return their number: all or none.

        Raises `Refused` when the folder is full, `NoDepth`, `BadConfiguration` for an annotation
        that does not fit, `StorageFailed`.
        """
        return len(self._add(map(self._new, uploads)))

    def _new(self, upload: Upload) -> NewFrame:
        """Return the frame of an upload, whose name and classes no other one gets meanwhile."""
        with self._lock:
            name = self._next_name()
            self._last_id = int(name)
        record = dataclasses.replace(
            record_of(name, upload.rgb, upload.depth_mm, "upload"), split=upload.split
        )
        with self._lock:
            labels, self._class_names = self._labels_of(record, upload.annotation)
        return NewFrame(
            record=record,
            rgb=upload.rgb,
            depth_mm=upload.depth_mm,
            labels=labels,
            uncoloured=upload.uncoloured,
        )

    def refuse_unless_fit(self, sizes_bytes: Sequence[int]) -> None:
        """Raise `Refused` where images of these sizes do not fit into the folder."""
        with self._lock:
            frames, used_bytes = len(self._open()), self.bytes_used
        rules, count, more_bytes = self.rules, len(sizes_bytes), sum(sizes_bytes)
        if (
            frames + count > rules.max_frames
            or used_bytes + more_bytes - max(sizes_bytes, default=0) >= rules.max_bytes
        ):
            raise Refused(
                f"{count} images of {more_bytes / 1e6:.0f} MB do not fit into the folder of "
                f"captured frames: it has {frames} ({used_bytes / 1e6:.0f} MB) of at most "
                f"{rules.max_frames} ({rules.max_bytes / 1e6:.0f} MB); delete frames that are not "
                "needed"
            )

    def delete(self, name: str) -> None:
        """Delete a frame: first its record, so that a crash leaves no half of it listed."""
        with self._lock:
            record = self._known(name).record
            try:
                self._unlink(record)
            except OSError as error:
                raise StorageFailed(
                    f"{self.folder}: the frame cannot be deleted: {error.strerror or error}"
                ) from error
            del self._open()[name]
            self._publish()

    def images(self, name: str) -> tuple[RgbArray, DepthArray]:
        """Return colours (H, W, 3) and depth (H, W) in millimetres of a frame."""
        files = self._known(name).record.files
        return read_rgb(self.folder / files[0]), read_depth(self.folder / files[1])

    def picture(self, name: str) -> bytes:
        """Return the colours of a frame as PNG."""
        try:
            return (self.folder / self._known(name).record.files[0]).read_bytes()
        except OSError as error:
            raise StorageFailed(f"{self.folder}: {name}: {error.strerror or error}") from None

    def annotation(self, name: str) -> Annotation:
        """Return the annotation of a frame."""
        with self._lock:
            stored = self._known(name)
            return Annotation(
                class_names=tuple(self._class_names),
                labels=read_labels(self.folder / stored.record.files[2]),
                version=stored.version,
            )

    def annotate(
        self, name: str, annotation: Annotation, *, expected_version: int | None = None
    ) -> CapturedFrame:
        """Replace the annotation of a frame; raises `BadConfiguration` for labels that do not fit
        it, `Outdated` where another one than `expected_version` is stored."""
        with self._lock:
            stored = self._known(name)
            labels, class_names = self._labels_of(stored.record, annotation)
            version = _version_of(labels)
            # What is stored already is no conflict: an edit whose answer was lost is sent again.
            if expected_version not in (None, stored.version) and version != stored.version:
                raise Outdated(f"the marks of image {name} are not those that were edited")
            self._write_card(class_names)  # first: no label without the name of its class
            write_whole(self.folder / stored.record.files[2], as_npy(labels))
            self._class_names = class_names
            self._open()[name] = dataclasses.replace(
                stored, labels=_occurring(labels), version=version
            )
            return self._shown(self._open()[name])

    def splits(self) -> dict[str, TrainingSplit]:
        """Return the splits of the frames that a training has used, here or before an import, by
        name."""
        with self._lock:
            records = {name: stored.record for name, stored in self._open().items()}
        return {name: record.split for name, record in records.items() if record.split}

    def near_duplicates(self) -> list[set[str]]:
        """Return the groups of stored frames that show the same, by name, as imports leave them."""
        with self._lock:
            fingerprints = {
                name: stored.record.fingerprint for name, stored in self._open().items()
            }
        return near_duplicates(fingerprints, self.rules)

    def note_splits(self, splits: Mapping[str, TrainingSplit]) -> None:
        """Store the splits of frames for later trainings; raises `StorageFailed`."""
        with self._lock:
            for name, split in splits.items():
                stored = self._known(name)
                if stored.record.split != split:
                    record = dataclasses.replace(stored.record, split=split)
                    write_whole(self.folder / record.path, record.as_json())
                    self._open()[name] = dataclasses.replace(stored, record=record)

    def held(self) -> contextlib.AbstractContextManager[bool]:
        """Return the lock under which nothing in the folder changes."""
        return self._lock

    def temporary(self, prefix: str) -> tempfile.TemporaryDirectory[str]:
        """Make a temporary folder in that of the frames; raises `OSError`."""
        with self._lock:
            self._open()  # removes those of a session that was killed
        self.folder.mkdir(parents=True, exist_ok=True)
        return tempfile.TemporaryDirectory(prefix=prefix, dir=self.folder)

    def _add(self, frames: Iterable[NewFrame]) -> list[CapturedFrame]:
        """Store frames; nothing of them stays when that fails. The folder is locked only while
        they are moved in."""
        with self._lock:
            self._open()
            known, is_first = len(self._class_names), not (self.folder / CARD_NAME).exists()
        added: dict[str, _Stored] = {}
        try:
            with self.temporary(STAGED) as name:
                staged = Path(name)
                for new in frames:
                    _refuse_without_depth(new.record)
                    stage(staged, new)
                    added[new.record.id] = _stored(staged, new.record, new.labels)
                with self._lock:
                    self._take_in(staged, added)
        except BaseException as error:
            with self._lock:
                self._leave_out(added, known, is_first=is_first)
            if isinstance(error, OSError | StorageFailed):
                raise StorageFailed(
                    f"the frame cannot be stored, those stored before are intact: {error}"
                ) from error
            raise
        with self._lock:
            return [self._shown(one) for one in added.values()]

    def _take_in(self, staged: Path, added: Mapping[str, _Stored]) -> None:
        """Move staged frames into the folder and list them."""
        if not added:
            return
        self.refuse_unless_fit([one.size_bytes for one in added.values()])
        before = self._open()
        self._write_card(self._class_names)  # first: no label without the name of its class
        move_in(staged, self.folder)
        self._stored = dict(sorted({**before, **added}.items()))
        try:
            self._publish()
        except BaseException:
            self._stored = before
            raise

    def _leave_out(self, added: Mapping[str, _Stored], known: int, *, is_first: bool) -> None:
        """Remove what is there of frames that could not be stored, and their classes beyond the
        `known` ones, unless others have them by now."""
        used = max((max(one.labels, default=0) for one in self._open().values()), default=0)
        self._class_names = self._class_names[: max(known, used)]
        for one in added.values():
            with contextlib.suppress(OSError):
                self._unlink(one.record)
        with contextlib.suppress(OSError, StorageFailed):
            if is_first and not self._open():
                (self.folder / CARD_NAME).unlink(missing_ok=True)
            elif added:
                self._publish()  # the lists may name them already

    def _refuse_when_full(self) -> None:
        if len(self._open()) >= self.rules.max_frames or self.bytes_used >= self.rules.max_bytes:
            raise Refused(
                f"the folder of captured frames is full ({len(self._open())} frames, "
                f"{self.bytes_used / 1e6:.0f} MB); delete frames that are not needed"
            )

    def _unlink(self, record: FrameRecord) -> None:
        """Remove the files of a frame, its record first; raises `OSError`."""
        for path in (record.path, *record.files):
            (self.folder / path).unlink(missing_ok=True)

    def _labels_of(
        self, record: FrameRecord, annotation: Annotation
    ) -> tuple[LabelArray, list[str]]:
        """Return an annotation in the numbers of this folder, and the names of its classes with
        the new ones at the end: labels on disk keep their meaning."""
        given, names = annotation.labels, annotation.class_names
        if given.shape != (record.height, record.width):
            raise BadConfiguration(
                f"the annotation has {given.shape[0]} × {given.shape[1]} pixels, the frame "
                f"{record.height} × {record.width}"
            )
        folded = [name.strip().casefold() for name in names]
        if len(set(folded)) != len(folded) or "" in folded:
            raise BadConfiguration("the annotation names a class twice, or one without a name")
        if int(given.max(initial=0)) > len(names):
            raise BadConfiguration(
                f"label {given.max()} is beyond the {len(names)} classes of the annotation"
            )
        self._open()
        known = list(self._class_names)
        numbers = np.zeros(256, dtype=np.uint8)
        for label in _occurring(given):
            name = folded[label - 1]
            own = [one.strip().casefold() for one in known]
            if name not in own:
                if len(known) == MAX_CLASSES:
                    raise BadConfiguration(f"the frames have {MAX_CLASSES} classes already")
                known.append(names[label - 1].strip())
                own.append(name)
            numbers[label] = own.index(name) + 1
        return np.asarray(numbers[given], dtype=np.uint8), known

    def _shown(self, stored: _Stored) -> CapturedFrame:
        record = stored.record
        return CapturedFrame(
            id=record.id,
            source=record.source,
            width=record.width,
            height=record.height,
            annotated=bool(stored.labels),
            class_names=tuple(self._class_names[label - 1] for label in stored.labels),
            version=stored.version,
        )

    def _known(self, name: str) -> _Stored:
        with self._lock:
            found = self._open().get(name)
        if found is None:
            raise NotKnown(f"no captured frame is called {name!r:.40}")
        return found

    def _is_known(self, record: FrameRecord) -> bool:
        fingerprint = record.fingerprint
        return any(
            is_near_duplicate(fingerprint, other.record.fingerprint, self.rules)
            for other in self._open().values()
        )

    def _next_name(self) -> str:
        self._open()
        return f"{self._last_id + 1:06d}"

    def _open(self) -> dict[str, _Stored]:
        """Return the frames by name, read from the folder of an earlier session at first; a frame
        that a crash left incomplete is left out, and so is one with a damaged file, as far as the
        ends of the images show it: to read them whole would take seconds."""
        if self._stored is not None:
            return self._stored
        found: dict[str, _Stored] = {}
        settle(self.folder)
        if (self.folder / CARD_NAME).exists():
            self._class_names, self._last_id = self._read_card()
            for path in sorted(self.folder.glob("train/camera/*.json")):
                if path.stem.isdecimal():
                    self._last_id = max(self._last_id, int(path.stem))
                with contextlib.suppress(BadConfiguration, OSError):
                    record = read_record(path)
                    labels = read_labels(self.folder / record.files[2])
                    sizes = {png_size(self.folder / image) for image in record.files[:2]}
                    is_known = int(labels.max(initial=0)) <= len(self._class_names)
                    if is_known and sizes == {labels.shape} == {(record.height, record.width)}:
                        found[record.id] = _stored(self.folder, record, labels)
        self._stored = found
        if found:
            self._publish()
        return found

    def _read_card(self) -> tuple[list[str], int]:
        """Return the names of the classes, and the number of the last frame, also a deleted one."""
        try:
            card = json.loads((self.folder / CARD_NAME).read_text(encoding="utf-8"))
            names = [str(name) for name in card["class_names"]]
            return names, int(card.get("source", {}).get(_LAST_ID, 0))
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise StorageFailed(
                f"{self.folder / CARD_NAME} cannot be read: {error}; move the folder away"
            ) from None

    def _publish(self) -> None:
        """Write the lists and the card."""
        listed = [one.record.files for one in self._open().values()]
        for split in SPLITS:
            for column, kind in enumerate(KINDS):
                lines = [files[column] for files in listed] if split == "train" else []
                write_text(
                    self.folder / f"{split}_{kind}.txt", "".join(f"{line}\n" for line in lines)
                )
        if listed:
            self._write_card(self._class_names)

    def _write_card(self, class_names: list[str]) -> None:
        sums = DepthSums()
        for one in self._open().values():
            sums.include(one.record.sums)
        sizes = {(one.record.height, one.record.width) for one in self._open().values()}
        card = DatasetCard(
            class_names=tuple(class_names),
            depth=_statistics(sums),
            counts=Counts(train=len(self._open())),
            sizes=tuple(sorted(sizes)),
            source={
                "made_by": "frames captured and annotated in the operator console",
                _LAST_ID: self._last_id,
            },
        )
        write_text(self.folder / CARD_NAME, json.dumps(dataclasses.asdict(card), indent=1))


def _stored(folder: Path, record: FrameRecord, labels: LabelArray) -> _Stored:
    """Return what is kept of a frame whose files lie in a folder."""
    return _Stored(
        record=record,
        labels=_occurring(labels),
        version=_version_of(labels),
        size_bytes=sum((folder / path).stat().st_size for path in record.files),
    )


def _refuse_without_depth(record: FrameRecord) -> None:
    try:
        record.sums.statistics(units_per_m=UNITS_PER_M)
    except BadConfiguration as error:
        raise NoDepth(f"the image cannot be learned from: {error}") from None


def _statistics(sums: DepthSums) -> DepthStatistics:
    """Return the statistics of depth; those of none, as in a data set without images, where the
    frames of an earlier release have no depth."""
    try:
        return sums.statistics(units_per_m=UNITS_PER_M)
    except BadConfiguration:
        return DepthStatistics(mean=0.0, std=1.0, units_per_m=UNITS_PER_M)


def _occurring(labels: LabelArray) -> tuple[int, ...]:
    """Return the labels of an image but void, in ascending order."""
    return tuple(np.unique(labels[labels > 0]).tolist())


def _version_of(labels: LabelArray) -> int:
    """Return the version of an annotation, in the numbers of the folder: it follows from the
    labels, and so is the same after a restart."""
    return int.from_bytes(hashlib.sha256(labels.tobytes()).digest()[:VERSION_BYTES])
