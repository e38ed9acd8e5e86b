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
from navcore.geometry.transform import Pose2
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.mapping.explored.patch import empty_patch
from navcore.mapping.explored.submap import PackedSubmap, packed
from navcore.mapping.points.fading import UNKNOWN_LOOKS
from navcore.mapping.points.placing import base_points, map_points, pose_rows
from navcore.mapping.points.point_table import MapPoints
from navcore.mapping.points.rejections import Rejection
from navcore.mapping.storage import map_file
from navcore.mapping.storage.map_file import check_classes, load, save
from navcore.mapping.storage.map_state import MapState
from navcore.mapping.storage.stored_rejections import KINDS as REJECTED
from navcore.mapping.storage.stored_rejections import rejection_parts
from navcore.mapping.storage.stored_scans import StoredScans, scan_parts
from navcore.mapping.storage.stored_submaps import submap_parts
from navcore.mission.beware_list import BewareClass, BewareList
from tests.navcore.laws import law
from tests.navcore.scene import ORIGIN

NAMES = {1: "first", 2: "zweite – Art", 62: "third"}


def state_of(seed: int, count: int = 20, rows: int = 13, cols: int = 21) -> MapState:
    """Return a map state of random content."""
    rng = np.random.default_rng(seed)
    spec = GridSpec(resolution_m=0.1, rows=rows, cols=cols, origin_x_m=-1.3, origin_y_m=0.7)
    high = np.array([cols * 0.1, rows * 0.1, 3.2])
    poses, pose_ids = rng.normal(size=(3, 3)), rng.integers(0, 3, count, dtype=np.int32)
    somewhere = (rng.random((count, 3)) * high + [-1.3, 0.7, -0.425]).astype(np.float32)
    bodies = pose_rows(Pose2(x_m=x, y_m=y, yaw_rad=yaw) for x, y, yaw in poses.tolist())
    points_base = base_points(somewhere, pose_ids, bodies)
    points = MapPoints(
        points_map=map_points(np.column_stack([points_base, somewhere[:, 2]]), pose_ids, bodies),
        rgb=rng.integers(0, 256, (count, 3), dtype=np.uint8),
        class_ids=rng.choice([0, 1, 2, 62], count).astype(np.uint8),
        confidence=rng.random(count, dtype=np.float32),
        range_m=(5 * rng.random(count)).astype(np.float32),
        pose_ids=pose_ids,
        looks=rng.integers(1, 31, count, dtype=np.uint8),
    )
    measured, visible, driven, prior = (
        CellMask.of(rng.random((rows, cols)) < 0.5) for _ in range(4)
    )
    return MapState(
        spec=spec,
        points=points,
        points_base=points_base,
        poses=poses,
        numbering=f"{seed:032x}",
        measured=measured,
        visible=visible,
        driven=driven,
        prior=prior,
        volume=rng.integers(0, 2**63, (-(-rows // 4), -(-cols // 4)), dtype=np.uint64),
        submaps={pose_id: submap_of(rng, rows, cols) for pose_id in (0, 2)},
        rejections=tuple(
            Rejection(
                id=number,
                class_id=int(rng.integers(1, 63)),
                confidence=float(rng.random(dtype=np.float32)),
                pose_id=int(rng.integers(3)),
                points_base=rng.normal(size=(number, 2)).astype(np.float32),
            )
            for number in (1, 2)
        ),
    )


def submap_of(rng: np.random.Generator, rows: int, cols: int) -> PackedSubmap:
    patch = empty_patch((0, 0, rows, cols))
    patch.planes[:] = rng.integers(0, 2**63, patch.planes.shape, dtype=np.uint64)
    patch.volume[:] = rng.integers(0, 2**63, patch.volume.shape, dtype=np.uint64)
    return packed(Pose2(x_m=rng.normal(), y_m=rng.normal(), yaw_rad=rng.normal()), patch)


def scans_of(seed: int) -> StoredScans:
    """Return scans of two of the three poses."""
    rng = np.random.default_rng(seed)
    return StoredScans(
        pose_ids=np.array([0, 2], dtype=np.int32),
        sizes=np.array([3, 4], dtype=np.int32),
        origins=rng.normal(size=(2, 2)).astype(np.float32),
        points=rng.normal(size=(7, 2)).astype(np.float32),
        normals=np.zeros((7, 2), dtype=np.float32),
        variance=rng.random(7, dtype=np.float32),
    )


def arrays(state: MapState) -> dict[str, npt.NDArray[Any]]:
    """Return all arrays of a state by name."""
    points = {
        field.name: getattr(state.points, field.name) for field in dataclasses.fields(state.points)
    }
    masks = {
        name: getattr(state, name).bools for name in ("measured", "visible", "driven", "prior")
    }
    others = {
        name: getattr(state, name) for name in ("points_base", "poses", "volume")
    } | submap_parts(state.submaps)
    others |= rejection_parts(state.rejections)
    return points | masks | others


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
    save(path, dataclasses.replace(state, scans=scans_of(seed)), NAMES)
    stored = load(path)
    assert stored.class_names == NAMES
    assert stored.state.numbering == state.numbering
    assert_same(state, stored.state)
    for name, part in scan_parts(scans_of(seed)).items():
        np.testing.assert_array_equal(part, scan_parts(stored.state.scans)[name], err_msg=name)


def test_a_map_without_a_point_or_a_pose_is_a_map_too(tmp_path: Path) -> None:
    empty = dataclasses.replace(state_of(1, 0), poses=np.empty((0, 3)), submaps={}, rejections=())
    save(tmp_path / "m", empty, {})
    assert_same(empty, load(tmp_path / "m").state)


def test_saving_replaces_the_old_file_in_one_step_and_leaves_nothing_beside_it(
    tmp_path: Path,
) -> None:
    for seed in (1, 2):
        save(tmp_path / "m", state_of(seed), NAMES)
        assert_same(state_of(seed), load(tmp_path / "m").state)
    assert [file.name for file in tmp_path.iterdir()] == ["m"]


@pytest.mark.parametrize(("limit", "size"), [("MAX_BYTES", 500), ("MAX_UNPACKED", 2000)])
def test_a_map_larger_than_is_read_is_not_written_and_the_old_file_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, size: int
) -> None:
    path = tmp_path / "kept.map"
    save(path, state_of(1), NAMES)
    before = path.read_bytes()
    with monkeypatch.context() as patched:
        patched.setattr(map_file, limit, size)
        with pytest.raises(StorageFailed, match=rf"kept\.map is not written: .* {size} "):
            save(path, state_of(2), NAMES)
    assert path.read_bytes() == before


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
    save(path, dataclasses.replace(state_of(3), scans=scans_of(3)), NAMES)
    return path.read_bytes()


@pytest.fixture(scope="module")
def old(whole: bytes) -> bytes:
    """Return the contents of a map file of version 1, with the same points."""
    with np.load(io.BytesIO(whole)) as parts:
        kept = {
            name: part
            for name, part in parts.items()
            if not name.startswith(("scan_", "submap_", "rejected_", "points_base", "looks"))
        }
    file = io.BytesIO()
    kept |= {"points_map": GOOD["points_map"], "head": head(version=1)}
    np.savez_compressed(file, allow_pickle=False, **kept)
    return file.getvalue()


def test_a_file_of_version_3_is_read_and_names_no_numbering(tmp_path: Path, whole: bytes) -> None:
    (tmp_path / "m").write_bytes(remade(whole, "head", head(version=3)))
    assert_same(load(tmp_path / "m").state, state_of(3))
    assert load(tmp_path / "m").state.numbering == ""


def test_the_poses_of_a_file_are_read_alone(whole: bytes) -> None:
    numbering, poses = map_file.numbered_poses(whole, "m")
    assert numbering == state_of(3).numbering != ""
    np.testing.assert_array_equal(poses, state_of(3).poses)
    with pytest.raises(BadConfiguration, match="m: poses: has values"):
        map_file.numbered_poses(remade(whole, "poses", np.full((3, 3), np.inf)), "m")


def test_a_file_of_version_1_is_read_and_its_points_keep_their_places(
    tmp_path: Path, old: bytes
) -> None:
    (tmp_path / "m").write_bytes(old)
    stored, expected = load(tmp_path / "m"), arrays(state_of(3))
    assert not stored.state.submaps
    assert len(stored.state.scans.pose_ids) == 0
    assert stored.class_names == {1: "a"}
    for name, part in arrays(stored.state).items():
        if name == "points_base":
            np.testing.assert_allclose(part, expected[name], atol=1e-6)
        elif not name.startswith(("submap_", "rejected_", "looks")):
            np.testing.assert_array_equal(part, expected[name], err_msg=name)


def test_a_file_of_version_2_is_read_without_rejections_and_looks(
    tmp_path: Path, whole: bytes
) -> None:
    for name in (*REJECTED, "looks"):
        whole = remade(whole, name, None)
    (tmp_path / "m").write_bytes(remade(whole, "head", head(version=2)))
    stored = load(tmp_path / "m").state
    assert stored.rejections == ()
    assert (stored.points.looks == UNKNOWN_LOOKS).all()
    same = state_of(3)
    points = dataclasses.replace(same.points, looks=stored.points.looks)
    assert_same(stored, dataclasses.replace(same, points=points, rejections=()))


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
        "version": 4,
        "spec": spec,
        "class_ids": [1],
        "class_names": ["a"],
        **changed,
    }
    return np.frombuffer(json.dumps(values).encode(), dtype=np.uint8)


GOOD = arrays(state_of(3))
BOXES: npt.NDArray[np.int32] = GOOD["submap_boxes"]
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
        ("points_base", HUGE, "m: points_base: damaged"),
        (
            "points_base",
            GOOD["points_map"].astype(np.float64),
            "m: points_base: expected 2 axes of float32",
        ),
        ("points_base", GOOD["points_map"][:, :2].copy(), "m: points_base: has values"),
        ("points_base", GOOD["points_map"][:-1], "m: points: has values"),
        ("points_base", GOOD["points_map"] + np.float32(5000), "m: points_base: has values"),
        ("points_base", GOOD["points_map"] * np.float32(np.nan), "m: points_base: has values"),
        ("rgb", GOOD["rgb"][:-1], "m: points: has values"),
        ("class_ids", GOOD["class_ids"] + np.uint8(1), "m: class_ids: has values"),
        ("confidence", GOOD["confidence"] + np.float32(1), "m: confidence: has values"),
        ("range_m", -GOOD["range_m"], "m: range_m: has values"),
        ("pose_ids", GOOD["pose_ids"] + np.int32(1), "m: pose_ids: has values"),
        ("pose_ids", GOOD["pose_ids"] - np.int32(9), "m: pose_ids: has values"),
        ("poses", GOOD["poses"] * np.inf, "m: poses: has values"),
        ("poses", GOOD["poses"][:, :2].copy(), "m: poses: has values"),
        ("submap_pose_ids", np.array([0, 3], np.int32), "m: submap_pose_ids: has values"),
        ("submap_pose_ids", np.array([2, 0], np.int32), "m: submap_pose_ids: has values"),
        ("submap_pose_ids", np.array([1, 1], np.int32), "m: submap_pose_ids: has values"),
        ("submap_poses", np.full((2, 3), np.nan), "m: submap_poses: has values"),
        ("submap_poses", np.zeros((1, 3)), "m: submap_poses: has values"),
        ("submap_boxes", np.zeros((2, 3), np.int32), "m: submap_boxes: has values"),
        ("submap_boxes", BOXES + np.array([1, 0, 0, 0], np.int32), "m: submap_boxes: has values"),
        ("submap_boxes", BOXES + np.array([0, 4, 0, 0], np.int32), "m: submap_boxes: has values"),
        ("submap_boxes", BOXES - np.array([0, 0, 0, 9], np.int32), "m: submap_boxes: has values"),
        (
            "submap_boxes",
            BOXES + np.array([2**30, 0, 0, 0], np.int32),
            "m: submap_boxes: has values",
        ),
        (
            "submap_boxes",
            BOXES + np.array([0, 0, 2**24, 0], np.int32),
            "m: submap_boxes: has values",
        ),
        (
            "submap_boxes",
            BOXES + np.array([0, 0, 4, 0], np.int32),
            "m: submap_data: damaged submap",
        ),
        (
            "submap_boxes",
            BOXES - np.array([0, 0, 4, 0], np.int32),
            "m: submap_data: damaged submap",
        ),
        ("submap_sizes", np.array([-1, 2**40]), "m: submap_sizes: has values"),
        ("submap_sizes", np.array([2**63 - 1, 2**63 - 1]), "m: submap_sizes: has values"),
        ("submap_sizes", np.array([0, 5]), "m: submap_sizes: has values"),
        ("submap_data", GOOD["submap_data"] ^ np.uint8(5), "m: submap_data: damaged submap"),
        ("rejected_class_ids", np.array([0, 1], np.uint8), "m: rejected_class_ids: has values"),
        ("rejected_class_ids", np.ones(501, np.uint8), "m: rejected_class_ids: has values"),
        ("rejected_confidence", np.array([2, 0], np.float32), "m: rejected_confidence: has"),
        ("rejected_confidence", np.ones(3, np.float32), "m: rejected_confidence: has values"),
        ("rejected_pose_ids", np.array([0, 3], np.int32), "m: rejected_pose_ids: has values"),
        ("rejected_sizes", np.array([1, 1], np.int32), "m: rejected_sizes: has values"),
        ("rejected_sizes", np.array([4, -1], np.int32), "m: rejected_sizes: has values"),
        ("rejected_points", np.full((3, 2), np.nan, np.float32), "m: rejected_points: has values"),
        ("rejected_points", np.zeros((3, 1), np.float32), "m: rejected_points: has values"),
        ("scan_pose_ids", np.array([0, 3], np.int32), "m: scan_pose_ids: has values"),
        ("scan_pose_ids", np.array([2, 2], np.int32), "m: scan_pose_ids: has values"),
        ("scan_sizes", np.array([3, 3], np.int32), "m: scan_sizes: has values"),
        ("scan_sizes", np.array([-1, 8], np.int32), "m: scan_sizes: has values"),
        ("scan_origins", np.zeros((7, 2), np.float32), "m: scan_origins: has values"),
        ("scan_points", np.full((7, 2), np.inf, np.float32), "m: scan_points: has values"),
        ("scan_points", np.zeros((7, 3), np.float32), "m: scan_points: has values"),
        ("scan_normals", np.full((7, 2), 2, np.float32), "m: scan_normals: has values"),
        ("scan_variance", np.full(7, -1, np.float32), "m: scan_variance: has values"),
        ("scan_variance", np.zeros(7, np.float32), "m: scan_variance: has values"),
        ("seen", np.zeros((13, 4), dtype=np.uint8), "m: seen: expected (13, 3) bytes"),
        ("volume", GOOD["volume"][1:], "m: volume: has values"),
        ("head", np.frombuffer(b"{", dtype=np.uint8), "m: head: damaged"),
        ("head", np.frombuffer(b"[" * 100_000, dtype=np.uint8), "m: head: damaged"),
        ("head", head(format="other"), "m: no map of this program"),
        (
            "head",
            head(version=1),
            "m: made in version 1 of the format, this program reads 1, 2, 3, 4",
        ),
        (
            "head",
            head(version=5),
            "m: made in version 5 of the format, this program reads 1, 2, 3, 4",
        ),
        ("head", head(spec={}), "m: head.spec: key 'resolution_m' is missing"),
        ("head", head(colour=1), "m: head: unknown key 'colour'"),
        ("head", head(class_ids=[1, 2]), "m: head.class_ids: expected one id for each name"),
        ("head", head(class_ids=[0]), "m: head.class_ids[0]: 0 is out of range"),
        ("head", head(numbering=5), "m: head.numbering: "),
        ("head", head(numbering="x" * 65), "m: head.numbering: 65 letters are too many"),
    ],
)
def test_a_file_that_does_not_fit_itself_is_refused_by_part(
    tmp_path: Path, whole: bytes, name: str, content: bytes | npt.NDArray[Any] | None, words: str
) -> None:
    assert words in refusal(tmp_path, remade(whole, name, content))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("points_map", GOOD["points_map"] + np.float32(50), "m: points_map: has values"),
        ("points_map", GOOD["points_map"] * np.float32(np.nan), "m: points_map: has values"),
        ("pose_ids", GOOD["pose_ids"] + np.int32(1), "m: pose_ids: has values"),
        ("head", head(), "m: made in version 4 of the format"),
        ("points_base", GOOD["points_map"], "m: no map of this program; expected the parts"),
    ],
)
def test_an_old_file_that_does_not_fit_itself_is_refused_by_part(
    tmp_path: Path, old: bytes, name: str, content: npt.NDArray[Any], words: str
) -> None:
    assert words in refusal(tmp_path, remade(old, name, content))


