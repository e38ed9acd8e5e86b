"""The Husky A200: PyBullet's model of it, its wheels and tyres."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pybullet_data

from sim.robot.skid_steer import Chassis
from sim.robot.tyres import Tyres
from sim.robot.urdf_cache import cached_urdf

WHEELS = (2, 3, 4, 5)
"""Joints of the wheels: front left, front right, rear left, rear right."""


@cache
def husky_urdf() -> Path:
    """A copy of PyBullet's husky.urdf that any URDF reader loads: no ROS substitutions, absolute
    mesh paths, and a mass for every link.
    """
    source = Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf"
    text = _readable(source.read_text(encoding="utf-8"), source.parent)
    return cached_urdf("husky", text)


def _readable(urdf: str, folder: Path) -> str:
    urdf = re.sub(r"\$\(optenv \w+ ([^)]*)\)", r"\1", urdf)
    urdf = urdf.replace('filename="meshes/', f'filename="{folder.as_posix()}/meshes/')
    urdf = re.sub(r"<gazebo.*?</gazebo>", "", urdf, flags=re.DOTALL)
    urdf = re.sub(r'<link name="(\w+)"\s*/>', r'<link name="\1"></link>', urdf)
    # Bare, it is heavier behind and turns about its rear axle; the load it carries here balances
    # it.
    urdf = urdf.replace('xyz="-0.08748 -0.00085 0.09947"', 'xyz="0 0 0.09947"')
    light = '<inertial><mass value="0.5"/><inertia ixx="0.005" ixy="0" ixz="0" iyy="0.005" iyz="0" izz="0.005"/></inertial>'
    return re.sub(
        r"<link\b.*?</link>", lambda link: _with_mass(link[0], light), urdf, flags=re.DOTALL
    )


def _with_mass(link: str, inertial: str) -> str:
    return link if "<inertial>" in link else link.replace("</link>", inertial + "</link>")


HUSKY_CHASSIS = Chassis(
    urdf=husky_urdf,
    wheels=WHEELS,
    wheel_radius_m=0.17775,
    track_m=0.5708,
    wheel_torque_nm=60.0,
    grip_height_m=0.2,
    tyres=Tyres(stiffness_nspm=3000.0, side_grip_n=200.0, scrub_nms=200.0, scrub_nm=60.0),
)
