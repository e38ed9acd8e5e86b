"""Map files: a zip of plain arrays (NumPy's .npz, never pickled) with a JSON header.

Every part carries a checksum, so that a truncated or damaged file is refused, and nothing is read
before its size is known.
"""

from __future__ import annotations

import io
import json
import logging
import zipfile
import zlib
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration, StorageFailed
from navcore.files import read_whole, write_whole
from navcore.formats.map_image import MAX_PIXELS, MAX_SIDE
from navcore.geometry.transform import Pose2
from navcore.grid.cell_mask import CellMask
from navcore.grid.grid import GridSpec
from navcore.mapping.points.fading import UNKNOWN_LOOKS
from navcore.mapping.points.placing import base_points, map_points, pose_rows
from navcore.mapping.points.point_table import MapPoints
from navcore.mapping.storage import stored_rejections, stored_scans, stored_submaps
from navcore.mapping.storage.map_rules import require, within
from navcore.mapping.storage.map_state import MapState, check_points, check_state
from navcore.mapping.storage.stored_rejections import rejection_parts, rejections_of
from navcore.mapping.storage.stored_scans import NO_SCANS, scan_parts, scans_of
from navcore.mapping.storage.stored_submaps import Parts, submap_parts, submaps_of
from navcore.mission.beware_list import NOTHING, BewareList
from navcore.toml_config import from_table, ranged

