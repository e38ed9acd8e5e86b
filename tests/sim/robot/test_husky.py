"""The robot's model loads where the console needs it."""

from __future__ import annotations

import yourdfpy

from sim.robot.husky import WHEELS, husky_urdf


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
