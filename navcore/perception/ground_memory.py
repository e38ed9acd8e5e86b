"""Memory of raised ground: the height of what was seen as ground a moment ago.

Seen from the side, or with its foot out of view, a ramp is a surface above the floor like a table.
If its foot was in view before, what was ground then is ground still, and the ramp is grown from
there. Heights are remembered against gravity: the height of the robot's own plane follows the
slopes that it drives, by roll and pitch. As their errors add up over the way, what was seen more
than some metres of driving ago is forgotten, and the memory only confirms a measurement.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navcore.config.perception.perception import GroundConfig
from navcore.geometry.arrays import FloatImage, Floats, Indices
from navcore.geometry.transform import Pose2
from navcore.perception.ground import GroundCells, cell_centres, ground_cells, heights_per_pixel
from navcore.robot.frame import Frame

SIDE = 128
"""Side in cells of the square around the robot that is remembered."""
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
        known = None if self._cells is None else self._known(self._cells, frame, config)
        ground = ground_cells(frame, max_slope, config, slopes, known)
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

    def _known(self, cells: npt.NDArray[np.void], frame: Frame, config: GroundConfig) -> Floats:
        """Return the remembered heights in the cells around the robot, as `ground_cells` takes
        them."""
        at = _cells_around(frame, config)
        held = cells[at[:, 0] % SIDE, at[:, 1] % SIDE]
        is_held = (held["cell"] == at).all(axis=1)
        is_held &= self._driven_m - held["seen_m"] <= config.remembered_m
        return np.where(is_held, held["height_m"] - self._plane_m(frame, config), np.nan)

    def _remember(self, frame: Frame, ground: GroundCells, config: GroundConfig) -> None:
        # What is lower is no obstacle either where it is not known to be ground.
        raised = ground.is_measured & (np.abs(ground.heights_m) >= config.object_height_m)
        if not raised.any():
            return
        if self._cells is None:
            self._cells = np.zeros((SIDE, SIDE), dtype=_CELL)
            self._cells["seen_m"] = -np.inf
        chosen = raised.reshape(-1)
        at = _cells_around(frame, config)[chosen]
        height_m = (ground.heights_m.reshape(-1) + self._plane_m(frame, config))[chosen]
        new = np.empty(len(at), dtype=_CELL)
        new["cell"], new["height_m"], new["seen_m"] = at, height_m, self._driven_m
        self._cells[at[:, 0] % SIDE, at[:, 1] % SIDE] = new

    def _plane_m(self, frame: Frame, config: GroundConfig) -> Floats:
        """Return the (N,) height in metres, against gravity, of the robot's plane in the cells
        around it."""
        return np.asarray(self._robot_m + cell_centres(config) @ frame.plane_slope)


def _cells_around(frame: Frame, config: GroundConfig) -> Indices:
    """Return the (N, 2) cells of odometry's frame in which the cells around the robot lie."""
    centres = frame.pose.to_parent(cell_centres(config))
    return np.floor(centres / config.cell_m).astype(np.int64)
