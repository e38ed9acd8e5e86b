"""Whether a platform can stop within what the safety gate looks ahead."""

from __future__ import annotations

from navcore.config.safety import DEFAULT_SAFETY, SafetyConfig
from navcore.errors import BadConfiguration
from navcore.geometry.transform import Twist
from navcore.robot.profile import RobotProfile
from navcore.safety.collision_monitor import braking_s


def check_stopping(profile: RobotProfile, config: SafetyConfig = DEFAULT_SAFETY) -> None:
    """Raise `BadConfiguration` for a platform that at full speed does not stop within what the gate
    looks ahead, in time and in distance, when it sees an obstacle as late as a frame may be."""
    collision, keep_out = config.collision, config.keep_out
    v_mps, w_radps = profile.max_speed_mps, profile.max_yaw_rate_radps
    after_frame_s = max(collision.reaction_after_frame_s, keep_out.reaction_after_frame_s)
    late_s = config.gate.frame_life_s + after_frame_s
    late_s = max(late_s, collision.reaction_s, keep_out.reaction_s)
    needed_s = late_s + braking_s(Twist(v_mps=v_mps, w_radps=w_radps), profile) / 2
    clearance_m = max(collision.padding_ahead_m, keep_out.stop_margin_m)
    needed_m = profile.circumscribed_radius_m + v_mps * needed_s + clearance_m
    range_m = min(collision.range_m, keep_out.cells_within_m)
    if needed_s > collision.horizon_s or needed_m > range_m:
        raise BadConfiguration(
            f"robot {profile.name!r} is too fast for its brakes: to stop from {v_mps:g} m/s and "
            f"{w_radps:g} rad/s with {profile.max_accel_mps2:g} m/s² and "
            f"{profile.max_yaw_accel_radps2:g} rad/s², the safety gate would have to look "
            f"{needed_s:.2f} s and {needed_m:.2f} m ahead, and it looks {collision.horizon_s:g} s "
            f"and {range_m:g} m; lower max_speed_mps or max_yaw_rate_radps"
        )
