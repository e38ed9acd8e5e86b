"""Application of corrections: small ones flow in while driving, large ones wait for standstill."""

from __future__ import annotations

import math

from navcore.config.localisation.localisation import TrackingConfig
from navcore.geometry.transform import IDENTITY, Pose2, wrap_angle


class CorrectionFlow:
    """T_map_odom as everything downstream uses it, which follows the best estimate."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self.T_map_odom = IDENTITY
        """Applied pose of odometry's frame in the map."""
        self.pending: Pose2 | None = None
        """T_map_base that the correction which waits for standstill leads to; None if none
        waits."""

    def jump(self, T_map_base: Pose2, T_odom_base: Pose2) -> None:
        """Apply a pose at once."""
        self.T_map_odom = T_map_base @ T_odom_base.inverse()
        self.pending = None

    def follow(self, T_map_base: Pose2, T_odom_base: Pose2, *, standing: bool) -> None:
        """Come nearer to the best estimate of the pose, by as much as is allowed in one frame."""
        rules, applied = self._config, self.T_map_odom @ T_odom_base
        distance = applied.distance_to(T_map_base.x_m, T_map_base.y_m)
        turn = wrap_angle(T_map_base.yaw_rad - applied.yaw_rad)
        if standing:
            self.jump(T_map_base, T_odom_base)
            return
        if distance > rules.pending_m or abs(turn) > math.radians(rules.pending_deg):
            self.pending = T_map_base
            return
        share = min(
            1.0,
            rules.flow_m / max(distance, 1e-9),
            math.radians(rules.flow_deg) / max(abs(turn), 1e-9),
        )
        self.jump(
            Pose2(
                x_m=applied.x_m + share * (T_map_base.x_m - applied.x_m),
                y_m=applied.y_m + share * (T_map_base.y_m - applied.y_m),
                yaw_rad=wrap_angle(applied.yaw_rad + share * turn),
            ),
            T_odom_base,
        )
