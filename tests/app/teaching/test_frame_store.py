"""Captured frames: what is kept, what is refused, and that nothing stored is lost."""

from __future__ import annotations

import dataclasses
import gc
import io
import itertools
import os
import shutil
import threading
import time
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest

from app.teaching.frames import frame_store, live_frames, staging
from app.teaching.frames.frame_archive import add_archive, exported
from app.teaching.frames.frame_store import FrameStore, Upload
from app.teaching.frames.live_frames import LiveFrames
from app.teaching.frames.rules import CaptureRules
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.files import write_whole
from navcore.learning.data import zip_archive
from navcore.learning.data.card import DepthSums, Split
from navcore.learning.data.dataset import load_dataset
from navcore.learning.data.images import DepthArray, RgbArray
from navcore.learning.data.writer import DatasetWriter, write_text
from navcore.perception.esanet.network.preprocess import NYUV2_DEPTH
from tests.app.teaching.scenes import BLOCK, HEIGHT, WIDTH, frame_at
from tests.damaged_zip import METHODS, with_damaged_entry
from web.interface.teaching import Annotation


def block_of(name: str) -> Annotation:
    """Return an annotation of the block alone."""
    labels = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    labels[BLOCK] = 1
    return Annotation(class_names=(name,), labels=labels)


def upload(rgb: RgbArray, depth_mm: DepthArray) -> Upload:
    """Return an uploaded image in which a shoe is annotated."""
    return Upload(rgb=rgb, depth_mm=depth_mm, annotation=block_of("shoe"))


@pytest.fixture
def store(tmp_path: Path) -> FrameStore:
    """An empty folder."""
    return FrameStore(tmp_path / "frames")


def test_a_frame_is_stored_whole_and_read_again_by_the_next_start(store: FrameStore) -> None:
    frame = frame_at(1.0)
    stored = store.add_frame(frame, "operator")
    assert stored is not None and not stored.annotated
    store.annotate(stored.id, block_of("shoe"))
    again = FrameStore(store.folder)
    (shown,) = again.all()
    assert shown == store.all()[0]
    assert shown.annotated and shown.class_names == ("shoe",) and shown.source == "operator"
    rgb, depth_mm = again.images(stored.id)
    assert np.array_equal(rgb, frame.rgb)
    assert np.abs(depth_mm / 1000 - frame.depth_m).max() <= 0.0005001
    dataset = load_dataset(store.folder)
    labels = dataset.read("train", 0).labels
    assert dataset.card.class_names[labels[BLOCK].max() - 1] == "shoe"
    assert (np.delete(labels, BLOCK[0], axis=0) == 0).all()


@pytest.mark.parametrize(
    ("x_m", "yaw_rad", "brightness", "kept"),
    [
        (1.05, 0.0, 120, False),  # nearly the same pose and image
        (9.0, 1.0, 120, False),  # the same image from elsewhere, as after a pose was corrected
        (1.05, 0.0, 124, False),  # near, slightly brighter
        (2.0, 0.0, 124, True),  # the same change from elsewhere
        (1.05, 0.0, 160, True),  # the same pose, but it shows something else
    ],
)
def test_a_near_duplicate_by_pose_and_image_is_dropped(
    store: FrameStore, x_m: float, yaw_rad: float, brightness: int, kept: bool
) -> None:
    assert store.add_frame(frame_at(1.0), "drive") is not None
    other = store.add_frame(frame_at(x_m, yaw_rad=yaw_rad, brightness=brightness), "drive")
    assert (other is not None) is kept
    assert store.dropped == (0 if kept else 1)


def test_near_duplicates_are_found_whatever_brought_them(store: FrameStore) -> None:
    for x_m, brightness in ((1.0, 120), (3.0, 60)):
        store.add_frame(frame_at(x_m, brightness=brightness), "drive")
    assert store.near_duplicates() == []
    store.add_uploads([upload(*store.images(name)) for name in ("000001", "000002", "000001")])
    assert store.near_duplicates() == [{"000001", "000003", "000005"}, {"000002", "000004"}]


