"""Captured frames: what is kept, what is refused, and that nothing stored is lost."""

from __future__ import annotations

import dataclasses
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from app.teaching.frames import frame_store
from app.teaching.frames.frame_archive import add_archive, exported
from app.teaching.frames.frame_store import FrameStore
from app.teaching.frames.live_frames import LiveFrames
from app.teaching.frames.rules import CaptureRules
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.learning.data.dataset import load_dataset
from tests.app.teaching.scenes import BLOCK, HEIGHT, WIDTH, frame_at
from web.interface.teaching import Annotation


def block_of(name: str) -> Annotation:
    """Return an annotation of the block alone."""
    labels = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    labels[BLOCK] = 1
    return Annotation(class_names=(name,), labels=labels)


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

    monkeypatch.setattr(frame_store, "write_whole", full)
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
    assert add_archive(other, exported(store)) == 1
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
    with zipfile.ZipFile(io.BytesIO(exported(store))) as old, zipfile.ZipFile(content, "w") as new:
        for name in old.namelist():
            damaged = name.endswith(("000002.png", "dataset.json"))
            data = old.read(name)
            new.writestr(name, change(name, data) if damaged else data)  # type: ignore[operator]
    other = FrameStore(tmp_path / "other")
    for data in (content.getvalue(), content.getvalue()[:-500], b"no archive"):
        with pytest.raises(BadConfiguration) as refused:
            add_archive(other, data)
        assert str(tmp_path) not in str(refused.value)
        said_all = str(refused.value)
    assert "archive" in said_all
    with pytest.raises(BadConfiguration, match=said):
        add_archive(other, content.getvalue())
    assert other.all() == []


def test_an_archive_cannot_leave_its_folder(store: FrameStore) -> None:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("train/rgb/../../../x.png", b"")
    with pytest.raises(BadConfiguration, match="expected the files of a data set"):
        add_archive(store, content.getvalue())


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
