"""The Clearpath Husky A200: PyBullet's model of it, its wheels and tyres."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pybullet_data

from sim.robot.skid_steer import Chassis
from sim.robot.tyres import Tyres
from sim.robot.urdf_cache import cached_urdf

WHEELS = (2, 3, 4, 5)
"""Joints of the wheels: front left, front right, rear left, rear right."""
CENTRE_OF_MASS = "0 0 0.09947"
"""Centre of mass of the base link. The empty platform is heavier behind and turns about its rear
axle; the load that it carries here balances it."""
LIGHT_INERTIAL = """
<inertial>
  <mass value="0.5"/>
  <inertia ixx="0.005" ixy="0" ixz="0" iyy="0.005" iyz="0" izz="0.005"/>
</inertial>
"""
"""Inertia of a link for which the model gives none."""
ROS_DEFAULT = re.compile(r"\$\(optenv \w+ ([^)]*)\)")
"""A ROS substitution by an environment variable, with its default as group 1."""


@cache
def husky_urdf() -> Path:
    """Return a copy of PyBullet's husky.urdf that any URDF reader loads: no ROS substitutions,
    absolute mesh paths, and a mass for every link.
    """
    source = Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf"
    robot = ElementTree.fromstring(source.read_text(encoding="utf-8"))
    _adapt(robot, source.parent)
    return cached_urdf("husky", ElementTree.tostring(robot, encoding="unicode"))


def _adapt(robot: ElementTree.Element, folder: Path) -> None:
    for gazebo in robot.findall("gazebo"):
        robot.remove(gazebo)
    for element in robot.iter():
        for name, value in element.items():
            element.set(name, ROS_DEFAULT.sub(r"\1", value))
    for mesh in robot.iter("mesh"):
        mesh.set("filename", (folder / mesh.attrib["filename"]).as_posix())
    for link in robot.iter("link"):
        if link.find("inertial") is None:
            link.append(ElementTree.fromstring(LIGHT_INERTIAL))
    for centre in robot.findall("link[@name='base_link']/inertial/origin"):
        centre.set("xyz", CENTRE_OF_MASS)


HUSKY_CHASSIS = Chassis(
    urdf=husky_urdf,
    wheels=WHEELS,
    wheel_radius_m=0.17775,
    track_m=0.5708,
    foot_m=0.27,
    wheel_torque_nm=60.0,
    grip_height_m=0.2,
    tyres=Tyres(stiffness_nspm=3000.0, side_grip_n=200.0, scrub_nms=200.0, scrub_nm=60.0),
)
