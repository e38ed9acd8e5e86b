"""A detected object has one entry; an operator's corrections become a data set for training."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.insight.detections import DetectionGallery, StoredView, packed, unpacked
from app.insight.labelling import LabellingFolder, region_in
from navcore.errors import BadConfiguration, NotKnown, Refused, StorageFailed
from navcore.geometry.camera import Intrinsics
from navcore.geometry.transform import STANDSTILL, Pose2, camera_mount
from navcore.learning.data.card import CARD_NAME
from navcore.learning.data.dataset import load_dataset
from navcore.learning.data.images import read_labels
from navcore.learning.data.writer import write_text
from navcore.mission.beware_list import BewareClass, BewareList
from navcore.perception.labels import Labels, only_coloured
from navcore.robot.frame import Frame
from web.interface.insight import Sighting

BEWARE = BewareList(
    classes=(
        BewareClass(name="cup", class_id=3),
        BewareClass(name="toy", class_id=40),
        BewareClass(name="person", class_id=11),
    )
)
LENS = Intrinsics(width=160, height=120, fx=100.0, fy=100.0, cx=80.0, cy=60.0)
MOUNT = camera_mount(x_m=0.0, y_m=0.0, z_m=0.8, pitch_down_rad=0.6)
CUP, PERSON = 3, 11


def picture(x_m: float = 0.0, yaw_rad: float = 0.0) -> Frame:
    """The camera over an even floor; the depth of each pixel is that of the floor."""
    rays = np.stack(np.meshgrid((np.arange(160) - 80) / 100, (np.arange(120) - 60) / 100), axis=-1)
    down = MOUNT[2, 0] * rays[..., 0] + MOUNT[2, 1] * rays[..., 1] + MOUNT[2, 2]
    depth = np.where(down < -0.05, -MOUNT[2, 3] / np.minimum(down, -0.05), 0.0)
    rgb = np.full((120, 160, 3), 90, dtype=np.uint8)
    rgb[..., 2] = np.arange(160, dtype=np.uint8)
    pose = Pose2(x_m=x_m, y_m=0.0, yaw_rad=yaw_rad)
    return Frame(
        stamp_ns=1,
        rgb=rgb,
        depth_m=depth.astype(np.float32),
        intrinsics=LENS,
        T_base_camera=MOUNT,
        pose=pose,
        twist=STANDSTILL,
    )


def labels(
    frame: Frame, x_m: float, y_m: float, *, class_id: int = CUP, sure: float = 0.9
) -> Labels:
    """Label everything within 12 cm of a position on the floor with a class."""
    rows, cols = np.indices(frame.depth_m.shape)
    rays = (
        np.stack([(cols - 80) / 100, (rows - 60) / 100, np.ones(rows.shape)], axis=-1)
        * frame.depth_m[..., None]
    )
    xy = rays @ frame.T_map_camera[:2, :3].T + frame.T_map_camera[:2, 3]
    near = (np.hypot(xy[..., 0] - x_m, xy[..., 1] - y_m) < 0.12) & (frame.depth_m > 0)
    ids = np.where(near, np.uint8(class_id), np.uint8(0))
    return Labels(class_ids=ids, confidence=np.full(ids.shape, sure, dtype=np.float32))


def look(gallery: DetectionGallery, now_s: float, frame: Frame, seen: Labels) -> list[Sighting]:
    return gallery.update(now_s, frame, seen, BEWARE, moves=gallery.moves)


def test_an_object_has_one_entry_however_often_and_from_wherever_it_is_seen() -> None:
    gallery, new = DetectionGallery(), []
    for step, (x_m, yaw) in enumerate([(0.0, 0.0), (0.1, 0.05), (0.3, -0.1), (0.4, 0.0)]):
        frame = picture(x_m, yaw)
        new += look(gallery, float(step), frame, labels(frame, 1.5, 0.2))
    assert [(one.class_name, one.looks) for one in new] == [("cup", 1)]
    only = gallery.all()[0]
    assert only.looks == 4 and math.dist(only.place, (1.5, 0.2)) < 0.05 and only.last_s == 3.0
    frame = picture()
    assert len(look(gallery, 9.0, frame, labels(frame, 1.2, -0.5))) == 1
    assert [one.id for one in gallery.all()] == [2, 1]
    assert gallery.crop(1).startswith(b"\xff\xd8")
    with pytest.raises(NotKnown):
        gallery.crop(99)

    # A correction of the map takes along what was seen beside the poses that it moves.
    def poses(y_m: float) -> list[Pose2]:
        return [Pose2(x_m=x, y_m=y_m if x < 3 else 0.0, yaw_rad=0.0) for x in (0.0, 9.0)]

    gallery.follow(poses(0.0), poses(0.5))
    assert math.dist(gallery.all()[1].place, (1.5, 0.7)) < 0.05
    assert np.abs(gallery.extent(1).points.mean(axis=0) - (1.5, 0.7)).max() < 0.1
    gallery.follow(poses(0.5), poses(0.0))
    assert math.dist(gallery.all()[1].place, (1.5, 0.2)) < 0.05
    # At another site a page that still shows the first two must not meet others of their ids.
    gallery.clear()
    assert gallery.all() == ()
    look(gallery, 10.0, frame, labels(frame, 1.5, 0.2))
    assert [one.id for one in gallery.all()] == [3]


def test_a_frame_from_before_the_gallery_was_cleared_adds_nothing() -> None:
    gallery, frame = DetectionGallery(), picture()
    moves = gallery.moves
    gallery.clear()
    assert gallery.update(0.0, frame, labels(frame, 1.5, 0.0), BEWARE, moves=moves) == []
    assert gallery.all() == ()


def test_the_frame_of_many_new_objects_is_compressed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    gallery, frame, packings = DetectionGallery(), picture(), list[int]()

    def counted(*parts: Any) -> StoredView:
        packings.append(1)
        return packed(*parts)

    monkeypatch.setattr("app.insight.detections.packed", counted)
    one, other = labels(frame, 1.5, 0.4), labels(frame, 1.5, -0.4)
    both = Labels(class_ids=one.class_ids | other.class_ids, confidence=one.confidence)
    assert len(look(gallery, 0.0, frame, both)) == 2 and packings == [1]
    shown = [unpacked(gallery.view(one.id).mask_png) > 0 for one in gallery.all()]
    assert shown[0].any() and shown[1].any() and not (shown[0] & shown[1]).any()
    # Nearer by, what was rejected has a better view, which is not kept.
    for entry in gallery.all():
        gallery.mark(entry.id, "rejected")
    near = picture(0.7)
    look(gallery, 1.0, near, labels(near, 1.5, 0.4))
    assert packings == [1] and len(gallery.all()) == 2


def test_only_so_many_whole_views_are_kept_and_the_others_say_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("app.insight.detections.MAX_VIEWS", 1)
    gallery, far, near = DetectionGallery(), picture(-0.4), picture()
    look(gallery, 0.0, far, labels(far, 1.5, 0.4))
    look(gallery, 1.0, far, labels(far, 1.5, -0.4))
    assert [one.has_image for one in gallery.all()] == [True, False]
    with pytest.raises(NotKnown, match="no longer kept"):
        gallery.view(1)
    # A better look brings back the view of the one, and the other's has to go.
    look(gallery, 2.0, near, labels(near, 1.5, 0.4))
    assert [one.has_image for one in gallery.all()] == [False, True]
    assert gallery.view(1)


def test_people_and_uncertain_detections_have_no_entry() -> None:
    gallery, frame = DetectionGallery(), picture()
    assert look(gallery, 0.0, frame, labels(frame, 1.5, 0.0, class_id=PERSON)) == []
    assert look(gallery, 0.0, frame, labels(frame, 1.5, 0.0, sure=0.3)) == []


def test_a_correction_becomes_a_data_set_that_can_be_read_and_grows_after_a_restart(
    tmp_path: Path,
) -> None:
    frame = picture()
    seen = labels(frame, 1.5, 0.0)
    mask = seen.class_ids == CUP
    names = {entry.class_id: entry.name for entry in BEWARE.classes}
    folder = LabellingFolder(tmp_path / "labelling")
    folder.add(packed(frame, seen, BEWARE, mask), names=names, said=None)
    folder.add(packed(frame, seen, BEWARE, mask), names=names, said="toy")
    # A crash leaves an image incomplete, and the lists behind the card.
    (tmp_path / "labelling" / "train" / "label" / "half.npy").write_bytes(b"\x93NUMPY")
    again = LabellingFolder(tmp_path / "labelling")
    again.add(packed(frame, seen, BEWARE, mask), names=names, said="cup")
    stored = load_dataset(tmp_path / "labelling")
    assert again.state().pictures == stored.count("train") == 3
    said = []
    for index in range(3):
        sample = stored.read("train", index)
        assert (sample.rgb == frame.rgb).all() and abs(
            sample.depth.max() / 1000 - frame.depth_m.max()
        ) < 0.01
        value = int(np.unique(sample.labels[mask])[0])
        said.append(stored.card.class_names[value - 1])
        rim = sample.labels[~mask]
        assert (rim == 0).any() and (rim == stored.card.class_names.index("background") + 1).any()
    assert sorted(said) == ["background", "cup", "toy"]


def test_what_is_no_class_of_the_list_any_more_is_no_background(tmp_path: Path) -> None:
    frame = picture()
    cup, toy = labels(frame, 1.5, 0.4), labels(frame, 1.5, -0.4, class_id=40)
    seen = Labels(class_ids=cup.class_ids | toy.class_ids, confidence=cup.confidence)
    view = packed(frame, seen, BEWARE, cup.class_ids > 0)
    LabellingFolder(tmp_path).add(view, names={CUP: "cup"}, said="cup")
    learned = load_dataset(tmp_path).read("train", 0).labels
    assert set(np.unique(learned[toy.class_ids > 0])) == {0}, "void"
    assert 0 not in learned[0], "background"


def test_what_the_network_calls_a_class_that_left_the_list_is_no_background(tmp_path: Path) -> None:
    frame = picture()
    cup = labels(frame, 1.5, 0.4)
    bottle = labels(frame, 1.5, -0.4).class_ids > 0
    view = packed(frame, dataclasses.replace(cup, unlisted=bottle), BEWARE, cup.class_ids > 0)
    LabellingFolder(tmp_path).add(view, names={CUP: "cup"}, said=None)
    learned = load_dataset(tmp_path).read("train", 0).labels
    assert set(np.unique(learned[bottle])) == {0}, "void"
    assert 0 not in learned[0], "background"


def test_pixels_without_colour_or_with_little_confidence_are_no_background(tmp_path: Path) -> None:
    frame, dark = picture(), np.zeros((120, 160), dtype=np.bool_)
    dark[:, :40] = True
    frame = dataclasses.replace(
        frame, rgb=np.where(dark[..., None], np.uint8(0), frame.rgb), uncoloured=dark
    )
    seen = only_coloured(labels(frame, 1.5, 0.0), frame)
    seen.confidence[:, 140:] = 0.3
    # The operator's box reaches into what has no colour.
    mask = np.zeros((120, 160), dtype=np.bool_)
    mask[50:70, 30:60] = True
    LabellingFolder(tmp_path).add(packed(frame, seen, BEWARE, mask), names={CUP: "cup"}, said="cup")
    sample = load_dataset(tmp_path).read("train", 0)
    assert sample.uncoloured is not None and np.array_equal(sample.uncoloured, dark)
    stored = read_labels(next(tmp_path.glob("train/label/*.npy")))
    assert set(np.unique(stored[:, :40])) == set(np.unique(stored[:, 140:])) == {0}, "void"
    assert 0 not in stored[0, 40:140], "background"


def test_a_capital_letter_makes_no_other_class_of_a_name(tmp_path: Path) -> None:
    frame = picture()
    seen = labels(frame, 1.5, 0.0)
    mask = seen.class_ids == CUP
    folder = LabellingFolder(tmp_path)
    folder.add(packed(frame, seen, BEWARE, mask), names={CUP: "Cup"}, said="CUP")
    stored = load_dataset(tmp_path)
    (value,) = np.unique(stored.read("train", 0).labels[mask])
    assert stored.card.class_names[value - 1] == "cup"


def test_a_disk_that_fills_up_over_a_new_class_gives_its_number_to_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = picture()
    seen = labels(frame, 1.5, 0.0)
    mask = seen.class_ids == CUP
    view = packed(frame, seen, BEWARE, mask)
    LabellingFolder(tmp_path).add(view, names={CUP: "cup"}, said="cup")
    for most in range(8):  # number of texts written before the disk is full
        count = itertools.count()

        def filling(path: Path, text: str, count: Iterator[int] = count, most: int = most) -> None:
            if next(count) >= most:
                raise StorageFailed("the disk is full")
            write_text(path, text)

        with monkeypatch.context() as full:
            full.setattr("app.insight.labelling.write_text", filling)
            with contextlib.suppress(StorageFailed):
                LabellingFolder(tmp_path).add(view, names={CUP: "cup"}, said="shoe")
        LabellingFolder(tmp_path).add(view, names={CUP: "cup"}, said="bag")
    stored = load_dataset(tmp_path)
    said = [
        np.unique(stored.read("train", index).labels[mask]).item()
        for index in range(stored.count("train"))
    ]
    names = [stored.card.class_names[value - 1] for value in said]
    assert (names.count("cup"), names.count("bag")) == (1, 8)
    assert set(names) <= {"cup", "bag", "shoe"}


def test_a_folder_whose_images_were_all_lost_takes_new_ones(tmp_path: Path) -> None:
    frame = picture()
    seen = labels(frame, 1.5, 0.0)
    view = packed(frame, seen, BEWARE, seen.class_ids == CUP)
    LabellingFolder(tmp_path).add(view, names={CUP: "cup"}, said="cup")
    for label in tmp_path.glob("train/label/*.npy"):
        label.unlink()
    again = LabellingFolder(tmp_path)
    again.add(view, names={CUP: "cup"}, said="shoe")
    assert again.state().pictures == load_dataset(tmp_path).count("train") == 1


def test_a_full_folder_takes_no_more_and_says_so(tmp_path: Path) -> None:
    frame = picture()
    seen = labels(frame, 1.5, 0.0)
    view = packed(frame, seen, BEWARE, seen.class_ids == CUP)
    folder = LabellingFolder(tmp_path, max_pictures=1)
    folder.add(view, names={CUP: "cup"}, said="cup")
    with pytest.raises(Refused, match="is full"):
        folder.add(view, names={CUP: "cup"}, said="cup")
    assert folder.state().pictures == 1


def test_a_full_folder_that_was_moved_away_begins_again(tmp_path: Path) -> None:
    frame = picture()
    seen = labels(frame, 1.5, 0.0)
    view = packed(frame, seen, BEWARE, seen.class_ids == CUP)
    folder = LabellingFolder(tmp_path / "labelling", max_pictures=1)
    folder.add(view, names={CUP: "cup"}, said="shoe")
    folder.folder.rename(tmp_path / "moved")
    assert folder.state().pictures == 0
    folder.add(view, names={CUP: "cup"}, said="cup")
    again, before = load_dataset(folder.folder), load_dataset(tmp_path / "moved")
    assert again.count("train") == before.count("train") == 1
    assert "shoe" in before.card.class_names and "shoe" not in again.card.class_names


def test_the_foreground_of_a_box_is_extracted_and_a_bad_box_is_refused() -> None:
    rgb = np.full((120, 160, 3), 60, dtype=np.uint8)
    rgb[40:70, 50:90] = (230, 200, 30)
    found = region_in(rgb, (40, 30, 100, 80))
    truth = np.zeros((120, 160), dtype=np.bool_)
    truth[40:70, 50:90] = True
    assert (found & truth).sum() / (found | truth).sum() > 0.9
    for box in ((0, 0, 161, 50), (50, 50, 50, 80), (10, 10, 13, 60), (-1, 0, 20, 20)):
        with pytest.raises(BadConfiguration, match="box"):
            region_in(rgb, box)


def test_the_state_of_the_folder_writes_nothing_and_later_lists_contain_every_image_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = picture()
    seen = labels(frame, 1.5, 0.0)
    for said in ("cup", "toy", None):
        view = packed(frame, seen, BEWARE, seen.class_ids == CUP)
        LabellingFolder(tmp_path).add(view, names={CUP: "cup"}, said=said)
    again = LabellingFolder(tmp_path)

    def full(*_: object) -> None:
        raise StorageFailed("the disk is full")

    with monkeypatch.context() as refusing:
        refusing.setattr("app.insight.labelling.write_text", full)
        assert again.state().pictures == 3
        with pytest.raises(StorageFailed):
            again.add(view, names={CUP: "cup"}, said="cup")
    again.add(view, names={CUP: "cup"}, said="cup")
    assert again.state().pictures == 4
    assert len((tmp_path / "train_rgb.txt").read_text().splitlines()) == 4
    (tmp_path / CARD_NAME).write_text("{ no card")
    with pytest.raises(StorageFailed, match="cannot be read"):
        LabellingFolder(tmp_path).state()