def test_without_the_rules_nothing_is_dropped(tmp_path: Path) -> None:
    store = FrameStore(tmp_path, CaptureRules(alike=0.0, same=0.0))
    assert store.add_frame(frame_at(1.0), "drive") is not None
    assert store.add_frame(frame_at(1.05), "drive") is not None


def test_a_full_folder_refuses_and_keeps_what_it_has(tmp_path: Path) -> None:
    store = FrameStore(tmp_path, CaptureRules(max_frames=1))
    store.add_frame(frame_at(1.0), "drive")
    with pytest.raises(Refused, match="full"):
        store.add_frame(frame_at(5.0, brightness=40), "drive")
    assert len(store.all()) == len(load_dataset(tmp_path)) == 1


def test_a_full_disk_leaves_no_half_of_a_frame(
    store: FrameStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.add_frame(frame_at(1.0), "drive")

    def full(path: Path, data: bytes) -> None:
        raise StorageFailed(f"{path} cannot be written: No space left on device")

    for writer in (staging, frame_store):
        monkeypatch.setattr(writer, "write_whole", full)
    with pytest.raises(StorageFailed, match="No space left"):
        store.add_frame(frame_at(5.0, brightness=40), "drive")
    with pytest.raises(StorageFailed):
        store.annotate("000001", block_of("shoe"))
    monkeypatch.undo()
    assert [one.id for one in FrameStore(store.folder).all()] == ["000001"]
    assert not list(store.folder.glob("*/*/000002*"))
    assert len(load_dataset(store.folder)) == 1


def test_a_deleted_frame_is_gone_and_a_damaged_one_is_left_out(store: FrameStore) -> None:
    for x_m, brightness in ((1.0, 120), (3.0, 60), (5.0, 20)):
        store.add_frame(frame_at(x_m, brightness=brightness), "drive")
    store.delete("000001")
    (store.folder / "train/label/000002.npy").write_bytes(b"\x93NUMPY damaged")
    again = FrameStore(store.folder)
    assert [one.id for one in again.all()] == ["000003"]
    assert len(load_dataset(store.folder)) == 1
    with pytest.raises(NotKnown):
        again.annotation("000001")


@pytest.mark.parametrize("kind", ["rgb", "depth"])
@pytest.mark.parametrize("left", [0, 0.5], ids=["empty", "cut off"])
def test_a_frame_whose_image_was_cut_off_by_a_crash_is_left_out(
    store: FrameStore, kind: str, left: float
) -> None:
    for x_m, brightness in ((1.0, 120), (3.0, 60)):
        store.add_frame(frame_at(x_m, brightness=brightness), "drive")
    image = store.folder / f"train/{kind}/000001.png"
    content = image.read_bytes()
    image.write_bytes(content[: int(left * len(content))])
    assert [one.id for one in FrameStore(store.folder).all()] == ["000002"]
    dataset = load_dataset(store.folder)
    assert dataset.count("train") == 1
    dataset.read("train", 0)


def test_a_frame_that_is_stored_is_whole_also_after_a_loss_of_power(
    store: FrameStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced, fsync = list[str](), os.fsync

    def noted(handle: int) -> None:
        synced.append(str(Path(f"/proc/self/fd/{handle}").readlink()))
        fsync(handle)

    monkeypatch.setattr(os, "fsync", noted)
    store.add_frame(frame_at(1.0), "drive")
    for kind in ("rgb", "depth", "label", "camera"):
        assert any(f"train/{kind}/.000001." in path for path in synced), kind


def test_a_frame_that_lacks_a_file_can_be_deleted(store: FrameStore) -> None:
    store.add_frame(frame_at(1.0), "drive")
    (store.folder / "train/depth/000001.png").unlink()
    store.delete("000001")
    assert store.all() == [] and store.bytes_used == 0
    assert not list(store.folder.glob("*/*/000001*"))


def test_no_frame_gets_the_name_of_a_deleted_one(store: FrameStore) -> None:
    for x_m, brightness in ((1.0, 120), (3.0, 60)):
        store.add_frame(frame_at(x_m, brightness=brightness), "drive")
    store.delete("000002")
    stored = store.add_frame(frame_at(5.0, brightness=20), "drive")
    assert stored is not None and stored.id == "000003"
    for name in ("000001", "000003"):
        store.delete(name)
    stored = FrameStore(store.folder).add_frame(frame_at(5.0, brightness=20), "drive")
    assert stored is not None and stored.id == "000004"


def test_a_class_is_the_same_with_blanks_around_its_name(store: FrameStore) -> None:
    store.add_frame(frame_at(1.0), "drive")
    for name in ("cup", " cup", "Cup "):
        assert store.annotate("000001", block_of(name)).class_names == ("cup",)
    assert store.annotate("000001", block_of(" shoe")).class_names == ("shoe",)


def test_a_class_of_an_annotation_that_was_not_stored_is_none(
    store: FrameStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.add_frame(frame_at(1.0), "drive")

    def full(path: Path, data: bytes) -> None:
        raise StorageFailed(f"{path} cannot be written: No space left on device")

    with monkeypatch.context() as context:
        for writer in (staging, frame_store):
            context.setattr(writer, "write_whole", full)
        with pytest.raises(StorageFailed):
            store.annotate("000001", block_of("shoe"))
        with pytest.raises(StorageFailed):
            store.add_uploads([upload(*store.images("000001"))])
    assert store.annotation("000001").class_names == ("background",)
    assert store.annotate("000001", block_of("cup")).class_names == ("cup",)


def without_depth() -> tuple[np.ndarray, np.ndarray]:
    """Return an image whose depth was not measured."""
    return frame_at(5.0).rgb, np.zeros((HEIGHT, WIDTH), dtype=np.uint16)


def test_an_image_without_depth_is_refused_beside_others_too(store: FrameStore) -> None:
    store.add_frame(frame_at(1.0), "drive")
    with pytest.raises(Refused, match="cannot be learned from"):
        store.add_uploads([upload(*without_depth())])
    assert len(store.all()) == 1


def test_images_without_depth_of_an_earlier_release_can_outlive_the_others(
    store: FrameStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.add_frame(frame_at(1.0), "drive")
    with monkeypatch.context() as earlier:
        earlier.setattr(DepthSums, "statistics", lambda *_, units_per_m: NYUV2_DEPTH)
        store.add_uploads([upload(*without_depth())])
    store.delete("000001")
    assert [one.id for one in FrameStore(store.folder).all()] == ["000002"]
    assert store.annotate("000002", block_of("cup")).class_names == ("cup",)


@pytest.mark.parametrize("failing", [range(100), [1]], ids=["all of them", "the second alone"])
def test_a_frame_whose_lists_cannot_be_written_is_not_kept_and_no_list_names_it(
    store: FrameStore, monkeypatch: pytest.MonkeyPatch, failing: Sequence[int]
) -> None:
    store.add_frame(frame_at(1.0), "drive")
    written = itertools.count()

    def full(path: Path, text: str) -> None:
        if path.suffix == ".txt" and next(written) in failing:
            raise StorageFailed(f"{path} cannot be written: No space left on device")
        write_text(path, text)

    with monkeypatch.context() as context:
        context.setattr(frame_store, "write_text", full)
        with pytest.raises(StorageFailed, match="No space left"):
            store.add_frame(frame_at(5.0, brightness=40), "drive")
    assert [one.id for one in store.all()] == ["000001"]
    assert not list(store.folder.glob("*/*/000002*"))
    assert load_dataset(store.folder).count("train") == 1


def test_a_frame_without_depth_ends_no_capture_and_is_left_out_of_an_archive(
    store: FrameStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = LiveFrames(tmp_path / "live", newest=lambda: None, class_names=list)
    frames.capture_while_driving(True)
    blind = dataclasses.replace(frame_at(1.0), depth_m=np.zeros((HEIGHT, WIDTH), np.float32))
    frames.note(blind)
    eventually(frames._waiting.empty)
    frames.note(frame_at(3.0))
    eventually(lambda: len(frames.all()) == 1)
    assert frames.state().capturing
    frames.close()
    with monkeypatch.context() as earlier:
        earlier.setattr(DepthSums, "statistics", lambda *_, units_per_m: NYUV2_DEPTH)
        store.add_uploads([upload(*without_depth())])
        store.add_frame(frame_at(1.0, brightness=40), "drive")
        archive = exported(store)
    with archive:
        assert add_archive(FrameStore(tmp_path / "other"), archive) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"labels": np.zeros((5, 5), dtype=np.uint8)}, "5 × 5 pixels"),
        ({"labels": np.full((HEIGHT, WIDTH), 3, dtype=np.uint8)}, "beyond the 1 classes"),
        ({"class_names": ("shoe", "Shoe")}, "twice"),
    ],
)
def test_an_annotation_that_does_not_fit_is_refused(
    store: FrameStore, change: dict[str, object], said: str
) -> None:
    stored = store.add_frame(frame_at(1.0), "drive")
    assert stored is not None
    store.annotate(stored.id, block_of("shoe"))
    with pytest.raises(BadConfiguration, match=said):
        store.annotate(stored.id, dataclasses.replace(block_of("shoe"), **change))  # type: ignore[arg-type]
    assert store.annotation(stored.id).labels[BLOCK].all()


def test_an_archive_goes_out_and_in(store: FrameStore, tmp_path: Path) -> None:
    store.add_frame(frame_at(1.0), "drive")
    store.annotate("000001", block_of("shoe"))
    other = FrameStore(tmp_path / "other")
    with exported(store) as file:
        assert add_archive(other, file) == 1
    (shown,) = FrameStore(other.folder).all()
    assert shown.source == "upload" and shown.class_names == ("shoe",)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda name, data: data[: len(data) // 2] if name.endswith(".png") else data, "rgb"),
        (lambda name, data: data.replace(b'"shoe"', b'"Background"'), "class names"),
    ],
)
def test_a_damaged_archive_is_refused_whole(
    store: FrameStore, tmp_path: Path, change: object, said: str
) -> None:
    for x_m, brightness in ((1.0, 120), (3.0, 60)):
        store.add_frame(frame_at(x_m, brightness=brightness), "drive")
        store.annotate(store.all()[-1].id, block_of("shoe"))
    content = io.BytesIO()
    with (
        exported(store) as file,
        zipfile.ZipFile(file) as old,
        zipfile.ZipFile(content, "w") as new,
    ):
        for name in old.namelist():
            damaged = name.endswith(("000002.png", "dataset.json"))
            data = old.read(name)
            new.writestr(name, change(name, data) if damaged else data)  # type: ignore[operator]
    other = FrameStore(tmp_path / "other")
    for data in (content.getvalue(), content.getvalue()[:-500], b"no archive"):
        with pytest.raises(BadConfiguration) as refused:
            add_archive(other, io.BytesIO(data))
        assert str(tmp_path) not in str(refused.value)
        said_all = str(refused.value)
    assert "archive" in said_all
    with pytest.raises(BadConfiguration, match=said):
        add_archive(other, content)
    assert other.all() == []


