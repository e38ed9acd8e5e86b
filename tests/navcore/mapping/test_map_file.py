"""Map files: a map is read bit by bit as it was written and continues as before; damage is
refused."""

from __future__ import annotations

import dataclasses
import io
import json
import logging
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.errors import BadConfiguration, StorageFailed
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.mapping.map_file import check_classes, load, save
from navcore.mapping.map_state import MapState
from navcore.mapping.point_table import MapPoints
from navcore.mission.beware_list import BewareClass, BewareList
from tests.navcore.laws import law

NAMES = {1: "first", 2: "zweite – Art", 62: "third"}


def state_of(seed: int, count: int = 20, rows: int = 13, cols: int = 21) -> MapState:
    """Return a map state of random content."""
    rng = np.random.default_rng(seed)
    spec = GridSpec(resolution_m=0.1, rows=rows, cols=cols, origin_x_m=-1.3, origin_y_m=0.7)
    high = np.array([cols * 0.1, rows * 0.1, 3.2])
    points = MapPoints(
        points_map=(rng.random((count, 3)) * high + [-1.3, 0.7, -0.425]).astype(np.float32),
        rgb=rng.integers(0, 256, (count, 3), dtype=np.uint8),
        class_ids=rng.choice([0, 1, 2, 62], count).astype(np.uint8),
        confidence=rng.random(count, dtype=np.float32),
        range_m=(5 * rng.random(count)).astype(np.float32),
        pose_ids=rng.integers(0, 3, count, dtype=np.int32),
    )
    measured, visible, driven, prior = (
        CellMask.of(rng.random((rows, cols)) < 0.5) for _ in range(4)
    )
    return MapState(
        spec=spec,
        points=points,
        poses=rng.normal(size=(3, 3)),
        measured=measured,
        visible=visible,
        driven=driven,
        prior=prior,
        volume=rng.integers(0, 2**63, (-(-rows // 4), -(-cols // 4)), dtype=np.uint64),
    )


def arrays(state: MapState) -> dict[str, npt.NDArray[Any]]:
    """Return all arrays of a state by name."""
    points = {
        field.name: getattr(state.points, field.name) for field in dataclasses.fields(state.points)
    }
    masks = {
        name: getattr(state, name).bools for name in ("measured", "visible", "driven", "prior")
    }
    return points | masks | {"poses": state.poses, "volume": state.volume}


def assert_same(first: MapState, second: MapState) -> None:
    assert first.spec == second.spec
    one, other = arrays(first), arrays(second)
    assert one.keys() == other.keys()
    for name, array in one.items():
        assert array.dtype == other[name].dtype, name
        np.testing.assert_array_equal(array, other[name], err_msg=name)


@law(25)
@given(st.integers(0, 2**32 - 1), st.integers(0, 40), st.integers(1, 30), st.integers(1, 30))
def test_a_map_comes_back_bit_by_bit(
    tmp_path_factory: pytest.TempPathFactory, seed: int, count: int, rows: int, cols: int
) -> None:
    path, state = tmp_path_factory.mktemp("map") / "hall.map.npz", state_of(seed, count, rows, cols)
    save(path, state, NAMES)
    stored = load(path)
    assert stored.class_names == NAMES
    assert_same(state, stored.state)


def test_a_map_without_a_point_or_a_pose_is_a_map_too(tmp_path: Path) -> None:
    empty = dataclasses.replace(state_of(1, 0), poses=np.empty((0, 3)))
    save(tmp_path / "m", empty, {})
    assert_same(empty, load(tmp_path / "m").state)


def test_saving_replaces_the_old_file_in_one_step_and_leaves_nothing_beside_it(
    tmp_path: Path,
) -> None:
    for seed in (1, 2):
        save(tmp_path / "m", state_of(seed), NAMES)
        assert_same(state_of(seed), load(tmp_path / "m").state)
    assert [file.name for file in tmp_path.iterdir()] == ["m"]


def test_a_map_that_cannot_be_written_leaves_the_old_file_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "m" / "full").mkdir(parents=True)
    with pytest.raises(StorageFailed, match="cannot be written"):
        save(tmp_path / "m", state_of(1), NAMES)
    with pytest.raises(StorageFailed, match="cannot be written"):
        save(tmp_path / "nowhere" / "m", state_of(1), NAMES)
    assert [file.name for file in tmp_path.iterdir()] == ["m"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the contents of a map file."""
    path = tmp_path_factory.mktemp("map") / "m"
    save(path, state_of(3), NAMES)
    return path.read_bytes()


def refusal(folder: Path, data: bytes) -> str:
    (folder / "m").write_bytes(data)
    with pytest.raises(BadConfiguration) as refused:
        load(folder / "m")
    assert str(refused.value).startswith("m: ")
    return str(refused.value)


@law(120)
@given(st.data())
def test_a_file_with_any_byte_changed_is_refused_or_means_the_same(
    tmp_path_factory: pytest.TempPathFactory, whole: bytes, data: st.DataObject
) -> None:
    path, bent = tmp_path_factory.getbasetemp() / "bent", bytearray(whole)
    at = data.draw(st.integers(0, len(bent) - 1))
    bent[at] ^= data.draw(st.integers(1, 255))
    path.write_bytes(bent)
    try:
        assert_same(load(path).state, state_of(3))
    except BadConfiguration as error:
        assert str(error).startswith("bent: ")


@law(40)
@given(st.data())
def test_a_file_that_was_cut_short_is_refused(
    tmp_path_factory: pytest.TempPathFactory, whole: bytes, data: st.DataObject
) -> None:
    refusal(tmp_path_factory.getbasetemp(), whole[: data.draw(st.integers(0, len(whole) - 1))])


def remade(whole: bytes, name: str, content: bytes | npt.NDArray[Any] | None) -> bytes:
    """Return the file with one part replaced or left out; checksums are right."""
    out = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(whole)) as source,
        zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for entry in source.namelist():
            if entry != f"{name}.npy":
                target.writestr(entry, source.read(entry))
        if content is not None:
            file = io.BytesIO()
            if isinstance(content, bytes):
                file.write(content)
            else:
                np.lib.format.write_array(file, content, allow_pickle=True)
            target.writestr(f"{name}.npy", file.getvalue())
    return out.getvalue()


def head(**changed: object) -> npt.NDArray[np.uint8]:
    spec = {"resolution_m": 0.1, "rows": 13, "cols": 21, "origin_x_m": -1.3, "origin_y_m": 0.7}
    values = {
        "format": "bewarenav map",
        "version": 1,
        "spec": spec,
        "class_ids": [1],
        "class_names": ["a"],
        **changed,
    }
    return np.frombuffer(json.dumps(values).encode(), dtype=np.uint8)


GOOD = arrays(state_of(3))
HUGE = (
    b"\x93NUMPY\x01\x00v\x00"
    + b"{'descr': '<f4', 'fortran_order': False, 'shape': (4611686018427387904, 3), }".ljust(117)
    + b"\n"
)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("rgb", None, "no map of this program; expected the parts"),
        ("extra", np.zeros(1), "no map of this program; expected the parts"),
        (
            "rgb",
            np.array([None, {}], dtype=object),
            "m: rgb: damaged: Object arrays cannot be loaded",
        ),
        ("rgb", b"", "m: rgb: damaged"),
        ("points_map", HUGE, "m: points_map: damaged"),
        (
            "points_map",
            GOOD["points_map"].astype(np.float64),
            "m: points_map: expected 2 axes of float32",
        ),
        ("points_map", GOOD["points_map"][:, :2].copy(), "m: points_map: has values"),
        ("points_map", GOOD["points_map"][:-1], "m: points: has values"),
        ("points_map", GOOD["points_map"] + np.float32(50), "m: points_map: has values"),
        ("points_map", GOOD["points_map"] * np.float32(np.nan), "m: points_map: has values"),
        ("class_ids", GOOD["class_ids"] + np.uint8(1), "m: class_ids: has values"),
        ("confidence", GOOD["confidence"] + np.float32(1), "m: confidence: has values"),
        ("range_m", -GOOD["range_m"], "m: range_m: has values"),
        ("pose_ids", GOOD["pose_ids"] + np.int32(1), "m: pose_ids: has values"),
        ("poses", GOOD["poses"] * np.inf, "m: poses: has values"),
        ("seen", np.zeros((13, 4), dtype=np.uint8), "m: seen: expected (13, 3) bytes"),
        ("volume", GOOD["volume"][1:], "m: volume: has values"),
        ("head", np.frombuffer(b"{", dtype=np.uint8), "m: head: damaged"),
        ("head", np.frombuffer(b"[" * 100_000, dtype=np.uint8), "m: head: damaged"),
        ("head", head(format="other"), "m: no map of this program"),
        ("head", head(version=2), "m: made in version 2 of the format, this program reads 1"),
        ("head", head(spec={}), "m: head.spec: key 'resolution_m' is missing"),
        ("head", head(colour=1), "m: head: unknown key 'colour'"),
        ("head", head(class_ids=[1, 2]), "m: head.class_ids: expected one id for each name"),
        ("head", head(class_ids=[0]), "m: head.class_ids[0]: 0 is out of range"),
    ],
)
def test_a_file_that_does_not_fit_itself_is_refused_by_part(
    tmp_path: Path, whole: bytes, name: str, content: bytes | npt.NDArray[Any] | None, words: str
) -> None:
    assert words in refusal(tmp_path, remade(whole, name, content))


def test_a_file_that_would_unpack_to_gigabytes_is_refused_unread(
    tmp_path: Path, whole: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("navcore.mapping.map_file.MAX_UNPACKED", 1000)
    assert "bytes unpacked, at most 1000 are read" in refusal(tmp_path, whole)
    monkeypatch.setattr("navcore.mapping.map_file.MAX_BYTES", len(whole) - 1)
    (tmp_path / "m").write_bytes(whole)
    with pytest.raises(BadConfiguration, match="larger than"):
        load(tmp_path / "m")


def test_a_map_made_down_a_slope_is_a_map_too(tmp_path: Path) -> None:
    state = state_of(3)
    state.points.points_map[:, 2] -= 7.5
    save(tmp_path / "m", state, NAMES)
    assert_same(load(tmp_path / "m").state, state)


def test_a_map_is_refused_when_its_class_ids_have_other_names_now(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    save(tmp_path / "m", state_of(3), NAMES)
    stored = load(tmp_path / "m")
    classes = tuple(
        BewareClass(name=name, class_id=class_id, enabled=False) for class_id, name in NAMES.items()
    )
    check_classes(stored, BewareList(classes=(*classes, BewareClass(name="fourth", class_id=4))))
    with caplog.at_level(logging.WARNING):
        check_classes(stored, BewareList(classes=classes[:2]))  # taken off the list by the operator
    assert "'third' (class 62), not in the beware list" in caplog.text
    renamed = (dataclasses.replace(classes[0], name="other"), *classes[1:])
    with pytest.raises(
        BadConfiguration,
        match="class 1 is 'first' in the stored map and 'other' in the beware list",
    ):
        check_classes(stored, BewareList(classes=renamed))


def test_a_pipe_or_a_missing_file_is_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, words in (
        ("pipe", "not a regular file"),
        ("none", "no such file"),
        (".", "not a regular file"),
    ):
        with pytest.raises(BadConfiguration, match=words):
            load(tmp_path / name)
