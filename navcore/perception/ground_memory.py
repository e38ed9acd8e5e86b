"""Memory of raised ground: the height of what was seen as ground a moment ago.

Seen from the side, or with its foot out of view, a ramp is a surface above the floor like a table.
If its foot was in view before, what was ground then is ground still, and the ramp is grown from
there. Heights are remembered against gravity: the height of the robot's own plane follows the
slopes that it drives, by roll and pitch, which a robot must measure for it. As their errors add up
over the way, what was seen more than some metres of driving ago is forgotten, however often it was
taken for ground since by the memory alone. The memory only confirms a measurement above the plane
on which the robot stands: what is below is a drop, unless this image shows how the ground leads
there.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import GroundConfig
from navcore.geometry.arrays import FloatImage, Floats, Indices
from navcore.geometry.transform import Pose2
from navcore.perception.ground import (
    GroundCells,
    KnownGround,
    cell_centres,
    ground_cells,
    heights_per_pixel,
)
from navcore.robot.frame import Frame

SIDE = 128
"""Side in cells of the square around the robot that is remembered."""
REMEMBERED_M = 10.0
"""Way in metres that the robot drives until the height of raised ground is forgotten."""
JUMP_M = 1.0
"""Distance in metres between two frames from which the robot was moved by other means."""
_CELL = np.dtype([("cell", np.int64, (2,)), ("height_m", np.float64), ("seen_m", np.float64)])


class GroundMemory:
    """Estimates the ground of consecutive frames, whose poses are in odometry's frame."""

    def __init__(self) -> None:
        self._cells: npt.NDArray[np.void] | None = None  # (SIDE, SIDE), cell modulo SIDE
        self._pose: Pose2 | None = None
        self._robot_m = self._driven_m = 0.0

    def estimate(
        self, frame: Frame, max_slope: float, config: GroundConfig, slopes: Floats | None
    ) -> FloatImage:
        """Return the heights of `ground.ground_heights`, with what is remembered of raised ground,
        and remember what this frame shows of it."""
        self._follow(frame)
        ground = ground_cells(frame, max_slope, config, slopes, self._known(frame, config))
        if ground is not None:
            self._remember(frame, ground, config)
        return heights_per_pixel(frame, ground, config)

    def forget(self) -> None:
        """Forget all ground."""
        self._cells = None

    def _follow(self, frame: Frame) -> None:
        """Follow the height of the plane on which the robot stands along its way."""
        if self._pose is not None:
            step = frame.pose.from_parent(np.array([[self._pose.x_m, self._pose.y_m]]))[0]
            step_m = float(np.hypot(*step))
            if step_m > JUMP_M:
                self.forget()
            self._robot_m -= float(frame.plane_slope @ step)
            self._driven_m += step_m
        self._pose = frame.pose

    def _known(self, frame: Frame, config: GroundConfig) -> KnownGround:
        heights_m = np.full((config.cells_ahead, 2 * config.cells_aside), np.nan)
        known = KnownGround(heights_m, heights_m.copy(), self._driven_m)
        if self._cells is not None:
            at = _cells_around(frame, config)
            held = self._cells[at[:, 0] % SIDE, at[:, 1] % SIDE]
            above_m = held["height_m"] - self._plane_m(frame, config)
            is_held = (held["cell"] == at).all(axis=1) & (above_m >= config.object_height_m)
            is_held &= self._driven_m - held["seen_m"] <= REMEMBERED_M
            known.heights_m.flat[is_held] = above_m[is_held]
            known.seen_m.flat[is_held] = held["seen_m"][is_held]
        return known

    def _remember(self, frame: Frame, ground: GroundCells, config: GroundConfig) -> None:
        # Ground that rises by less is none that could be taken for an obstacle.
        raised = ~np.isnan(ground.seen_m) & (ground.heights_m >= config.object_height_m)
        if self._cells is None:
            if not raised.any():
                return
            self._cells = np.zeros((SIDE, SIDE), dtype=_CELL)
            self._cells["seen_m"] = -np.inf
        around, heights_m = _cells_around(frame, config), ground.heights_m.reshape(-1)
        refuted = around[ground.is_refuted.reshape(-1)]
        self._cells["seen_m"][refuted[:, 0] % SIDE, refuted[:, 1] % SIDE] = -np.inf
        chosen = raised.reshape(-1)
        at = around[chosen]
        new = np.empty(len(at), dtype=_CELL)
        new["cell"], new["seen_m"] = at, ground.seen_m.reshape(-1)[chosen]
        new["height_m"] = (heights_m + self._plane_m(frame, config))[chosen]
        self._cells[at[:, 0] % SIDE, at[:, 1] % SIDE] = new

    def _plane_m(self, frame: Frame, config: GroundConfig) -> Floats:
        """Return the (N,) height in metres, against gravity, of the robot's plane in the cells
        around it."""
        return np.asarray(self._robot_m + cell_centres(config) @ frame.plane_slope)


def _cells_around(frame: Frame, config: GroundConfig) -> Indices:
    """Return the (N, 2) cells of odometry's frame in which the cells around the robot lie."""
    centres = frame.pose.to_parent(cell_centres(config))
    return np.floor(centres / config.cell_m).astype(np.int64)
