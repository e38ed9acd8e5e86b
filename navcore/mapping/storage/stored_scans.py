"""Scans of keyframes as plain arrays of a map file: localisation keeps them beside the map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from navcore.mapping.storage.map_rules import require, within
from navcore.mapping.storage.stored_submaps import Parts

KINDS: Mapping[str, tuple[type[np.generic], int]] = {
    "scan_pose_ids": (np.int32, 1),
    "scan_sizes": (np.int32, 1),
    "scan_origins": (np.float32, 2),
    "scan_points": (np.float32, 2),
    "scan_normals": (np.float32, 2),
    "scan_variance": (np.float32, 1),
}
"""Part → type and number of axes, as the fields of `StoredScans`."""
_FURTHEST_M = 1000.0
"""Largest distance in metres of a scan point from its pose."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredScans:
    """One scan for each of some pose IDs, in the base frame at its pose."""

    pose_ids: npt.NDArray[np.int32] = field(default_factory=lambda: np.empty(0, dtype=np.int32))
    """(K,) pose ID of each scan, ascending."""
    sizes: npt.NDArray[np.int32] = field(default_factory=lambda: np.empty(0, dtype=np.int32))
    """(K,) number of points of each scan."""
    origins: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 2), np.float32))
    """(K, 2) x and y in metres from which each scan was measured."""
    points: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 2), np.float32))
    """(M, 2) x and y in metres of the points of all scans, one scan after the other."""
    normals: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 2), np.float32))
    """(M, 2) unit normal of the surface at each point; (0, 0) where it has none."""
    variance: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty(0, np.float32))
    """(M,) variance of each point in square metres."""


NO_SCANS = StoredScans()
"""No scan."""


def scan_parts(scans: StoredScans) -> Parts:
    """Return scans as arrays by name."""
    return {name: getattr(scans, name.removeprefix("scan_")) for name in KINDS}


def scans_of(parts: Parts, poses: int, where: str) -> StoredScans:
    """Return the scans of arrays; raises `BadConfiguration` for values that no scan has.

    `poses`: number of pose IDs of the map. `where`: name of the file.
    """
    scans = StoredScans(**{name.removeprefix("scan_"): parts[name] for name in KINDS})
    check_scans(scans, poses, where)
    return scans


def check_scans(scans: StoredScans, poses: int, where: str) -> None:
    """Raise `BadConfiguration` for values that no scan has; `where` names the file."""
    ids, sizes, count, far = scans.pose_ids, scans.sizes, len(scans.points), _FURTHEST_M
    require(
        {
            "scan_pose_ids": within(ids, 0, poses - 1) and bool((ids[1:] > ids[:-1]).all()),
            "scan_sizes": len(sizes) == len(ids)
            and within(sizes, 0, count)
            and int(sizes.sum(dtype=np.int64)) == count,
            "scan_origins": scans.origins.shape == (len(ids), 2)
            and within(scans.origins, -far, far),
            "scan_points": scans.points.shape == (count, 2) and within(scans.points, -far, far),
            "scan_normals": scans.normals.shape == (count, 2) and within(scans.normals, -1.1, 1.1),
            "scan_variance": len(scans.variance) == count
            and within(scans.variance, 0, far)
            and bool((scans.variance > 0).all()),
        },
        where,
    )
