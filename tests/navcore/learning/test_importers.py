"""Imports: what people drew in CVAT and labelme comes out as labels; archives and paths that mean
harm are refused."""

from __future__ import annotations

import base64
import json
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from navcore.errors import BadConfiguration
from navcore.learning.data import importers as imports
from navcore.learning.data import zip_archive
from navcore.learning.data.images import write_grey, write_rgb
from navcore.learning.data.importers import CvatArchive, LabelmeFolder
from navcore.learning.data.writer import DatasetWriter
from tests.damaged_zip import METHODS, with_damaged_entry

LABELMAP = "# label:color_rgb:parts:actions\nbackground:0,0,0::\nbook:200,10,20::\ncup:0,90,0::\n"
RGB = np.full((20, 30, 3), 77, dtype=np.uint8)
DEPTH = np.arange(600, dtype=np.uint16).reshape(20, 30) + 1000


def png(rgb: npt.NDArray[np.uint8]) -> bytes:
    return cv2.imencode(".png", np.ascontiguousarray(rgb[..., ::-1]))[1].tobytes()


def mask() -> npt.NDArray[np.uint8]:
    drawn = np.zeros((20, 30, 3), dtype=np.uint8)
    drawn[2:6, 3:9] = (200, 10, 20)
    drawn[10:12, 20:25] = (0, 90, 0)
    return drawn


def archive(path: Path, **changes: bytes | None) -> Path:
    """A small CVAT export; entries can be replaced or left out, `__` standing for `/`."""
    entries: dict[str, bytes | None] = {
        "labelmap.txt": LABELMAP.encode(),
        "SegmentationClass/room/a.png": png(mask()),
        "JPEGImages/room/a.png": png(RGB),
        "ImageSets/Segmentation/val.txt": b"room/a\n",
    }
    replaced = {
        key.replace("__", "/").replace("_dot_", "."): value for key, value in changes.items()
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in {**entries, **replaced}.items():
            if content is not None:
                file.writestr(name, content)
    return path


@pytest.fixture
def depth_dir(tmp_path: Path) -> Path:
    folder = tmp_path / "depth"
    folder.mkdir()
    write_grey(folder / "a.png", DEPTH)
    return folder


def test_cvat_masks_become_labels(tmp_path: Path, depth_dir: Path) -> None:
    source = CvatArchive(archive(tmp_path / "a.zip"), depth_dir=depth_dir)
    assert source.class_names == ("book", "cup")
    (one,) = source
    assert (one.split, one.name) == ("valid", "room_a")
    np.testing.assert_array_equal(one.sample.rgb, RGB)
    np.testing.assert_array_equal(one.sample.depth, DEPTH)
    expected = np.zeros((20, 30), dtype=np.uint8)
    expected[2:6, 3:9], expected[10:12, 20:25] = 1, 2
    np.testing.assert_array_equal(one.sample.labels, expected)


def test_the_background_of_cvat_can_be_a_class(tmp_path: Path, depth_dir: Path) -> None:
    source = CvatArchive(archive(tmp_path / "a.zip"), depth_dir=depth_dir, keep_background=True)
    assert source.class_names == ("background", "book", "cup")
    (one,) = source
    assert one.sample.labels.min() == 1
    assert one.sample.labels[3, 4] == 2


def test_a_name_for_void_is_no_class_where_the_background_is_one(
    tmp_path: Path, depth_dir: Path
) -> None:
    labelmap = LABELMAP + "void:9,9,9::\nunlabeled:8,8,8::\n__ignore__:7,7,7::\n"
    drawn = mask()
    drawn[0] = (9, 9, 9)
    path = archive(
        tmp_path / "a.zip",
        labelmap_dot_txt=labelmap.encode(),
        SegmentationClass__room__a_dot_png=png(drawn),
    )
    source = CvatArchive(path, depth_dir=depth_dir, keep_background=True)
    assert source.class_names == ("background", "book", "cup")
    (one,) = source
    assert (one.sample.labels[0] == 0).all() and (one.sample.labels[1] == 1).all()


def test_of_two_images_of_one_name_none_gets_the_depth_of_the_other(
    tmp_path: Path, depth_dir: Path
) -> None:
    path = archive(
        tmp_path / "a.zip",
        SegmentationClass__hall__a_dot_png=png(mask()),
        JPEGImages__hall__a_dot_png=png(RGB),
    )
    with pytest.raises(BadConfiguration, match="with its folder: another image"):
        list(CvatArchive(path, depth_dir=depth_dir))
    for place, shift in (("hall", 0), ("room", 500)):
        (depth_dir / place).mkdir()
        write_grey(depth_dir / place / "a.png", DEPTH + np.uint16(shift))
    hall, room = CvatArchive(path, depth_dir=depth_dir)
    np.testing.assert_array_equal(hall.sample.depth, DEPTH)
    np.testing.assert_array_equal(room.sample.depth, DEPTH + 500)


def test_cvat_pictures_may_lie_elsewhere(tmp_path: Path, depth_dir: Path) -> None:
    bare = archive(tmp_path / "a.zip", JPEGImages__room__a_dot_png=None)
    with pytest.raises(BadConfiguration, match="export with images"):
        list(CvatArchive(bare, depth_dir=depth_dir))
    (tmp_path / "rgb").mkdir()
    write_rgb(tmp_path / "rgb" / "a.png", RGB)
    (one,) = CvatArchive(bare, depth_dir=depth_dir, rgb_dir=tmp_path / "rgb")
    np.testing.assert_array_equal(one.sample.rgb, RGB)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"labelmap_dot_txt": None}, "labelmap.txt is missing"),
        ({"labelmap_dot_txt": b"book:1,2\n"}, "expected name:r,g,b"),
        ({"labelmap_dot_txt": b"book:1,2,300::\n"}, "expected name:r,g,b"),
        ({"labelmap_dot_txt": b"book:1,2,3::\ncup:1,2,3::\n"}, "two labels one colour"),
        ({"labelmap_dot_txt": b"\xff\xfe"}, "not UTF-8"),
        ({"labelmap_dot_txt": b"background:0,0,0::\n"}, "names 0 classes"),
        (
            {"labelmap_dot_txt": b"background:0,0,0::\nbook:200,10,20::\n"},
            "colour 0,90,0 is not in labelmap.txt",
        ),
        ({"SegmentationClass__room__a_dot_png": None}, "no mask"),
        ({"SegmentationClass__room__a_dot_png": b"text"}, "neither PNG nor JPEG"),
        ({"JPEGImages__room__a_dot_png": png(RGB[1:])}, "sizes differ"),
        ({"..__a": b""}, "expected a path inside"),
        ({"__etc__a": b""}, "expected a path inside"),
        ({"a\\b": b""}, "expected a path inside"),
        ({"SegmentationClass__room__b_dot_png": png(mask())}, "export with images"),
    ],
)
def test_archives_that_do_not_fit_are_refused_by_name(
    changes: Mapping[str, bytes | None], text: str, tmp_path: Path, depth_dir: Path
) -> None:
    with pytest.raises(BadConfiguration, match=text) as refused:
        list(CvatArchive(archive(tmp_path / "a.zip", **changes), depth_dir=depth_dir))
    assert "a.zip" in str(refused.value)


