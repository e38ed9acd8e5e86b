"""The scan map is the sum of its keyframes' scans at their present poses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navcore.geometry.transform import Pose2
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.scans.scan_map import ScanMap
from tests.navcore.laws import law
from tests.navcore.localisation.plan_worlds import PlanWorld, office

WORLD = office(3)
_RNG = np.random.default_rng(5)
POSES = [Pose2(x_m=2.0 + 1.7 * k, y_m=0.3 * math.sin(k), yaw_rad=0.7 * k) for k in range(8)]
SCANS = [WORLD.scan(pose, _RNG) for pose in POSES]

poses = st.builds(
    Pose2,
    x_m=st.floats(-60.0, 60.0),
    y_m=st.floats(-60.0, 60.0),
    yaw_rad=st.floats(-3.1, 3.1),
)
changes = st.lists(
    st.tuples(st.sampled_from(["put", "remove", "correct"]), st.integers(0, 7), poses), max_size=12
)


def keyframe(k: int, at: Pose2 | None = None, sigma_m: float | None = None) -> Keyframe:
    """One of the scans at a pose, by default its own, which is uncertain by the more the later."""
    variance = (0.01 * k if sigma_m is None else sigma_m) ** 2
    return Keyframe(
        pose_id=k,
        T_map_base=at or POSES[k],
        scan=SCANS[k],
        covariance=np.diag([variance, 2 * variance, variance / 10]),
    )


def surfaces_of(scan_map: ScanMap) -> np.ndarray:
    """The surfaces in an order that does not depend on the history."""
    rows = scan_map.surfaces
    return rows[np.lexsort(np.round(rows, 6).T)]


@law(30)
@given(changes)
def test_after_any_changes_the_map_is_the_one_built_from_each_scan_at_its_pose(
    steps: list[tuple[str, int, Pose2]],
) -> None:
    scan_map = ScanMap()
    for kind, pose_id, pose in steps:
        if kind == "put":
            scan_map.put(keyframe(pose_id, pose))
        elif kind == "remove":
            scan_map.remove(pose_id)
        else:
            scan_map.correct({pose_id: pose, (pose_id + 1) % 8: POSES[pose_id]})
    fresh = ScanMap()
    fresh.replace(scan_map.keyframes)

    assert np.allclose(surfaces_of(scan_map), surfaces_of(fresh), atol=1e-6)
    for one in scan_map.keyframes:
        kept, built = (m.covariance_at(one.T_map_base, one.scan, 0.1) for m in (scan_map, fresh))
        assert kept is not None and built is not None
        assert np.allclose(kept, built, atol=1e-8)


def test_surfaces_are_as_uncertain_as_the_keyframes_that_show_them() -> None:
    scan_map = ScanMap()
    scan_map.put(keyframe(4))
    assert scan_map.covariance_at(POSES[4], SCANS[4], 0.1) == pytest.approx(keyframe(4).covariance)
    scan_map.put(replace(keyframe(4, sigma_m=0.10), pose_id=5))
    scan_map.put(replace(keyframe(4, sigma_m=0.20), pose_id=4))
    both = scan_map.covariance_at(POSES[4], SCANS[4], 0.1)
    mean = (keyframe(4, sigma_m=0.1).covariance + keyframe(4, sigma_m=0.2).covariance) / 2
    assert both == pytest.approx(mean)


def test_a_turn_of_a_keyframe_moves_what_is_far_from_it() -> None:
    """Seen from 10 m ahead, the same surfaces are uncertain aside by 10 m times the heading."""
    scan_map, turned = ScanMap(), np.diag([0.0, 0.0, 0.01**2])
    scan_map.put(replace(keyframe(0, Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0)), covariance=turned))
    ahead = Pose2(x_m=10.0, y_m=0.0, yaw_rad=0.0)
    scan = SCANS[0].seen_from(ahead.inverse())
    assert scan_map.covariance_at(Pose2(x_m=99.0, y_m=0.0, yaw_rad=0.0), scan, 0.1) is None
    expected = 0.01**2 * np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 10.0], [0.0, 10.0, 1.0]])
    assert scan_map.covariance_at(ahead, scan, 0.1) == pytest.approx(expected)


def test_a_map_is_bounded_by_its_pose_ids() -> None:
    scan_map = ScanMap()
    for _ in range(3):
        for k, (pose, scan) in enumerate(zip(POSES, SCANS, strict=True)):
            scan_map.put(Keyframe(pose_id=k, T_map_base=pose, scan=scan))
    once = ScanMap()
    once.replace(scan_map.keyframes)

    assert len(scan_map) == len(POSES)
    assert scan_map.held == once.held
    assert scan_map.surfaces[:, 4].sum() == sum(len(scan) for scan in SCANS)


def test_a_correction_moves_surfaces_with_their_pose() -> None:
    scan_map = ScanMap()
    scan_map.put(Keyframe(pose_id=4, T_map_base=POSES[0], scan=SCANS[0]))
    shift = Pose2(x_m=0.8 * 5, y_m=-0.8 * 5, yaw_rad=0.0)  # whole cells: no surface is divided
    before = surfaces_of(scan_map)

    scan_map.correct({4: shift @ POSES[0], 9: POSES[1]})

    after = surfaces_of(scan_map)
    assert len(after) == len(before)
    assert np.allclose(after[:, :2].mean(axis=0) - before[:, :2].mean(axis=0), (4.0, -4.0))


def test_the_two_faces_of_a_thin_wall_are_two_surfaces() -> None:
    world = PlanWorld()
    world.box(1.98, -3.0, 2.02, 3.0)
    rng = np.random.default_rng(1)
    scan_map = ScanMap()
    for k, pose in enumerate(
        (Pose2(x_m=0.0, y_m=0.0, yaw_rad=0.0), Pose2(x_m=4.0, y_m=0.0, yaw_rad=math.pi))
    ):
        scan_map.put(Keyframe(pose_id=k, T_map_base=pose, scan=world.scan(pose, rng)))

    lines = scan_map.surfaces[scan_map.surfaces[:, 5] == 1]
    west, east = lines[lines[:, 2] < -0.9], lines[lines[:, 2] > 0.9]
    assert len(west) > 10
    assert len(east) > 10
    assert abs(west[:, 0].mean() - 1.98) < 0.01
    assert abs(east[:, 0].mean() - 2.02) < 0.01


def test_a_scan_is_the_same_seen_from_another_pose() -> None:
    offset = Pose2(x_m=0.2, y_m=-0.1, yaw_rad=0.15)
    known = POSES[2] @ offset.inverse()
    direct, moved = ScanMap(), ScanMap()
    direct.put(Keyframe(pose_id=0, T_map_base=POSES[2], scan=SCANS[2]))
    moved.put(Keyframe(pose_id=0, T_map_base=known, scan=SCANS[2].seen_from(offset)))

    assert np.allclose(surfaces_of(direct), surfaces_of(moved), atol=1e-9)


def test_an_empty_scan_changes_nothing() -> None:
    empty = Scan(
        points_base=np.zeros((0, 2)),
        variance_m2=np.zeros(0),
        normals=np.zeros((0, 2)),
        origin=np.zeros(2),
    )
    scan_map = ScanMap()
    scan_map.put(Keyframe(pose_id=0, T_map_base=POSES[0], scan=empty))

    assert len(scan_map.surfaces) == 0