def archive_of(store: FrameStore, *names: str) -> BinaryIO:
    """Return an archive with frames in which each of some classes is annotated."""
    for number, name in enumerate(names):
        frame = store.add_frame(frame_at(float(number), brightness=20 + 40 * number), "drive")
        assert frame is not None
        store.annotate(frame.id, block_of(name))
    return exported(store)


def test_pixels_without_a_colour_are_known_as_such_also_after_an_export_and_an_import(
    store: FrameStore, tmp_path: Path
) -> None:
    frame, uncoloured = frame_at(1.0), np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    uncoloured[10:20, 5:9] = True
    rgb = np.where(uncoloured[..., None], np.uint8(0), frame.rgb)
    store.add_frame(dataclasses.replace(frame, rgb=rgb, uncoloured=uncoloured), "drive")
    other = FrameStore(tmp_path / "other")
    with exported(store) as archive:
        add_archive(other, archive)
    for folder in (store.folder, other.folder):
        read = load_dataset(folder).read("train", 0)
        assert np.array_equal(read.rgb, rgb) and read.uncoloured is not None
        assert np.array_equal(read.uncoloured, uncoloured)
    store.add_frame(frame_at(3.0, brightness=60), "drive")
    assert load_dataset(store.folder).read("train", 1).uncoloured is None