def test_what_unpacks_to_too_much_is_refused(
    tmp_path: Path, depth_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(imports, "MAX_FILE_BYTES", 10_000)
    bomb = archive(tmp_path / "a.zip", SegmentationClass__room__a_dot_png=b"\0" * 1_000_000)
    assert bomb.stat().st_size < 10_000
    with pytest.raises(BadConfiguration, match="unpacks to more than"):
        list(CvatArchive(bomb, depth_dir=depth_dir))
    monkeypatch.setattr(zip_archive, "MAX_ENTRIES", 3)
    with pytest.raises(BadConfiguration, match="4 entries"):
        CvatArchive(archive(tmp_path / "b.zip"), depth_dir=depth_dir)


def test_a_damaged_archive_or_a_missing_depth_is_refused(tmp_path: Path, depth_dir: Path) -> None:
    (tmp_path / "no.zip").write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(BadConfiguration, match="not readable as a zip"):
        CvatArchive(tmp_path / "no.zip", depth_dir=depth_dir)
    (depth_dir / "a.png").unlink()
    with pytest.raises(BadConfiguration, match="no file for image 'room/a'"):
        list(CvatArchive(archive(tmp_path / "a.zip"), depth_dir=depth_dir))


@pytest.mark.parametrize("method", METHODS)
def test_a_damaged_stream_of_any_compression_is_refused_in_words(
    method: int, tmp_path: Path, depth_dir: Path
) -> None:
    path = archive(tmp_path / "a.zip")
    damaged = with_damaged_entry(path.read_bytes(), "JPEGImages/room/a.png", method)
    path.write_bytes(damaged)
    with pytest.raises(BadConfiguration, match=r"a\.zip: JPEGImages/room/a\.png is damaged"):
        list(CvatArchive(path, depth_dir=depth_dir))


def labelme(folder: Path, **changes: object) -> Path:
    document = {
        "shapes": [
            {
                "label": "cup",
                "points": [[4.0, 2.0], [9.0, 2.0], [9.0, 8.0], [4.0, 8.0]],
                "shape_type": "polygon",
            },
            {"label": "book", "points": [[12, 3], [18, 9]], "shape_type": "rectangle"},
            {"label": "book", "points": [[6, 4], [7, 4], [7, 5]]},
        ],
        "imagePath": "a.png",
        "imageData": None,
    }
    folder.mkdir(exist_ok=True)
    write_rgb(folder / "a.png", RGB)
    write_grey(folder / "a.depth.png", DEPTH)
    (folder / "a.json").write_text(json.dumps({**document, **changes}))
    return folder


@pytest.mark.parametrize("inside", [False, True])
def test_labelme_polygons_become_labels(inside: bool, tmp_path: Path) -> None:
    changes: dict[str, object] = {}
    if inside:
        changes = {"imageData": base64.b64encode(png(RGB)).decode(), "imagePath": "../nowhere.png"}
    folder = labelme(tmp_path / "l", **changes)
    if inside:
        (folder / "a.png").unlink()
    source = LabelmeFolder(folder, depth_dir=folder)
    assert source.class_names == ("book", "cup")
    (one,) = source
    labels = one.sample.labels
    np.testing.assert_array_equal(one.sample.rgb, RGB)
    assert (labels[2:9, 4:6] == 2).all()
    assert labels[4, 6] == 1, "later shapes lie over earlier ones"
    assert (labels[3:10, 12:19] == 1).all()
    assert (labels[12:] == 0).all()


def test_what_nobody_drew_on_can_be_a_class_in_labelme_too_and_a_drawn_background_is_one(
    tmp_path: Path,
) -> None:
    folder = labelme(tmp_path / "l")
    source = LabelmeFolder(folder, depth_dir=folder, keep_background=True)
    assert source.class_names == ("background", "book", "cup")
    (one,) = source
    assert (one.sample.labels[3, 4], one.sample.labels[4, 14], one.sample.labels[15, 0]) == (
        3,
        2,
        1,
    )
    shape = {"label": "background", "points": [[0, 12], [20, 19]], "shape_type": "rectangle"}
    drawn = labelme(tmp_path / "m", shapes=[shape])
    first = LabelmeFolder(
        labelme(tmp_path / "n", shapes=[shape, {**shape, "label": "apple"}]),
        depth_dir=folder,
        keep_background=True,
    )
    assert first.class_names == ("background", "apple")
    (one,) = LabelmeFolder(drawn, depth_dir=drawn, class_names=("cup", "background"))
    assert (one.sample.labels[15, 2], one.sample.labels[2, 2]) == (2, 0)


def test_images_keep_apart_whose_names_become_the_same(tmp_path: Path) -> None:
    folder, longest = labelme(tmp_path / "l"), "n" * 100
    for name in ("कप", "किताब", "b c", "b_c", "B_c", f"{longest}1", f"{longest}2"):
        shutil.copy(folder / "a.json", folder / f"{name}.json")
        shutil.copy(folder / "a.depth.png", folder / f"{name}.depth.png")
    names = [image.name for image in LabelmeFolder(folder, depth_dir=folder)]
    assert len({name.casefold() for name in names}) == 8 and "a" in names
    writer = DatasetWriter(tmp_path / "out", class_names=("book",))
    for name in names:
        writer.add("train", name, RGB, DEPTH, np.ones(DEPTH.shape, dtype=np.uint8))
    assert writer.finish().counts.train == 8


def test_the_classes_of_labelme_can_be_told(tmp_path: Path) -> None:
    folder = labelme(tmp_path / "l")
    source = LabelmeFolder(
        folder, depth_dir=folder, class_names=("background", "cup", "book"), split="test"
    )
    (one,) = source
    assert (one.split, one.sample.labels[2, 4], one.sample.labels[4, 14]) == ("test", 2, 3)
    with pytest.raises(BadConfiguration, match="book"):
        LabelmeFolder(folder, depth_dir=folder, class_names=("cup",))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"imagePath": "../a.png"}, "expected a path inside"),
        ({"imagePath": "/etc/passwd"}, "expected a path inside"),
        ({"imagePath": None}, "neither imageData nor imagePath"),
        ({"imageData": "!!"}, "not base64"),
        ({"imageData": "AAAA"}, "neither PNG nor JPEG"),
        ({"shapes": "x"}, "expected `shapes`"),
        ({"shapes": [{"label": "a", "points": [[0, 0], [1, 1]]}]}, "expected a polygon"),
        ({"shapes": [{"label": "a", "points": [[0, 0], [1, 1], [1e9, 0]]}]}, "expected a polygon"),
        ({"shapes": [{"label": "a", "points": [[0, 0], [1, "x"], [2, 0]]}]}, "expected a polygon"),
        (
            {"shapes": [{"label": "a", "points": [[0, 0], [5, 5]], "shape_type": "circle"}]},
            "'circle'",
        ),
    ],
)
def test_labelme_files_that_do_not_fit_are_refused_by_name(
    changes: dict[str, object], text: str, tmp_path: Path
) -> None:
    folder = labelme(tmp_path / "l", **changes)
    with pytest.raises(BadConfiguration, match=text) as refused:
        list(LabelmeFolder(folder, depth_dir=folder))
    assert "a.json" in str(refused.value)