log = logging.getLogger(__name__)
FORMAT = "bewarenav map"
VERSION = 4
"""Version that is written. Version 3, which did not name the numbering of the poses, version 2,
which had neither rejections nor looks, and version 1, which had neither positions by pose nor
submaps nor scans, are read, too."""
MAX_BYTES = 1 << 29
"""Largest file that is read, in bytes."""
MAX_UNPACKED = 1 << 31
"""Largest total of the unpacked parts, in bytes."""
MAX_SUBMAPS = 1 << 35
"""Largest total of the unpacked submaps, in bytes: the older programs stored one of some 40 kB for
every pose ID. Only one at a time is unpacked, in about 0.1 ms."""
_LONGEST_NUMBERING = 64
"""Largest number of letters in the name of a numbering of poses."""
_COLUMNS = ("rgb", "class_ids", "confidence", "range_m", "pose_ids")
_MASKS = {"seen": "measured", "looked": "visible", "trodden": "driven", "prior": "prior"}
"""Part → field of `MapState` for each set of cells."""
_COMMON: Mapping[str, tuple[type[np.generic], int]] = {
    "head": (np.uint8, 1),
    "rgb": (np.uint8, 2),
    "class_ids": (np.uint8, 1),
    "confidence": (np.float32, 1),
    "range_m": (np.float32, 1),
    "pose_ids": (np.int32, 1),
    "poses": (np.float64, 2),
    "volume": (np.uint64, 2),
    **dict.fromkeys(_MASKS, (np.uint8, 2)),
}
_BY_POSE: Mapping[str, tuple[type[np.generic], int]] = {
    **_COMMON,
    "points_base": (np.float32, 2),
    **stored_submaps.KINDS,
    **stored_scans.KINDS,
}
_WITH_LOOKS: Mapping[str, tuple[type[np.generic], int]] = {
    **_BY_POSE,
    "looks": (np.uint8, 1),
    **stored_rejections.KINDS,
}
_KINDS: Mapping[int, Mapping[str, tuple[type[np.generic], int]]] = {
    1: {**_COMMON, "points_map": (np.float32, 2)},
    2: _BY_POSE,
    3: _WITH_LOOKS,
    4: _WITH_LOOKS,
}
"""Version → part → type and number of axes.

`points_base` are (N, 3) positions in the base frame at each point's pose, with the height of the
map frame. Sets of cells are packed eight cells of a row to a byte, the first in the highest bit.
"""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredMap:
    """Contents of a map file."""

    state: MapState
    """State of the map."""
    class_names: Mapping[int, str]
    """Class id → name in the beware list with which the map was made."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spec:
    """Grid of a map file, with the limits of its values."""

    resolution_m: float = ranged(1e-3, 100.0)
    rows: int = ranged(1, MAX_SIDE)
    cols: int = ranged(1, MAX_SIDE)
    origin_x_m: float = ranged(-1e6, 1e6)
    origin_y_m: float = ranged(-1e6, 1e6)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Head:
    """Header of a map file."""

    format: str
    version: int
    spec: _Spec
    class_ids: tuple[int, ...] = ranged(1, 255)
    class_names: tuple[str, ...]
    numbering: str = ""


class MapTooLarge(StorageFailed):
    """The map is larger than what is read again: another try to write it fails as well."""


def save(path: Path, state: MapState, class_names: Mapping[int, str]) -> None:
    """Write a map file atomically; raises `StorageFailed`, also for a map larger than is read, and
    then an older file is intact."""
    check_state(state, path.name)
    head = _Head(
        format=FORMAT,
        version=VERSION,
        spec=_Spec(**asdict(state.spec)),
        class_ids=tuple(class_names),
        class_names=tuple(class_names.values()),
        numbering=state.numbering,
    )
    parts: Parts = {name: getattr(state.points, name) for name in (*_COLUMNS, "looks")}
    parts |= {
        name: np.packbits(getattr(state, field).bools, axis=1) for name, field in _MASKS.items()
    }
    parts |= {"poses": state.poses, "volume": state.volume}
    parts["points_base"] = np.column_stack([state.points_base, state.points.points_map[:, 2]])
    parts |= submap_parts(state.submaps) | scan_parts(state.scans)
    parts |= rejection_parts(state.rejections)
    parts["head"] = np.frombuffer(json.dumps(asdict(head)).encode(), dtype=np.uint8)
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **parts)
    size, unpacked = file.getbuffer().nbytes, _unpacked(zipfile.ZipFile(file))
    if size > MAX_BYTES or unpacked > MAX_UNPACKED:
        raise MapTooLarge(
            f"{path} is not written: the map has {size} bytes, {unpacked} unpacked, of which at "
            f"most {MAX_BYTES} and {MAX_UNPACKED} are read; lower map.budget_mb or begin a new map"
        )
    write_whole(path, file.getvalue())


def load(path: Path) -> StoredMap:
    """The map of a file; raises `BadConfiguration` for one that is torn, damaged, too large or no
    map."""
    return parsed(read_whole(path, at_most=MAX_BYTES), path.name)


def parsed(data: bytes, where: str) -> StoredMap:
    """Return the contents of a map file; raises `BadConfiguration` like `load`."""
    version, parts = _read(data, where)
    head = _head(parts["head"], version, where)
    spec = GridSpec(**asdict(head.spec))
    check_points(parts, spec, where)
    rows = pose_rows(Pose2(x_m=x, y_m=y, yaw_rad=yaw) for x, y, yaw in parts["poses"].tolist())
    if version < 3:
        parts["looks"] = np.full(len(parts["pose_ids"]), UNKNOWN_LOOKS, dtype=np.uint8)
    if version == 1:
        points_map = parts["points_map"]
        points_base = base_points(points_map, parts["pose_ids"], rows)
    else:
        points_base = parts["points_base"][:, :2].copy()
        points_map = map_points(parts["points_base"], parts["pose_ids"], rows)
    state = MapState(
        spec=spec,
        points=MapPoints(
            points_map=points_map,
            looks=parts["looks"],
            **{name: parts[name] for name in _COLUMNS},
        ),
        points_base=points_base,
        poses=parts["poses"],
        numbering=head.numbering,
        volume=parts["volume"],
        submaps={} if version == 1 else submaps_of(parts, len(parts["poses"]), MAX_SUBMAPS, where),
        scans=NO_SCANS if version == 1 else scans_of(parts, len(parts["poses"]), where),
        rejections=rejections_of(parts, len(parts["poses"]), where) if version > 2 else (),
        **{field: _mask(parts[name], spec, f"{where}: {name}") for name, field in _MASKS.items()},
    )
    check_state(state, where)
    return StoredMap(
        state=state,
        class_names=dict(zip(head.class_ids, head.class_names, strict=True)),
    )


def numbered_poses(data: bytes, where: str) -> tuple[str, npt.NDArray[np.float64]]:
    """Return the numbering and the (P, 3) poses of a map file, as `MapState` has them, and unpack
    nothing else; raises `BadConfiguration` like `load`."""
    version, parts = _read(data, where, only=("head", "poses"))
    poses = parts["poses"]
    require({"poses": poses.shape[1:] == (3,) and within(poses, -1e7, 1e7)}, where)
    return _head(parts["head"], version, where).numbering, poses


def check_classes(stored: StoredMap, beware: BewareList) -> None:
    """Raise `BadConfiguration` if a class id of the map belongs to a name that never was that of
    the class in this beware list.

    Points of a class that the list lacks stay free floor, as when it was removed; that is logged.
    """
    present = {entry.class_id: entry.name for entry in beware.classes}
    for class_id in sorted(
        {int(number) for number in np.unique(stored.state.points.class_ids)} - {NOTHING}
    ):
        now = present.get(class_id)
        then = stored.class_names.get(class_id, now)
        if now is None:
            log.warning(
                "the stored map has points of %r (class %d), not in the beware list: free floor",
                then,
                class_id,
            )
        elif then is not None and beware.ids.get(then) != class_id:
            raise BadConfiguration(
                f"class {class_id} is {then!r} in the stored map and {now!r} in the beware list"
            )


def _read(data: bytes, where: str, only: Collection[str] = ()) -> tuple[int, Parts]:
    """Return the version of a file, by the parts that it has, and its parts, or those named
    alone."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            names = sorted(packed.namelist())
            version = next(
                (v for v, parts in _KINDS.items() if names == sorted(f"{p}.npy" for p in parts)), 0
            )
            if not version:
                raise BadConfiguration(
                    f"{where}: no map of this program; expected the parts "
                    f"{', '.join(_KINDS[VERSION])}"
                )
            kinds = _KINDS[version]
            if (size := _unpacked(packed)) > MAX_UNPACKED:
                raise BadConfiguration(
                    f"{where}: {size} bytes unpacked, at most {MAX_UNPACKED} are read"
                )
            return version, {
                name: _array(packed.read(f"{name}.npy"), *kinds[name], f"{where}: {name}")
                for name in only or kinds
            }
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        KeyError,
        ValueError,
        RuntimeError,
        OSError,
    ) as error:
        raise BadConfiguration(f"{where}: no map file, or a damaged one: {error!s:.200}") from None


