"""Keyframes as the plain arrays of a map file, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navcore.geometry.transform import Pose2
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.mapping.storage.stored_scans import NO_SCANS, StoredScans


def stored(keyframes: Sequence[Keyframe]) -> StoredScans:
    """Return the scans of keyframes by ascending pose ID; their poses are those of the map."""
    if not keyframes:
        return NO_SCANS
    ordered = sorted(keyframes, key=lambda keyframe: keyframe.pose_id)
    scans = [keyframe.scan for keyframe in ordered]
    return StoredScans(
        pose_ids=np.array([keyframe.pose_id for keyframe in ordered], dtype=np.int32),
        sizes=np.array([len(scan) for scan in scans], dtype=np.int32),
        origins=np.array([scan.origin for scan in scans], dtype=np.float32),
        points=np.concatenate([scan.points_base for scan in scans]).astype(np.float32),
        normals=np.concatenate([scan.normals for scan in scans]).astype(np.float32),
        variance=np.concatenate([scan.variance_m2 for scan in scans]).astype(np.float32),
    )


def restored(scans: StoredScans, poses: Sequence[Pose2]) -> tuple[Keyframe, ...]:
    """Return the keyframes of stored scans; `poses` are T_map_base of all pose IDs."""
    ends = np.cumsum(scans.sizes)
    parts = [slice(int(end - size), int(end)) for end, size in zip(ends, scans.sizes, strict=True)]
    return tuple(
        Keyframe(
            pose_id=int(pose_id),
            T_map_base=poses[int(pose_id)],
            scan=Scan(
                points_base=scans.points[part].astype(np.float64),
                variance_m2=scans.variance[part].astype(np.float64),
                normals=scans.normals[part].astype(np.float64),
                origin=origin.astype(np.float64),
            ),
        )
        for pose_id, part, origin in zip(scans.pose_ids, parts, scans.origins, strict=True)
    )
