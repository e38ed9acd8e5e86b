"""Frames that come together are all there or none, and hold up nothing while they are written."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.teaching.frames.frame_store import FrameStore, Upload
from navcore.errors import BadConfiguration
from navcore.learning.data.dataset import load_dataset
from tests.app.teaching.scenes import frame_at
from tests.app.teaching.test_frame_store import block_of, names_after_a_start, upload


@pytest.fixture
def store(tmp_path: Path) -> FrameStore:
    """A folder with one frame."""
    store = FrameStore(tmp_path / "frames")
    store.add_frame(frame_at(1.0), "drive")
    return store


def shoes(store: FrameStore) -> list[Upload]:
    """Return three uploaded images in which a shoe is annotated."""
    return [upload(*store.images("000001")) for _ in range(3)]


def meanwhile(store: FrameStore, uploads: list[Upload]) -> Iterator[Upload]:
    """Yield uploads; once one is written, another thread annotates and captures."""

    def use() -> None:
        store.annotate("000001", block_of("bag"))
        store.add_frame(frame_at(5.0, brightness=40), "drive")

    for number, one in enumerate(uploads):
        if number == 1:
            thread = threading.Thread(target=use, daemon=True)
            thread.start()
            thread.join(30.0)
            assert not thread.is_alive(), "the folder is locked"
            assert [shown.source for shown in store.all()] == ["drive", "drive"]
        yield one


def test_an_import_holds_up_neither_marks_nor_captures(store: FrameStore) -> None:
    assert store.add_uploads(meanwhile(store, shoes(store))) == 3
    shown = store.all()
    assert [one.id for one in shown] == [f"{number:06d}" for number in range(1, 6)]
    assert [one.source for one in shown] == ["drive", "upload", "drive", "upload", "upload"]
    assert [one.class_names for one in shown if one.source == "upload"] == [("shoe",)] * 3
    assert shown[0].class_names == ("bag",)
    assert FrameStore(store.folder).all() == shown
    assert load_dataset(store.folder).count("train") == 5


def test_of_an_import_that_fails_nothing_stays_but_what_came_meanwhile(store: FrameStore) -> None:
    wrong = upload(frame_at(1.0).rgb[:5], store.images("000001")[1][:5])
    with pytest.raises(BadConfiguration, match="pixels"):
        store.add_uploads(meanwhile(store, [*shoes(store), wrong]))
    assert [one.id for one in store.all()] == ["000001", "000003"] == names_after_a_start(store)
    assert store.annotation("000001").class_names == ("background", "shoe", "bag")
    assert not list(store.folder.glob("*/*/*2.*")) and not list(store.folder.glob(".staged-*"))


def test_of_an_import_that_a_crash_cuts_off_nothing_stays(
    store: FrameStore, tmp_path: Path
) -> None:
    def crashing() -> Iterator[Upload]:
        yield from shoes(store)
        shutil.copytree(store.folder, tmp_path / "crashed")

    store.add_uploads(crashing())
    (tmp_path / "crashed/.import-x/train").mkdir(parents=True)
    assert list((tmp_path / "crashed").glob(".staged-*/train/camera/*.json"))
    after = FrameStore(tmp_path / "crashed")
    assert [one.id for one in after.all()] == ["000001"]
    assert after.annotation("000001").class_names == ("background",)
    left = [path for path in after.folder.rglob("*") if path.is_file()]
    assert not [
        path for path in left if path.stem not in ("000001", "dataset") and path.suffix != ".txt"
    ]
    assert not list(after.folder.glob(".*"))


@pytest.mark.parametrize("moved", range(12))
def test_an_import_that_a_crash_cuts_off_while_it_is_moved_in_is_completed(
    store: FrameStore, tmp_path: Path, moved: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    replaced, replace = list[Path](), Path.replace

    def noted(path: Path, target: Path) -> Path:
        if ".staged-" in str(path) and not path.name.startswith("."):
            if len(replaced) == moved:
                shutil.copytree(store.folder, tmp_path / "crashed")
            replaced.append(path)
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", noted)
    store.add_uploads(shoes(store))
    assert len(replaced) == 12
    monkeypatch.undo()
    after = FrameStore(tmp_path / "crashed")
    assert after.all() == store.all()
    assert not list(after.folder.glob(".*"))
    assert after.annotate("000002", block_of("shoe")).class_names == ("shoe",)
    assert load_dataset(after.folder).count("train") == 4
