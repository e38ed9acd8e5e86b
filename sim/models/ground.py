"""The ground: flat, rolling in long gentle waves, or flat with raised parts on it. Height and slope
are known anywhere.

Waves keep to a plane around the robot (the paper's 10 cm above ground): not their slope is small
but its change. Raised parts do not: they are the ramps, kerbs and stairs of built places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navcore.geometry.transform import Matrix, Pose2, tilt_matrix
from navcore.toml_config import ranged
from sim.models.raised_ground import RaisedGround

Floats = npt.NDArray[np.float64]
WAVES = 7
"""Number of plane waves."""
LONGEST = 2.0
"""Ratio of the longest to the shortest wave length."""
FLAT_SHARE = 1e-9
"""A smaller slope counts as flat."""
FOOT_M = 0.27
"""Default distance of the feet of a body from its middle along x and y."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Relief:
    """Relief of the ground; the seed of the run decides where its hills are."""

    slope: float = ranged(0.0, 0.3)
    """Largest slope, rise per metre."""
    wave_m: float = ranged(5.0, 1000.0)
    """Length of the shortest wave; the longest is twice as long."""
    seed: int = ranged(0, 1 << 53, default=0)
    """Seed of the positions of the hills; replaced by the seed of the run."""


class Ground:
    """A ground of plane waves, or of raised parts; without either it is flat, at height 0."""

    def __init__(
        self,
        relief: Relief | None = None,
        raised: Sequence[RaisedGround] = (),
        *,
        foot_m: float = FOOT_M,
    ) -> None:
        """`foot_m`: distance of the feet of the bodies that stand on it from their middle along x
        and y."""
        rng = np.random.default_rng((0 if relief is None else relief.seed, WAVES))
        slope, wave_m = (0.0, 1.0) if relief is None else (relief.slope, relief.wave_m)
        self.rolls = slope >= FLAT_SHARE
        """Whether there are waves."""
        self.is_flat = not self.rolls and not raised
        """Whether the height is 0 everywhere."""
        self._foot_m = foot_m
        self.raised = tuple(raised)
        """Raised parts, which stand on a floor without waves."""
        turn, length_m = (
            rng.uniform(0, 2 * math.pi, WAVES),
            wave_m * rng.uniform(1.0, LONGEST, WAVES),
        )
        shares = rng.uniform(0.6, 1.4, WAVES)
        # The slopes of all waves sum up to the largest slope at most, wherever they meet.
        slopes, per_m = slope * shares / shares.sum(), 2 * math.pi / length_m
        self._waves = np.column_stack([per_m * np.cos(turn), per_m * np.sin(turn)])
        self._phases, self._heights_m = rng.uniform(0, 2 * math.pi, WAVES), slopes / per_m

    def heights(self, points: Floats) -> Floats:
        """Return (N,) heights in metres at (N, 2) points x, y; of raised parts that overlap, the
        highest counts."""
        if self.raised:
            heights = np.zeros(len(points))
            for part in self.raised:
                own = part.pose.from_parent(points)
                on = part.covers(own)
                heights[on] = np.maximum(heights[on], part.heights(own[on]))
            return heights
        return np.asarray(np.sin(points @ self._waves.T + self._phases) @ self._heights_m)

    def slopes(self, points: Floats) -> Floats:
        """Return (N, 2) slopes along x and y, rise per metre, at (N, 2) points."""
        return np.asarray(
            (np.cos(points @ self._waves.T + self._phases) * self._heights_m) @ self._waves
        )

    def height_m(self, x_m: float, y_m: float) -> float:
        """Return the height at one point."""
        return 0.0 if self.is_flat else float(self.heights(np.array([[x_m, y_m]]))[0])

    def gradient(self, pose: Pose2) -> tuple[float, float]:
        """Return the slope ahead of a pose and to its left, rise per metre; on raised parts that of
        a body with its feet at the corners of a square."""
        if self.is_flat:
            return 0.0, 0.0
        if self.raised:
            (back_right, back_left), (front_right, front_left) = self._feet_m(pose).reshape(2, 2)
            ahead = front_right + front_left - back_right - back_left
            left = back_left + front_left - back_right - front_right
            return float(ahead) / (4 * self._foot_m), float(left) / (4 * self._foot_m)
        ((along_x, along_y),) = self.slopes(np.array([[pose.x_m, pose.y_m]])).tolist()
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        return cos * along_x + sin * along_y, cos * along_y - sin * along_x

    def attitude(self, pose: Pose2) -> tuple[float, float, float]:
        """Return roll, pitch and yaw (REP 103) in radians of a body that stands on the ground with
        all its feet."""
        ahead, left = self.gradient(pose)
        return math.atan(left), -math.atan(ahead), pose.yaw_rad

    def surface_pose(self, pose: Pose2) -> Matrix:
        """Return the (4, 4) T_map_base of a body that stands on the ground at a pose."""
        flat = pose.matrix()
        if self.is_flat:
            return flat
        roll, pitch, _ = self.attitude(pose)
        surface_pose: Matrix = flat @ tilt_matrix(roll, pitch)
        surface_pose[2, 3] = self.standing_m(pose)
        return surface_pose

    def standing_m(self, pose: Pose2) -> float:
        """Return the height of the middle of a body that stands on the ground at a pose."""
        if self.raised:
            return float(self._feet_m(pose).mean())
        return self.height_m(pose.x_m, pose.y_m)

    def _feet_m(self, pose: Pose2) -> Floats:
        """Return (4,) heights below the feet: back right, back left, front right, front left."""
        feet = self._foot_m * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)], dtype=np.float64)
        return self.heights(pose.to_parent(feet))


FLAT = Ground()
"""The ground of every world without relief."""
