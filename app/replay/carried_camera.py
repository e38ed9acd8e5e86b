"""How the camera of a recording moves, and what is known of its motion.

Its trajectory, which stands for odometry, comes from a dense tracker or a motion capture system and
not from wheels: no scale and no bias, a few millimetres of noise. With the errors of wheels, what
scans of a camera in the hand say of the motion would count for more than the trajectory.

The camera is carried by a person, who walks sideways and faster than a robot.
"""

from __future__ import annotations

import dataclasses

from navcore.config.localisation.localisation import OdometryConfig
from navcore.config.navigator import NavigatorConfig
from navcore.config.safety import DEFAULT_SAFETY, SensorMonitorConfig

TRAJECTORY = OdometryConfig(
    length_scale=0.001,
    length_floor=0.001,
    gyro_scale=0.001,
    gyro_bias_degph=1.0,
    gyro_noise_deg=0.005,
    slip_m=0.003,
    aside_m=0.003,
    turn_slip_m=0.003,
)
PLAUSIBLE: SensorMonitorConfig = dataclasses.replace(
    DEFAULT_SAFETY.sensors, speed_factor=3.0, distance_tolerance_m=0.5, turn_tolerance_rad=1.0
)
"""Which frames are plausible: between two of them the camera may move sideways, which no wheel
measures, and images are left out where the computer is slower than the recording."""


def for_recordings(config: NavigatorConfig) -> NavigatorConfig:
    """Return a configuration with the odometry of recordings."""
    localisation = dataclasses.replace(config.localisation, odometry=TRAJECTORY)
    return dataclasses.replace(config, localisation=localisation)
