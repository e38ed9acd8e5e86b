"""Expected errors of a recording's trajectory, which stands for odometry.

It comes from a dense tracker or a motion capture system and not from wheels: no scale and no bias,
a few millimetres of noise. With the errors of wheels, what scans of a camera in the hand say of the
motion would count for more than the trajectory.
"""

from __future__ import annotations

import dataclasses

from navcore.config.localisation.localisation import OdometryConfig
from navcore.config.navigator import NavigatorConfig

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


def for_recordings(config: NavigatorConfig) -> NavigatorConfig:
    """Return a configuration with the odometry of recordings."""
    localisation = dataclasses.replace(config.localisation, odometry=TRAJECTORY)
    return dataclasses.replace(config, localisation=localisation)
