"""Data sets on the disk: what is written is read back, what is damaged or leads astray is refused
by name."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from navcore.errors import BadConfiguration
from navcore.learning.data.card import KINDS
from navcore.learning.data.dataset import DatasetWriter, load_dataset, measure_depth
from navcore.learning.data.images import (
    MAX_SIDE_PX,
    decode_rgb,
    encode_rgb,
    image_size,
    read_labels,
    write_rgb,
)
from tests.navcore.learning.made import NAMES, data_set, sample


def test_what_is_written_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    dataset = data_set(tmp_path / "d", train=3, valid=0, test=2)
    assert (
        len(dataset),
        dataset.count("train"),
        dataset.count("valid"),
        dataset.count("test"),
    ) == (5, 3, 0, 2)
    for index, (split, at) in enumerate(
        [("train", 0), ("train", 1), ("train", 2), ("test", 0), ("test", 1)], start=1
    ):
        assert split in ("train", "test")
        read, made = dataset.read("train" if split == "train" else "test", at), sample(index)
        np.testing.assert_array_equal(read.rgb, made.rgb)
        np.testing.assert_array_equal(read.depth, made.depth)
        np.testing.assert_array_equal(read.labels, made.labels)
    assert dataset.card.class_names == NAMES
    assert dataset.card.sizes == ((64, 64),)
    assert dict(dataset.card.source) == {"made_by": "a test"}
    assert dataset.name("test", 1) == "0001"


def test_what_has_no_colour_is_void_for_all_who_read_it(tmp_path: Path) -> None:
    written = data_set(tmp_path, train=1)
    one, uncoloured = sample(1), np.zeros((64, 64), dtype=np.bool_)
    uncoloured[20:40, 10:50] = True
    path = tmp_path / written.files["train"][0][0]
    path.write_bytes(encode_rgb(one.rgb, uncoloured=uncoloured))
    expected = np.where(uncoloured, 0, one.labels)
    assert np.array_equal(written.read("train", 0).labels, expected)
    assert np.array_equal(written.read_labels("train", 0), expected)


def test_the_statistics_are_those_of_the_measured_pixels_of_the_train_split(tmp_path: Path) -> None:
    dataset = data_set(tmp_path / "d")
    depths = np.stack([dataset.read("train", index).depth for index in range(8)]).astype(np.float64)
    measured = depths[depths > 0]
    assert dataset.card.depth.mean == pytest.approx(measured.mean(), rel=1e-12)
    assert dataset.card.depth.std == pytest.approx(measured.std(), rel=1e-9)
    assert measure_depth(tmp_path / "d", units_per_m=1000.0) == dataset.card.depth


def test_the_lists_are_those_the_official_code_reads(tmp_path: Path) -> None:
    """As src/datasets/sunrgbd there: cv2.imread, np.load, one relative path per line."""
    folder = tmp_path / "d"
    data_set(folder, train=2, valid=0, test=1)
    rgb, depth, labels = (
        (folder / f"train_{kind}.txt").read_text().splitlines()[1] for kind in KINDS
    )
    made = sample(2)
    colours = np.asarray(cv2.imread(str(folder / rgb), cv2.IMREAD_UNCHANGED))
    np.testing.assert_array_equal(colours[..., ::-1], made.rgb)
    np.testing.assert_array_equal(cv2.imread(str(folder / depth), cv2.IMREAD_UNCHANGED), made.depth)
    np.testing.assert_array_equal(np.load(folder / labels), made.labels)


def test_without_a_card_names_and_statistics_must_be_told(tmp_path: Path) -> None:
    told = data_set(tmp_path / "d").card
    (tmp_path / "d" / "dataset.json").unlink()
    with pytest.raises(BadConfiguration, match="class names"):
        load_dataset(tmp_path / "d")
    again = load_dataset(tmp_path / "d", class_names=NAMES, depth=told.depth)
    assert (again.card.class_names, again.card.depth, again.card.counts) == (
        NAMES,
        told.depth,
        told.counts,
    )


def test_jpeg_keeps_the_colours_nearly(tmp_path: Path) -> None:
    smooth = np.tile(np.linspace(0, 255, 64).astype(np.uint8)[:, None, None], (1, 64, 3))
    write_rgb(tmp_path / "a.jpg", smooth, jpeg_quality=95)
    content = (tmp_path / "a.jpg").read_bytes()
    assert image_size(content) == (64, 64)
    assert np.abs(decode_rgb(content, "a").astype(int) - smooth).max() < 10


def test_half_a_data_set_is_none(tmp_path: Path) -> None:
    writer = DatasetWriter(tmp_path / "d", class_names=NAMES)
    one = sample(1)
    writer.add("train", "a", one.rgb, one.depth, one.labels)
    with pytest.raises(BadConfiguration, match="no data set"):
        load_dataset(tmp_path / "d")
    writer.finish()
    assert len(load_dataset(tmp_path / "d")) == 1
    with pytest.raises(BadConfiguration, match="finished"):
        writer.add("train", "b", one.rgb, one.depth, one.labels)


@pytest.mark.parametrize(
    "name", ["", "../a", "a/b", "/a", ".hidden", "a\0b", "ä", "x" * 101, "a\n"]
)
def test_unsafe_names_are_refused(name: str, tmp_path: Path) -> None:
    one = sample(1)
    with pytest.raises(BadConfiguration, match="is no name"):
        DatasetWriter(tmp_path, class_names=NAMES).add(
            "train", name, one.rgb, one.depth, one.labels
        )


def test_the_writer_refuses_what_does_not_fit(tmp_path: Path) -> None:
    writer, one = DatasetWriter(tmp_path, class_names=NAMES), sample(1)
    with pytest.raises(BadConfiguration, match="expected uint8"):
        writer.add("train", "a", one.rgb, one.depth[1:], one.labels)
    with pytest.raises(BadConfiguration, match="expected uint8"):
        writer.add("train", "a", one.rgb, one.depth.astype(np.float32), one.labels)
    with pytest.raises(BadConfiguration, match="label 3 is beyond the 2 classes"):
        writer.add("train", "a", one.rgb, one.depth, np.full_like(one.labels, 3))
    with pytest.raises(BadConfiguration, match="split"):
        writer.add("training", "a", one.rgb, one.depth, one.labels)  # type: ignore[arg-type]
    writer.add("train", "a", one.rgb, one.depth, one.labels)
    with pytest.raises(BadConfiguration, match="already"):
        writer.add("train", "A", one.rgb, one.depth, one.labels)
    with pytest.raises(BadConfiguration, match="not empty"):
        DatasetWriter(tmp_path, class_names=NAMES)


@pytest.mark.parametrize("names", [(), ("a", "A"), ("",), tuple(map(str, range(255)))])
def test_class_names_are_unique_and_not_too_many(names: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(BadConfiguration, match="class names"):
        DatasetWriter(tmp_path, class_names=names)


@pytest.mark.parametrize(
    "path", ["../outside.png", "/etc/passwd", "train/../../x", "", "link.png", "a\0b"]
)
def test_a_list_cannot_lead_out_of_the_folder(path: str, tmp_path: Path) -> None:
    folder = tmp_path / "d"
    data_set(folder, train=1, valid=0, test=0)
    (tmp_path / "outside.png").write_bytes((folder / "train/rgb/0000.png").read_bytes())
    (folder / "link.png").symlink_to(tmp_path / "outside.png")
    (folder / "train_rgb.txt").write_text(f"{path}\n")
    with pytest.raises(BadConfiguration, match=r"inside the folder|leads out of"):
        load_dataset(folder)


def test_lists_that_do_not_match_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "d"
    data_set(folder, train=2, valid=1, test=0)
    whole = (folder / "train_depth.txt").read_text()
    (folder / "train_depth.txt").write_text(whole.splitlines()[0])
    with pytest.raises(BadConfiguration, match=r"\[2, 1, 2\]"):
        load_dataset(folder)
    (folder / "train_depth.txt").write_text(whole)
    (folder / "train/depth/0001.png").unlink()
    with pytest.raises(BadConfiguration, match=r"0001.png: no such file"):
        load_dataset(folder)
    (folder / "valid_label.txt").unlink()
    with pytest.raises(BadConfiguration, match=r"valid_label.txt: no such file"):
        load_dataset(folder)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"counts": {"train": 7, "valid": 3, "test": 2}}, "counts"),
        ({"format": "other"}, "format"),
        ({"surprise": 1}, "unknown key"),
        ({"class_names": ["a", "a"]}, "unique"),
        ({"source": "a text"}, "source"),
    ],
)
def test_a_card_that_does_not_fit_is_refused(
    change: dict[str, object], text: str, tmp_path: Path
) -> None:
    data_set(tmp_path / "d")
    path = tmp_path / "d" / "dataset.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(BadConfiguration, match=text):
        load_dataset(tmp_path / "d")


def test_pictures_that_are_damaged_are_refused_when_they_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "d"
    dataset = data_set(folder, train=1, valid=0, test=0)
    rgb, depth, labels = (folder / path for path in dataset.files["train"][0])
    good = rgb.read_bytes()
    bomb = good[:16] + struct.pack(">II", MAX_SIDE_PX, MAX_SIDE_PX) + good[24:]
    for content, text in ((b"", "neither PNG nor JPEG"), (good[:60], "damaged"), (bomb, "claims")):
        rgb.write_bytes(content)
        with pytest.raises(BadConfiguration, match=text):
            dataset.read("train", 0)
    rgb.write_bytes(good)
    depth.write_bytes(good)
    with pytest.raises(BadConfiguration, match="16-bit"):
        dataset.read("train", 0)
    np.save(labels, np.full((64, 64), 3, dtype=np.uint8))
    with pytest.raises(BadConfiguration, match="label 3"):
        dataset.read_labels("train", 0)


def test_labels_are_never_unpickled_and_never_believed_to_be_huge(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.array([[{}]], dtype=object), allow_pickle=True)
    with pytest.raises(BadConfiguration, match="whole numbers"):
        read_labels(path)
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(
            file, {"descr": "|u1", "fortran_order": False, "shape": (10**9, 10**9)}
        )
    with pytest.raises(BadConfiguration, match="whole numbers"):
        read_labels(path)
    np.save(path, np.array([[300]], dtype=np.int64))
    with pytest.raises(BadConfiguration, match="from 300"):
        read_labels(path)
    path.write_bytes(b"\x93NUMPY")
    with pytest.raises(BadConfiguration, match="cannot be read"):
        read_labels(path)


def test_depth_without_spread_is_no_depth(tmp_path: Path) -> None:
    writer, one = DatasetWriter(tmp_path, class_names=NAMES), sample(1)
    writer.add("train", "a", one.rgb, np.zeros_like(one.depth), one.labels)
    with pytest.raises(BadConfiguration, match="no spread"):
        writer.finish()
