"""The Clearpath Jackal: a model of its own, of a box and four cylinders, with the platform's
measures and mass."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from sim.robot.skid_steer import Chassis
from sim.robot.tyres import Tyres
from sim.robot.urdf_cache import cached_urdf

WHEEL_RADIUS_M = 0.098
WHEEL_WIDTH_M = 0.04
TRACK_M = 0.3755
WHEELBASE_M = 0.262
WHEEL_KG = 0.48
BODY_KG = 17.0 - 4 * WHEEL_KG
BODY_M = (0.508, 0.43, 0.12)
"""As long and wide as the footprint, so that what the footprint touches the body touches."""
BODY_BOTTOM_M = 0.13
"""High enough to leave the wheels a sight of the floor."""


@cache
def jackal_urdf() -> Path:
    """The model in a file that any URDF reader loads, in the system's folder for temporary files."""
    return cached_urdf("jackal", _urdf())


def _urdf() -> str:
    length, width, height = BODY_M
    middle = BODY_BOTTOM_M + height / 2
    body = _inertial(BODY_KG, (length**2, width**2, height**2), f"0 0 {middle}")
    box = (
        f'<origin xyz="0 0 {middle}"/><geometry><box size="{length} {width} {height}"/></geometry>'
    )
    wheels = "".join(
        _wheel(f"{end}_{side}", along * WHEELBASE_M / 2, across * TRACK_M / 2)
        for end, along in (("front", 1), ("rear", -1))
        for side, across in (("left", 1), ("right", -1))
    )
    yellow = '<material name="yellow"><color rgba="0.9 0.75 0.1 1"/></material>'
    return (
        '<?xml version="1.0"?>\n<robot name="jackal">'
        f'<link name="base_link">{body}<visual>{box}{yellow}</visual><collision>{box}</collision></link>{wheels}</robot>\n'
    )


def _wheel(name: str, x_m: float, y_m: float) -> str:
    shape = f'<geometry><cylinder radius="{WHEEL_RADIUS_M}" length="{WHEEL_WIDTH_M}"/></geometry>'
    turned = f'<origin rpy="1.5707963267948966 0 0"/>{shape}'
    black = '<material name="black"><color rgba="0.1 0.1 0.1 1"/></material>'
    inertial = _inertial(
        WHEEL_KG, (WHEEL_RADIUS_M**2 * 3, WHEEL_RADIUS_M**2 * 3, WHEEL_RADIUS_M**2 * 3), "0 0 0"
    )
    return (
        f'<link name="{name}_wheel_link">{inertial}<visual>{turned}{black}</visual><collision>{turned}</collision></link>'
        f'<joint name="{name}_wheel" type="continuous"><parent link="base_link"/><child link="{name}_wheel_link"/>'
        f'<origin xyz="{x_m} {y_m} {WHEEL_RADIUS_M}"/><axis xyz="0 1 0"/></joint>'
    )


def _inertial(mass_kg: float, squares_m2: tuple[float, float, float], place: str) -> str:
    """Of a box with sides of these squares."""
    x, y, z = squares_m2
    moments = [mass_kg * pair / 12 for pair in (y + z, x + z, x + y)]
    ixx, iyy, izz = (f"{moment:.6f}" for moment in moments)
    return (
        f'<inertial><origin xyz="{place}"/><mass value="{mass_kg}"/>'
        f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial>'
    )


JACKAL_CHASSIS = Chassis(
    urdf=jackal_urdf,
    wheels=(0, 1, 2, 3),
    wheel_radius_m=WHEEL_RADIUS_M,
    track_m=TRACK_M,
    wheel_torque_nm=10.0,
    grip_height_m=0.15,
    tyres=Tyres(stiffness_nspm=1000.0, side_grip_n=66.0, scrub_nms=15.0, scrub_nm=10.0),
)