def _unpacked(packed: zipfile.ZipFile) -> int:
    """Return the total size of the unpacked parts in bytes."""
    return sum(entry.file_size for entry in packed.infolist())


def _array(data: bytes, kind: type[np.generic], axes: int, where: str) -> npt.NDArray[Any]:
    try:
        array: npt.NDArray[Any] = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError, MemoryError, TypeError, OverflowError, SyntaxError) as error:
        raise BadConfiguration(f"{where}: damaged: {error!s:.200}") from None
    if array.dtype != kind or array.ndim != axes:
        raise BadConfiguration(
            f"{where}: expected {axes} axes of {np.dtype(kind)}, got {array.ndim} of {array.dtype}"
        )
    return array


def _mask(packed: npt.NDArray[np.uint8], spec: GridSpec, where: str) -> CellMask:
    if packed.shape != (spec.rows, -(-spec.cols // 8)):
        raise BadConfiguration(
            f"{where}: expected {(spec.rows, -(-spec.cols // 8))} bytes, got {packed.shape}"
        )
    return CellMask.of(np.unpackbits(packed, axis=1, count=spec.cols).view(np.bool_))


def _head(part: npt.NDArray[Any], version: int, where: str) -> _Head:
    try:
        table = json.loads(part.tobytes())
    except (ValueError, RecursionError):
        raise BadConfiguration(f"{where}: head: damaged, not readable as JSON") from None
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        raise BadConfiguration(f"{where}: no map of this program")
    if table.get("version") not in [v for v, kinds in _KINDS.items() if kinds is _KINDS[version]]:
        raise BadConfiguration(
            f"{where}: made in version {table.get('version')!r:.20} of the format, this program "
            f"reads {', '.join(map(str, _KINDS))}, and the parts are those of {version}"
        )
    head = from_table(_Head, table, f"{where}: head")
    if head.spec.rows * head.spec.cols > MAX_PIXELS:
        raise BadConfiguration(
            f"{where}: head.spec: {head.spec.rows} × {head.spec.cols} cells, at most "
            f"{MAX_PIXELS} are allowed"
        )
    if len(head.class_ids) != len(head.class_names) or len(set(head.class_ids)) != len(
        head.class_ids
    ):
        raise BadConfiguration(
            f"{where}: head.class_ids: expected one id for each name, and no id twice"
        )
    if len(head.numbering) > _LONGEST_NUMBERING:
        raise BadConfiguration(
            f"{where}: head.numbering: {len(head.numbering)} letters are too many"
        )
    return head