@pytest.mark.parametrize("method", METHODS)
def test_an_archive_with_a_damaged_stream_of_any_compression_is_refused_in_words(
    store: FrameStore, tmp_path: Path, method: int
) -> None:
    with archive_of(store, "shoe") as archive:
        damaged = with_damaged_entry(archive.read(), "train/depth/000001.png", method)
    with pytest.raises(BadConfiguration, match="the archive is damaged"):
        add_archive(FrameStore(tmp_path / "other"), io.BytesIO(damaged))


def test_an_archive_of_very_many_files_is_refused(
    store: FrameStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with archive_of(store, "shoe") as archive:
        monkeypatch.setattr(zip_archive, "MAX_ENTRIES", 5)
        with pytest.raises(BadConfiguration, match="the archive: 13 entries, at most 5"):
            add_archive(FrameStore(tmp_path / "other"), archive)


@pytest.mark.parametrize(
    "room", [CaptureRules(max_frames=3), CaptureRules(max_bytes=10_000)], ids=["images", "bytes"]
)
def test_an_archive_that_does_not_fit_is_refused_before_anything_is_stored(
    store: FrameStore, tmp_path: Path, room: CaptureRules, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = FrameStore(tmp_path / "other", room)
    other.add_frame(frame_at(1.0), "drive")
    before = sorted(path for path in other.folder.rglob("*") if path.is_file())
    monkeypatch.setattr(other, "add_uploads", None)
    with (
        archive_of(store, "shoe", "bag", "cup") as archive,
        pytest.raises(Refused, match="3 images of 0 MB do not fit"),
    ):
        add_archive(other, archive)
    assert sorted(path for path in other.folder.rglob("*") if path.is_file()) == before


def test_an_archive_is_published_once_and_not_with_each_of_its_images(
    store: FrameStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = list[str]()

    def noted(path: Path, text: str) -> None:
        written.append(path.name)
        write_text(path, text)

    other = FrameStore(tmp_path / "other")
    with archive_of(store, "shoe", "shoe", "shoe", "shoe") as archive:
        monkeypatch.setattr(frame_store, "write_text", noted)
        assert add_archive(other, archive) == 4
    assert written.count("train_rgb.txt") == 1
    assert {one.class_names for one in FrameStore(other.folder).all()} == {("shoe",)}


def test_of_an_archive_that_cannot_be_stored_whole_nothing_stays(
    store: FrameStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = FrameStore(tmp_path / "other")
    other.add_frame(frame_at(9.0, brightness=200), "drive")

    def full(path: Path, data: bytes) -> None:
        if path.name == "000003.npy":
            raise StorageFailed(f"{path} cannot be written: No space left on device")
        write_whole(path, data)

    with archive_of(store, "shoe", "bag", "cup") as archive:
        monkeypatch.setattr(staging, "write_whole", full)
        with pytest.raises(StorageFailed, match="No space left"):
            add_archive(other, archive)
    assert [one.id for one in other.all()] == ["000001"] == names_after_a_start(other)
    assert load_dataset(other.folder).count("train") == 1
    assert other.annotation("000001").class_names == ("background",)


def test_the_first_archive_leaves_no_classes_behind_where_it_cannot_be_stored(
    store: FrameStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = FrameStore(tmp_path / "other")

    def full(path: Path, data: bytes) -> None:
        if path.name == "000002.npy":
            raise StorageFailed(f"{path} cannot be written: No space left on device")
        write_whole(path, data)

    with archive_of(store, "shoe", "bag") as archive, monkeypatch.context() as patched:
        patched.setattr(staging, "write_whole", full)
        with pytest.raises(StorageFailed, match="No space left"):
            add_archive(other, archive)
    again = FrameStore(other.folder)
    stored = again.add_frame(frame_at(9.0, brightness=200), "drive")
    assert stored is not None
    assert again.annotation(stored.id).class_names == ("background",)


def test_images_of_one_name_keep_the_splits_that_they_come_from(tmp_path: Path) -> None:
    folder = tmp_path / "of another program"
    writer = DatasetWriter(folder, class_names=["shoe"])
    chosen: tuple[tuple[Split, int], ...] = (("train", 40), ("valid", 200))
    for split, brightness in chosen:
        frame = frame_at(1.0, brightness=brightness)
        depth_mm = np.round(frame.depth_m * 1000).astype(np.uint16)
        writer.add(split, "000001", frame.rgb, depth_mm, block_of("shoe").labels)
    writer.finish()
    store = FrameStore(tmp_path / "frames")
    packed = Path(shutil.make_archive(str(tmp_path / "packed"), "zip", folder))
    with packed.open("rb") as archive:
        assert add_archive(store, archive) == 2
    assert list(store.splits().values()) == ["valid"]


def names_after_a_start(store: FrameStore) -> list[str]:
    """Return the names of the frames that the next start finds."""
    return [one.id for one in FrameStore(store.folder).all()]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_one_export_is_made_at_a_time_and_leaves_nothing_behind(tmp_path: Path) -> None:
    frames = LiveFrames(tmp_path, newest=lambda: frame_at(1.0), class_names=lambda: ["shoe"])
    with pytest.raises(Refused, match="no captured frame"):
        frames.export()
    frames.capture()
    before = sorted(tmp_path.rglob("*"))
    file = frames.export()
    frames.delete("000001")
    with pytest.raises(Refused, match="being exported"):
        frames.export()
    with zipfile.ZipFile(file) as archive:
        assert "train/rgb/000001.png" in archive.namelist() and archive.testzip() is None
    file.close()
    frames.capture()
    frames.export()  # of an answer that was never read
    gc.collect()
    frames.export().close()
    assert len(sorted(tmp_path.rglob("*"))) == len(before)


def test_an_archive_cannot_leave_its_folder(store: FrameStore) -> None:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("train/rgb/../../../x.png", b"")
    with pytest.raises(BadConfiguration, match="expected the files of a data set"):
        add_archive(store, content)


def test_frames_are_captured_while_the_robot_moves_and_only_then(tmp_path: Path) -> None:
    frames = LiveFrames(tmp_path, newest=lambda: None, class_names=lambda: ["shoe"])
    frames.note(frame_at(0.0))
    frames.capture_while_driving(True)
    for x_m, brightness in ((1.0, 120), (1.0, 120), (3.0, 60)):
        frames.note(frame_at(x_m, brightness=brightness))
        while not frames._waiting.empty():
            pass
    frames.close()
    assert [frame.source for frame in frames.all()] == ["drive", "drive"]
    with pytest.raises(Refused, match="no image"):
        frames.capture()
    with pytest.raises(BadConfiguration, match="beware list"):
        frames.annotate("000001", block_of("dragon"))
    assert frames.annotate("000001", block_of("Shoe")).annotated
    known_once = dataclasses.replace(block_of("shoe"), class_names=("shoe", "dragon"))
    assert frames.annotate("000001", known_once).class_names == ("Shoe",), "no pixel is a dragon"


def test_a_capture_that_fails_says_so_and_ends_and_can_begin_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = LiveFrames(tmp_path, newest=lambda: None, class_names=list)

    def broken(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as context:
        context.setattr(frames.store, "add_frame", broken)
        frames.capture_while_driving(True)
        frames.note(frame_at(1.0))
        eventually(lambda: not frames.state().capturing)
    assert "Permission denied" in (frames.state().trouble or "")
    frames.capture_while_driving(True)
    frames.note(frame_at(3.0))
    eventually(lambda: len(frames.all()) == 1)
    frames.close()


def test_the_capture_ends_while_a_frame_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = LiveFrames(tmp_path, newest=lambda: None, class_names=list)
    writing, hung = threading.Event(), threading.Event()

    def slow(*_: object) -> None:
        writing.set()
        hung.wait(10)

    monkeypatch.setattr(frames.store, "add_frame", slow)
    monkeypatch.setattr(live_frames, "JOIN_S", 0.1)
    frames.capture_while_driving(True)
    frames.note(frame_at(1.0))
    assert writing.wait(10)
    frames.note(frame_at(3.0))
    ending = threading.Thread(target=frames.close, daemon=True)
    ending.start()
    ending.join(5)
    assert not ending.is_alive()
    hung.set()


def eventually(holds: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + 10
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)