def test_submaps_that_unpack_to_more_than_is_read_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bombs = {pose_id: packed(ORIGIN, empty_patch((0, 0, 4096, 4096))) for pose_id in (0, 1)}
    save(tmp_path / "m", dataclasses.replace(state_of(3), submaps=bombs), NAMES)
    assert load(tmp_path / "m").state.submaps.keys() == {0, 1}
    monkeypatch.setattr("navcore.mapping.storage.map_file.MAX_SUBMAPS", 10**6)
    with pytest.raises(BadConfiguration, match="submap_data: unpacks to more than is read"):
        load(tmp_path / "m")


def test_a_file_that_would_unpack_to_gigabytes_is_refused_unread(
    tmp_path: Path, whole: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("navcore.mapping.storage.map_file.MAX_UNPACKED", 1000)
    assert "bytes unpacked, at most 1000 are read" in refusal(tmp_path, whole)
    monkeypatch.setattr("navcore.mapping.storage.map_file.MAX_BYTES", len(whole) - 1)
    (tmp_path / "m").write_bytes(whole)
    with pytest.raises(BadConfiguration, match="larger than"):
        load(tmp_path / "m")


def test_a_map_made_down_a_slope_is_a_map_too(tmp_path: Path) -> None:
    state = state_of(3)
    state.points.points_map[:, 2] -= np.float32(7.5)
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
