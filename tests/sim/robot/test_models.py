"""The URDF models load where the console needs them and agree with the chassis."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
import yourdfpy

from navcore.robot.profile import load_profile
from sim.robot.husky import WHEELS, husky_urdf
from sim.robot.jackal import JACKAL_CHASSIS
from sim.robot.urdf_cache import cached_urdf


def test_the_urdf_loads_with_all_its_meshes_outside_of_pybullet() -> None:
    path = husky_urdf()
    assert "$(" not in path.read_text(encoding="utf-8")
    model = yourdfpy.URDF.load(str(path))
    assert set(model.actuated_joint_names) == {
        f"{end}_{side}_wheel" for end in ("front", "rear") for side in ("left", "right")
    }
    assert len(model.actuated_joint_names) == len(WHEELS)
    low, high = model.scene.bounds
    assert 0.9 < high[0] - low[0] < 1.1 and 0.6 < high[1] - low[1] < 0.75


def test_every_user_of_the_machine_can_read_the_adapted_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    path = cached_urdf("husky", "<robot/>")
    assert path.parent == tmp_path and path.stat().st_mode & 0o777 == 0o644


def test_the_jackals_urdf_has_the_measures_of_its_chassis_and_the_footprint_of_its_profile() -> (
    None
):
    model = yourdfpy.URDF.load(str(JACKAL_CHASSIS.urdf()))
    joints = [model.joint_map[name] for name in model.actuated_joint_names]
    assert len(joints) == len(JACKAL_CHASSIS.wheels)
    assert {abs(joint.origin[1, 3]) for joint in joints} == {JACKAL_CHASSIS.track_m / 2}
    assert {joint.origin[2, 3] for joint in joints} == {JACKAL_CHASSIS.wheel_radius_m}
    away_m = np.mean([np.abs(joint.origin[:2, 3]) for joint in joints])
    assert JACKAL_CHASSIS.foot_m == pytest.approx(away_m, abs=0.001)
    profile = load_profile("jackal")
    body = model.link_map["base_link"].collisions[0].geometry.box.size
    assert np.array(body[:2]) == pytest.approx((profile.length_m, profile.width_m))
    masses = [link.inertial.mass for link in model.link_map.values()]
    assert sum(masses) == pytest.approx(17.0)
