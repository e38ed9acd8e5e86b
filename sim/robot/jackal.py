"""The Clearpath Jackal: a model of a box and four cylinders with the measures and the mass of the
platform, in `jackal.urdf` beside this file."""

from __future__ import annotations

from pathlib import Path

from sim.robot.skid_steer import Chassis
from sim.robot.tyres import Tyres


def jackal_urdf() -> Path:
    """Return the file of the model."""
    return Path(__file__).with_name("jackal.urdf")


JACKAL_CHASSIS = Chassis(
    urdf=jackal_urdf,
    wheels=(0, 1, 2, 3),
    wheel_radius_m=0.098,
    track_m=0.3755,
    foot_m=0.16,
    wheel_torque_nm=10.0,
    grip_height_m=0.15,
    tyres=Tyres(stiffness_nspm=1000.0, side_grip_n=66.0, scrub_nms=15.0, scrub_nm=10.0),
)
